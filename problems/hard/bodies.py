"""Constants and functions that the hard cases share."""

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.laws import Laws
from ..contact.problem import ContactProblem

GRAVITY = 9.81
"""Gravitational acceleration [m/s²]."""

TIME_STEP = 1e-3
"""Time step [s]."""

WEIGHT = GRAVITY * TIME_STEP
"""Impulse that carries one kilogram for one step [N s], and velocity after one step of free fall [m/s]."""


def body_problem(
    directions: Any,
    inverse_mass: FloatArray,
    motion: FloatArray,
    friction: ArrayLike | None = None,
    dim: int | None = None,
    *,
    answer: Answer,
    laws: Laws | None = None,
) -> ContactProblem:
    """Return the problem of bodies without restitution, c = Wᵀ u for their free motion u.

    Args:
        directions: W, dense or scipy sparse, shape (n_dofs, n_rows).
        inverse_mass: diagonal of M⁻¹, shape (n_dofs,).
        motion: u, shape (n_dofs,).
        friction: μ, one number or one for each contact.
        dim: rows per contact.
        answer: the known part of the solution.
        laws: any laws, instead of ``friction`` and ``dim``.
    """
    arguments = directions, inverse_mass, directions.T @ motion, friction, dim
    return ContactProblem.from_factors(*arguments, laws=laws, free_motion=motion, answer=answer)


def box_friction_impulses(delassus: FloatArray, c: FloatArray, bound: FloatArray) -> FloatArray:
    """Solve −(GΛ + c) ∈ N_C(Λ) with C = {|Λ_i| ≤ b_i} for two rows, and return Λ.

    Each row slips in one of two directions or sticks. G is positive definite, so one of the nine cases gives the
    solution.

    Args:
        delassus: G, shape (2, 2).
        c: the velocity without the two impulses, shape (2,).
        bound: b ≥ 0, shape (2,).
    """
    best, smallest = np.zeros(2), np.inf
    for sides in product((0.0, 1.0, -1.0), repeat=2):
        impulses = np.array(sides) * bound
        sticks = np.array(sides) == 0.0
        if sticks.any():
            block = delassus[np.ix_(sticks, sticks)]
            impulses[sticks] = -np.linalg.solve(block, (delassus @ impulses + c)[sticks])
        argument = impulses - (delassus @ impulses + c) / delassus.diagonal()
        violation = float(np.abs(delassus.diagonal() * (impulses - np.clip(argument, -bound, bound))).max())
        if violation < smallest:
            best, smallest = np.clip(impulses, -bound, bound), violation
    return best
