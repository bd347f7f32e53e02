"""Bodies between walls and in arches, whose contacts are wedged so that friction impulses are not unique."""

import numpy as np

from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from .bodies import WEIGHT, body_problem

DISC = np.array([1.0, 1.0, 2.0])
"""Diagonal of M⁻¹ of a disc of 1 kg with its radius as the unit of length."""


def v_groove(friction: float, half_angle: float = np.pi / 4) -> ContactProblem:
    """Return a disc of 1 kg in a groove whose walls are inclined by ``half_angle`` α [rad] to the vertical.

    Without friction, Λ_N = m g Δt/(2 sin α) at each wall. With friction, u = 0 is unique (see the module ``supports``),
    but Λ is not.
    """
    sin, cos = np.sin(half_angle), np.cos(half_angle)
    normals = np.array([[cos, -cos], [sin, sin]])
    sensitivity = 10.0 / min(sin, cos) ** 2
    if friction == 0.0:
        answer = Answer(impulses=(np.full(2, WEIGHT / (2.0 * sin)),), velocity=np.zeros(2), sensitivity=sensitivity)
        return body_problem(normals, np.ones(2), np.array([0.0, -WEIGHT]), dim=1, answer=answer)
    directions = np.zeros((3, 4))
    directions[:2, 0::2] = normals
    directions[:2, 1::2] = np.array([[-sin, -sin], [cos, -cos]])
    directions[2, 1::2] = -1.0
    answer = Answer(
        velocity=np.zeros(4),
        functionals=directions[:2],
        values=np.array([0.0, WEIGHT]),
        sensitivity=sensitivity * (1.0 + friction),
    )
    return body_problem(directions, DISC, np.array([0.0, -WEIGHT, 0.0]), friction, dim=2, answer=answer)


def arch(n: int, friction: float) -> ContactProblem:
    """Return an arch of ``n`` discs of 1 kg between two abutments, built along its line of thrust.

    The normal of contact k is along its thrust (H, V_k) with H = n m g Δt/2 and V_k = (n/2 − k) m g Δt. The normal
    impulses λ_k = √(H² + V_k²) alone carry the weight, so u = 0 is the only velocity for any friction coefficient.
    Without friction, λ is the only solution, because W_N has full rank.
    """
    thrust = 0.5 * n * WEIGHT
    shear = (0.5 * n - np.arange(n + 1)) * WEIGHT
    normal_impulses = np.hypot(thrust, shear)
    normal_x, normal_y = thrust / normal_impulses, shear / normal_impulses
    directions = np.zeros((n + 2, 3, n + 1, 2))
    for k in range(n + 1):  # contact k lies between bodies k and k + 1, of which 0 and n + 1 are the abutments
        normal, tangent = np.array([normal_x[k], normal_y[k], 0.0]), np.array([-normal_y[k], normal_x[k], 0.0])
        turn = np.array([0.0, 0.0, -1.0])
        directions[k + 1, :, k, 0], directions[k, :, k, 0] = normal, -normal
        directions[k + 1, :, k, 1], directions[k, :, k, 1] = tangent + turn, -tangent + turn
    disc_directions = directions[1:-1].reshape(3 * n, 2 * (n + 1))
    motion, inverse_mass = np.tile([0.0, -WEIGHT, 0.0], n), np.tile(DISC, n)
    if friction == 0.0:
        answer = Answer(impulses=(normal_impulses,), velocity=np.zeros(n + 1), sensitivity=100.0 * n * n)
        return body_problem(disc_directions[:, 0::2], inverse_mass, motion, dim=1, answer=answer)
    answer = Answer(
        velocity=np.zeros(2 * (n + 1)),
        functionals=disc_directions,
        values=-motion / inverse_mass,
        sensitivity=100.0 * n * n * (1.0 + friction),
    )
    return body_problem(disc_directions, inverse_mass, motion, friction, dim=2, answer=answer)


def chimney(friction: float) -> ContactProblem:
    """Return a disc of 1 kg between two vertical walls; it may fall freely, slow down or stick.

    The normal impulses are equal, Λ_N1 = Λ_N2 = p, and so are the friction impulses. There is a solution for every
    p ≥ 0, so only these two equations hold for all solutions. With p = 0, the disc falls freely.
    """
    directions = np.zeros((3, 4))
    directions[0, 0::2], directions[1, 1::2], directions[2, 1::2] = (1.0, -1.0), 1.0, (-1.0, 1.0)
    answer = Answer(functionals=directions[[0, 2]], values=np.zeros(2), witness=np.zeros(4))
    return body_problem(directions, DISC, np.array([0.0, -WEIGHT, 0.0]), friction, dim=2, answer=answer)


def nearly_parallel(n: int, angle: float, friction: float) -> ContactProblem:
    """Return a point mass of 1 kg on ``n`` planar contacts whose normals lie within ±``angle`` [rad] of the vertical.

    Normal impulses alone carry the weight, so ξ = 0 for any friction; the sum of all impulses is (0, m g Δt). Without
    friction, only the tilted normals resist horizontal motion, so the sensitivity is n / ``angle``.
    """
    tilt = np.linspace(-angle, angle, n)
    directions = np.zeros((2, 2 * n))
    directions[:, 0::2] = np.array([np.sin(tilt), np.cos(tilt)])
    directions[:, 1::2] = np.array([np.cos(tilt), -np.sin(tilt)])
    acting, dim = (directions, 2) if friction else (directions[:, 0::2], 1)
    values, velocity = np.array([0.0, WEIGHT]), np.zeros(dim * n)
    answer = Answer(velocity=velocity, functionals=acting, values=values, sensitivity=n / angle)
    return body_problem(acting, np.ones(2), np.array([0.0, -WEIGHT]), friction, dim, answer=answer)
