"""Degenerate cases: no contacts, no motion, no solution, directions of zero length."""

import numpy as np

from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from .bodies import WEIGHT, body_problem
from .stacks import sliding_tower


def empty() -> ContactProblem:
    """Return a body without contacts."""
    answer = Answer(impulses=(np.zeros(0),), velocity=np.zeros(0))
    return ContactProblem.from_factors(np.zeros((3, 0)), np.ones(3), np.zeros(0), 0.3, answer=answer)


def one_row(c: float) -> ContactProblem:
    """Return one frictionless contact of a body of 2 kg: Λ = 2 max(−c, 0)."""
    impulses = np.array([2.0 * max(-c, 0.0)])
    answer = Answer(impulses=(impulses,), velocity=0.5 * impulses + c, sensitivity=2.0)
    return ContactProblem.from_delassus(np.array([[0.5]]), np.array([c]), dim=1, answer=answer)


def no_motion(n: int = 3) -> ContactProblem:
    """Return ``n`` coupled spatial contacts with c = 0, solved by Λ = 0."""
    root = np.random.default_rng(1).normal(size=(3 * n + 3, 3 * n))
    answer = Answer(impulses=(np.zeros(3 * n),), velocity=np.zeros(3 * n))
    return ContactProblem.from_delassus(root.T @ root, np.zeros(3 * n), 0.4, answer=answer)


def almost_no_motion(speed: float) -> ContactProblem:
    """Return a block at rest on two supports with a free velocity of ``speed`` [m/s], which may be tiny or huge.

    Λ_N = m·speed/2 each, because the second support lies opposite to the first.
    """
    directions = np.array([[1.0, 1.0], [-0.5, 0.5]])
    answer = Answer(impulses=(np.full(2, 0.5 * speed),), velocity=np.zeros(2))
    return ContactProblem.from_factors(directions, np.array([1.0, 12.0]), np.full(2, -speed), dim=1, answer=answer)


def grazing(n: int) -> ContactProblem:
    """Return a row of ``n`` touching blocks of 1 kg in front of a wall; the last block pushes at 1 m/s.

    c is zero at all contacts except the last. The blocks transmit the push to the wall, so all Λ_k are 1, and ξ = 0.
    """
    directions = np.eye(n) - np.eye(n, k=1)
    motion = np.zeros(n)
    motion[-1] = -1.0
    answer = Answer(impulses=(np.ones(n),), velocity=np.zeros(n), sensitivity=float(n * n))
    return body_problem(directions, np.ones(n), motion, dim=1, answer=answer)


def touching() -> ContactProblem:
    """Return three uncoupled spatial contacts at the boundaries between the states of the laws.

    G = I. The first contact has Λ_N = ξ_N = 0 and slides, the second has Λ_N = ξ_N = 0 and rests. The third lies
    between sticking and slipping, with Λ_T at its bound and ξ_T = 0.
    """
    c = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, -0.3, -0.4])
    impulses = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.3, 0.4])
    answer = Answer(impulses=(impulses,), velocity=impulses + c)
    return ContactProblem.from_delassus(np.eye(9), c, 0.5, answer=answer)


def immovable_contact(n: int = 2, dim: int = 1) -> ContactProblem:
    """Return ``n`` contacts of ``dim`` rows without a solution: the normal of the last has G_ii = 0 and c_i < 0.

    With friction, μ = 0.5 and the free tangential velocities are 0.3 m/s. An impulse at the last contact would change
    only its tangential velocity.
    """
    diagonal, c = np.ones((n, dim)), np.full((n, dim), 0.3)
    diagonal[-1, 0], c[:, 0] = 0.0, -1.0
    return ContactProblem.from_delassus(
        np.diag(diagonal.ravel()), c.ravel(), 0.5, dim=dim, answer=Answer(solvable=False)
    )


def immovable_among(n: int) -> ContactProblem:
    """Return a sliding tower of ``n`` bodies with an additional contact that has a normal of zero length.

    The contact touches the ground and lies in the middle of the list. No impulse can stop its approach at 1 m/s. The
    problem of the other contacts has a solution.
    """
    tower = sliding_tower(np.ones(n))
    assert tower.factors is not None
    directions, column = tower.factors.force_directions.toarray(), 3 * (n // 2)
    added = np.column_stack([np.zeros(3 * n), directions[:, 1:3]])
    return ContactProblem.from_factors(
        np.hstack([directions[:, :column], added, directions[:, column:]]),
        tower.factors.inverse_mass.matrix,
        np.insert(tower.free_velocity, [column] * 3, [-1.0, *tower.free_velocity[1:3]]),
        np.insert(tower.layout.friction_coefficient, n // 2, 0.2),
        answer=Answer(solvable=False),
    )


def squeezed() -> ContactProblem:
    """Return a body between two walls that approach at 1 m/s each, so that no impulse can satisfy both.

    ξ_1 + ξ_2 = −2 for every Λ, so the judge's residual is at least 1.
    """
    directions = np.array([[1.0, -1.0]])
    return ContactProblem.from_factors(directions, np.ones(1), (-1.0, -1.0), dim=1, answer=Answer(solvable=False))


def directions_without_length() -> ContactProblem:
    """Return a body of 1 kg on one contact, and contacts with tangents or all directions of zero length.

    Only the first contact bears the body, with Λ_N = m g Δt, and sticks with Λ_T = (−0.001, 0). The second has tangents
    of zero length, opens at 1 m/s and has Λ_N = 0. The third has only zero directions and opens at 1 m/s.
    """
    directions = np.zeros((6, 9))
    directions[:3, :3] = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    directions[5, 3] = 1.0
    c = np.array([-WEIGHT, 1e-3, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    velocity = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    sums = np.zeros((4, 9))
    sums[np.arange(4), np.arange(4)] = 1.0
    answer = Answer(velocity=velocity, functionals=sums, values=np.array([WEIGHT, -1e-3, 0.0, 0.0]), sensitivity=1e4)
    return ContactProblem.from_factors(directions, np.ones(6), c, 0.5, answer=answer)


def friction_without_normal() -> ContactProblem:
    """Return a contact with a normal of zero length that opens at 1 m/s and a tangent that slides at 1 m/s.

    The contact opens, so Λ_N = 0 and friction is zero. A normal impulse would permit friction without moving the body.
    """
    directions = np.array([[0.0, 1.0]])
    answer = Answer(impulses=(np.zeros(2),), velocity=np.ones(2))
    return ContactProblem.from_factors(directions, np.ones(1), np.ones(2), 0.5, dim=2, answer=answer)
