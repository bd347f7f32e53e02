"""Bodies on more supports than hold them: redundant, identical and duplicated contacts, at rest and sliding.

The impulses of single contacts are not unique, their sums and all velocities are. Where the load is borne by normal
impulses alone, M u_f = −W_N λ with λ ≥ 0, every solution is at rest whatever the friction: no impulse of a solution
does positive work on ξ = Wᵀu, so that u·M u ≤ u·M u_f = −λ·ξ_N ≤ 0.

On a body that slides at 1 m/s a residual ρ means velocities wrong by ρ m/s at each of n supports, which is 100 n ρ of
the weight m g Δt = 0.00981 N s: hence the sensitivities.
"""

import numpy as np

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from .scale import GRAVITY, TIME_STEP


def _vertical_supports(n: int, mass: float, width: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Force directions W (y, φ), inverse masses and free motion of a bar on ``n`` supports spread over ``width``."""
    arms = np.linspace(-width / 2, width / 2, n)
    inertia = mass * width**2 / 12.0
    directions = np.vstack([np.ones(n), arms])
    return directions, np.array([1.0 / mass, 1.0 / inertia]), np.array([-GRAVITY * TIME_STEP, 0.0])


def block_on_supports(n: int) -> ContactProblem:
    """Return a block of 1 kg at rest on ``n`` ≥ 2 frictionless supports: Σ Λ_N = m g Δt, Σ x Λ_N = 0, ξ = 0."""
    directions, inverse_mass, motion = _vertical_supports(n, 1.0, 1.0)
    answer = Answer(velocity=np.zeros(n), functionals=directions, values=np.array([GRAVITY * TIME_STEP, 0.0]))
    return ContactProblem.from_factors(
        directions, inverse_mass, directions.T @ motion, dim=1, free_motion=motion, answer=answer
    )


def identical_contacts(n: int) -> ContactProblem:
    """Return a point mass of 1 kg on ``n`` copies of one contact: G is all ones, Σ Λ = m g Δt, ξ = 0."""
    c = np.full(n, -GRAVITY * TIME_STEP)
    answer = Answer(velocity=np.zeros(n), functionals=np.ones((1, n)), values=np.array([GRAVITY * TIME_STEP]))
    return ContactProblem.from_factors(np.ones((1, n)), np.ones(1), c, dim=1, answer=answer)


def duplicated_slider(copies: int = 10, friction: float = 0.3) -> ContactProblem:
    """Return a sliding point mass with its spatial contact written ``copies`` times.

    Sliding at 1 m/s along x: Σ Λ_N = m g Δt and Σ Λ_T = (−μ m g Δt, 0).
    """
    weight = GRAVITY * TIME_STEP
    directions = np.tile(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), copies)
    motion = np.array([1.0, 0.0, -weight])
    velocity = np.tile([0.0, 1.0 - friction * weight, 0.0], copies)
    answer = Answer(
        velocity=velocity,
        functionals=directions,
        values=np.array([-friction * weight, 0.0, weight]),
        sensitivity=200.0 * copies * (1.0 + friction),
    )
    return ContactProblem.from_factors(
        directions, np.ones(3), directions.T @ motion, friction, free_motion=motion, answer=answer
    )


def sliding_block(friction: float = 0.3, n: int = 4) -> ContactProblem:
    """Return a planar block of 1 kg that slides at 1 m/s on ``n`` supports at the height of its centre of mass.

    No moment arises: Σ Λ_N = m g Δt, Σ Λ_T = −μ m g Δt.
    """
    weight, arms = GRAVITY * TIME_STEP, np.linspace(-0.5, 0.5, n)
    directions = np.zeros((3, 2 * n))
    directions[1, 0::2], directions[2, 0::2], directions[0, 1::2] = 1.0, arms, 1.0
    motion = np.array([1.0, -weight, 0.0])
    velocity = np.tile([0.0, 1.0 - friction * weight], n)
    sums = np.zeros((3, 2 * n))
    sums[0, 0::2], sums[1, 1::2], sums[2, 0::2] = 1.0, 1.0, arms
    answer = Answer(
        velocity=velocity,
        functionals=sums,
        values=np.array([weight, -friction * weight, 0.0]),
        sensitivity=200.0 * n * (1.0 + friction),
    )
    inverse_mass = np.array([1.0, 1.0, 12.0])
    return ContactProblem.from_factors(
        directions, inverse_mass, directions.T @ motion, friction, dim=2, free_motion=motion, answer=answer
    )


def sticking_box(speed: float = 1e-3, per_side: int = 2) -> ContactProblem:
    """Return a flat box of 1 kg on a square grid of contacts that sticks, pushed slowly by ``speed`` along x.

    Σ Λ_T = −m v_0. Normals and tangents do not influence each other, and Λ_T,i = −m v_0 Λ_N,i/ΣΛ_N holds the box for
    every admissible distribution of the normal impulses, so that ξ = 0 is the only velocity.
    """
    weight, side = GRAVITY * TIME_STEP, np.linspace(-0.5, 0.5, per_side)
    directions = np.zeros((6, 3 * per_side**2))
    inertia = np.array([1.0 / 12.0, 1.0 / 12.0, 1.0 / 6.0])
    for corner, (x, y) in enumerate([(x, y) for y in side for x in side]):
        arm = np.array([x, y, 0.0])
        for lane, axis in enumerate((np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))):
            directions[:3, 3 * corner + lane] = axis
            directions[3:, 3 * corner + lane] = np.cross(arm, axis)
    motion = np.array([speed, 0.0, -weight, 0.0, 0.0, 0.0])
    answer = Answer(
        velocity=np.zeros(directions.shape[1]), functionals=directions[:3], values=np.array([-speed, 0.0, weight])
    )
    inverse_mass = np.concatenate([np.ones(3), 1.0 / inertia])
    return ContactProblem.from_factors(
        directions, inverse_mass, directions.T @ motion, 0.5, free_motion=motion, answer=answer
    )


def resting_block(n: int, friction: float) -> ContactProblem:
    """Return a planar block of 1 kg at rest on ``n`` supports half a metre below its centre, with friction.

    Normal impulses alone bear it, so ξ = 0; Σ Λ_N = m g Δt, Σ Λ_T = 0, Σ (x Λ_N + Λ_T/2) = 0.
    """
    weight, arms = GRAVITY * TIME_STEP, np.linspace(-0.5, 0.5, n)
    directions = np.zeros((3, 2 * n))
    directions[1, 0::2], directions[2, 0::2], directions[0, 1::2], directions[2, 1::2] = 1.0, arms, 1.0, 0.5
    motion = np.array([0.0, -weight, 0.0])
    answer = Answer(velocity=np.zeros(2 * n), functionals=directions, values=np.array([0.0, weight, 0.0]))
    return ContactProblem.from_factors(
        directions,
        np.array([1.0, 1.0, 6.0]),
        directions.T @ motion,
        friction,
        dim=2,
        free_motion=motion,
        answer=answer,
    )
