"""What the hard cases share: weight, time step, and how bodies that move freely become a contact problem."""

from numpy.typing import ArrayLike

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.problem import ContactProblem

GRAVITY = 9.81
"""[m/s²]"""

TIME_STEP = 1e-3
"""[s]"""

WEIGHT = GRAVITY * TIME_STEP
"""Impulse that bears one kilogramme for one step [N s], and the free velocity of whatever falls for one step [m/s]."""


def bodies(
    directions: FloatArray,
    inverse_mass: FloatArray,
    motion: FloatArray,
    friction: ArrayLike = 0.0,
    dim: int = 3,
    *,
    answer: Answer,
) -> ContactProblem:
    """Return the problem of bodies without restitution, c = Wᵀ u for their free motion u.

    Args:
        directions: W, shape (n_dofs, n_rows).
        inverse_mass: diagonal of M⁻¹, shape (n_dofs,).
        motion: u, shape (n_dofs,).
        friction: μ, one number or one for each contact.
        dim: rows per contact.
        answer: what is known of its solution.
    """
    c = directions.T @ motion
    return ContactProblem.from_factors(directions, inverse_mass, c, friction, dim, free_motion=motion, answer=answer)
