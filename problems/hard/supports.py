"""Bodies at rest and sliding on redundant, identical and duplicated supports.

The impulses of single contacts are not unique, but their sums and all velocities are. If normal impulses alone can
bear the load (M u_f = −W_N λ with λ ≥ 0), every solution is at rest for any friction: no impulse of a solution does
positive work on ξ = Wᵀu, so that u·M u ≤ u·M u_f = −λ·ξ_N ≤ 0.

On a body that slides at 1 m/s, a residual ρ permits velocity errors of ρ m/s at each of n supports. Relative to the
impulse of the weight, m g Δt = 0.00981 N s, this is 100 n ρ. The sensitivity is 2 (1 + μ) times as large.
"""

import numpy as np

from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from .bodies import WEIGHT, body_problem


def block_on_supports(n: int) -> ContactProblem:
    """Return a block of 1 kg at rest on ``n`` ≥ 2 frictionless supports: Σ Λ_N = m g Δt, Σ x Λ_N = 0, ξ = 0.

    q = (y, φ), and the supports are spread over 1 m.
    """
    directions, motion = np.vstack([np.ones(n), np.linspace(-0.5, 0.5, n)]), np.array([-WEIGHT, 0.0])
    answer = Answer(velocity=np.zeros(n), functionals=directions, values=np.array([WEIGHT, 0.0]))
    return body_problem(directions, np.array([1.0, 12.0]), motion, dim=1, answer=answer)


def identical_contacts(n: int) -> ContactProblem:
    """Return a point mass of 1 kg on ``n`` copies of one contact: G is all ones, Σ Λ = m g Δt, ξ = 0."""
    c = np.full(n, -WEIGHT)
    answer = Answer(velocity=np.zeros(n), functionals=np.ones((1, n)), values=np.array([WEIGHT]))
    return ContactProblem.from_factors(np.ones((1, n)), np.ones(1), c, dim=1, answer=answer)


def duplicated_slider(copies: int = 10, friction: float = 0.3) -> ContactProblem:
    """Return a sliding point mass with ``copies`` equal spatial contacts.

    It slides at 1 m/s along x, so Σ Λ_N = m g Δt and Σ Λ_T = (−μ m g Δt, 0).
    """
    directions = np.tile(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), copies)
    answer = Answer(
        velocity=np.tile([0.0, 1.0 - friction * WEIGHT, 0.0], copies),
        functionals=directions,
        values=np.array([-friction * WEIGHT, 0.0, WEIGHT]),
        sensitivity=200.0 * copies * (1.0 + friction),
    )
    return body_problem(directions, np.ones(3), np.array([1.0, 0.0, -WEIGHT]), friction, answer=answer)


def sliding_block(friction: float = 0.3, n: int = 4) -> ContactProblem:
    """Return a planar block of 1 kg that slides at 1 m/s on ``n`` supports at the height of its centre of mass.

    No moment arises: Σ Λ_N = m g Δt, Σ Λ_T = −μ m g Δt.
    """
    directions = np.zeros((3, 2 * n))
    directions[1, 0::2], directions[2, 0::2], directions[0, 1::2] = 1.0, np.linspace(-0.5, 0.5, n), 1.0
    answer = Answer(
        velocity=np.tile([0.0, 1.0 - friction * WEIGHT], n),
        functionals=directions[[1, 0, 2]],
        values=np.array([WEIGHT, -friction * WEIGHT, 0.0]),
        sensitivity=200.0 * n * (1.0 + friction),
    )
    motion = np.array([1.0, -WEIGHT, 0.0])
    return body_problem(directions, np.array([1.0, 1.0, 12.0]), motion, friction, dim=2, answer=answer)


def sticking_box(speed: float = 1e-3, per_side: int = 2) -> ContactProblem:
    """Return a flat box of 1 kg that sticks on a square grid of contacts, with the free velocity ``speed`` along x.

    Σ Λ_T = −m v_0. Normals and tangents are uncoupled, and Λ_T,i = −m v_0 Λ_N,i/ΣΛ_N holds the box for
    every admissible distribution of the normal impulses, so ξ = 0 is the only velocity.
    """
    side, directions = np.linspace(-0.5, 0.5, per_side), np.zeros((6, 3 * per_side**2))
    inertia = np.array([1.0 / 12.0, 1.0 / 12.0, 1.0 / 6.0])
    for contact, (x, y) in enumerate([(x, y) for y in side for x in side]):
        arm = np.array([x, y, 0.0])
        for lane, axis in enumerate((np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))):
            directions[:3, 3 * contact + lane] = axis
            directions[3:, 3 * contact + lane] = np.cross(arm, axis)
    motion = np.array([speed, 0.0, -WEIGHT, 0.0, 0.0, 0.0])
    values = np.array([-speed, 0.0, WEIGHT])
    answer = Answer(velocity=np.zeros(directions.shape[1]), functionals=directions[:3], values=values)
    return body_problem(directions, np.concatenate([np.ones(3), 1.0 / inertia]), motion, 0.5, answer=answer)


def resting_block(n: int, friction: float) -> ContactProblem:
    """Return a planar block of 1 kg at rest on ``n`` supports half a metre below its centre, with friction.

    Normal impulses alone can bear the block, so ξ = 0; Σ Λ_N = m g Δt, Σ Λ_T = 0, Σ (x Λ_N + Λ_T/2) = 0.
    """
    directions = np.zeros((3, 2 * n))
    directions[1, 0::2], directions[2, 0::2] = 1.0, np.linspace(-0.5, 0.5, n)
    directions[0, 1::2], directions[2, 1::2] = 1.0, 0.5
    motion = np.array([0.0, -WEIGHT, 0.0])
    answer = Answer(velocity=np.zeros(2 * n), functionals=directions, values=np.array([0.0, WEIGHT, 0.0]))
    return body_problem(directions, np.array([1.0, 1.0, 6.0]), motion, friction, dim=2, answer=answer)
