"""Stacks of bodies with high mass ratios: long chains of contacts that carry the weight above."""

import numpy as np

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from .bodies import WEIGHT, body_problem


def stack(masses: FloatArray) -> ContactProblem:
    """Return blocks on top of each other, ``masses`` [kg] from below: Λ_k = g Δt Σ_{j≥k} m_j, ξ = 0.

    All contacts are closed, so the judge's residual is the velocity error. An error v in ξ is an error of
    Σ_{j≥k} m_j Σ_{i≤j} v_i in Λ_k, at most n v/(g Δt) relative to Λ_k.
    """
    n = len(masses)
    impulses = WEIGHT * np.cumsum(masses[::-1])[::-1]
    answer = Answer(impulses=(impulses,), velocity=np.zeros(n), sensitivity=float(max(n, 2)))
    return body_problem(np.eye(n) - np.eye(n, k=1), 1.0 / masses, np.full(n, -WEIGHT), dim=1, answer=answer)


def top_heavy_masses(n: int, ratio: float) -> FloatArray:
    """Return masses [kg] of ``n`` blocks, from below, the last ``ratio`` times as heavy as the others."""
    return np.array([1.0] * (n - 1) + [ratio])


def bottom_heavy_masses(n: int, ratio: float) -> FloatArray:
    """Return masses [kg] of ``n`` blocks, from below, the first ``ratio`` times as heavy as the others."""
    return top_heavy_masses(n, ratio)[::-1].copy()


def sliding_tower(masses: FloatArray, friction: float = 0.2) -> ContactProblem:
    """Return a spatial stack of point masses [kg], from below, that slides as one body along (3, 4)/5 at 1 m/s.

    The ground has ``friction`` μ, all other contacts 2 μ. Normals and tangents are uncoupled. The normals carry the
    weight above, Λ_N,k = g Δt Σ_{j≥k} m_j, and the tangential impulses then minimise a strictly convex function:
    Λ_T,k = −μ Λ_N,k (3, 4)/5 slows all blocks equally, so the ground contact slips at 1 m/s − μ g Δt and all others
    stick. A residual ρ is ρ m/s at each contact, which is an impulse error of 100 n ρ relative to the weights.
    """
    n, direction = len(masses), np.array([0.6, 0.8])
    directions = np.kron(np.eye(n) - np.eye(n, k=1), np.eye(3)[:, [2, 0, 1]]).astype(np.float64)
    motion = np.tile([*direction, -WEIGHT], n)
    normal = WEIGHT * np.cumsum(masses[::-1])[::-1]
    impulses = np.column_stack([normal, *(-friction * normal * part for part in direction)]).ravel()
    velocity = np.zeros(3 * n)
    velocity[1:3] = (1.0 - friction * WEIGHT) * direction
    coefficient = np.where(np.arange(n) == 0, friction, 2.0 * friction)
    answer = Answer(impulses=(impulses,), velocity=velocity, sensitivity=200.0 * n)
    return body_problem(directions, np.repeat(1.0 / masses, 3), motion, coefficient, answer=answer)


SCALES = np.array([1.0, 1e3, 1e-3, 1.0, 1e6])
"""Scales of successive contacts of scaled problems, repeated for more than five contacts."""


def scaled_stack(n: int = 5) -> ContactProblem:
    """Return a stack of ``n`` ≥ 3 equal blocks whose contacts are scaled by 1, 1e3, 1e-3, 1 and 1e6, repeated.

    With D the scales, G → D G D and c → D c; the solution is Λ → D⁻¹ Λ, ξ → D ξ.
    """
    return _scaled(stack(np.ones(n)), 1, 4.0 * n)


def scaled_tower(n: int) -> ContactProblem:
    """Return the sliding tower of ``n`` equal point masses, its contacts scaled as in ``scaled_stack``.

    The three rows of a contact have the same scale, which leaves its friction cone unchanged.
    """
    return _scaled(sliding_tower(np.ones(n)), 3, 200.0 * n)


def _scaled(plain: ContactProblem, dim: int, sensitivity: float) -> ContactProblem:
    """Return ``plain``, which has one known solution, with each contact of ``dim`` rows scaled by one of ``SCALES``."""
    scales = np.repeat(np.resize(SCALES, plain.n_contacts), dim)
    known = plain.answer
    assert known is not None
    assert known.velocity is not None
    # the residual is relative to the free velocity of the ground contact, the only nonzero one; its scale is 1. The
    # velocity error of a contact of small scale may therefore be larger by the inverse of that scale
    answer = Answer(
        impulses=(known.impulses[0] / scales,),
        velocity=scales * known.velocity,
        sensitivity=sensitivity / float(SCALES.min()),
    )
    return ContactProblem.from_delassus(
        plain.delassus().toarray() * np.outer(scales, scales),
        scales * plain.free_velocity,
        plain.layout.friction_coefficient,
        dim=dim,
        answer=answer,
    )


def cradle(n: int, restitution: float) -> ContactProblem:
    """Return Newton's cradle: ``n`` touching balls of 1 kg, the first arriving at 1 m/s, as one coupled impact.

    With c = (1 + e) γ_B and ξ = γ_E + e γ_B = 0 at every contact, the other balls leave at (1 + e)/n and the first at
    (1 + e)/n − e, hence Λ_k = (n − k)(1 + e)/n for the contact behind ball k.
    """
    directions = (np.eye(n, k=-1) - np.eye(n))[:, : n - 1]
    motion = np.eye(n)[0]
    c = (1.0 + restitution) * (directions.T @ motion)
    impulses = (1.0 + restitution) * np.arange(n - 1, 0, -1) / n
    answer = Answer(impulses=(impulses,), velocity=np.zeros(n - 1), sensitivity=float(n * n))
    return ContactProblem.from_factors(directions, np.ones(n), c, dim=1, free_motion=motion, answer=answer)
