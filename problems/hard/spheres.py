"""Spheres and blocks that touch the ground in one point each: sticking, sliding and rolling in closed form.

G of a sphere's contact is diag(1, 7/2, 7/2)/m and that of a block without rotation diag(1, 1, 1)/m, so that the normal
impulse comes first, Λ_N = m max(−c_N, 0), and bounds the tangential one, Λ_T = −m_T c_T cut to the length μ Λ_N.
"""

import numpy as np
import scipy.sparse as sp

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from .bodies import WEIGHT


def separate_contacts(c: FloatArray, friction: FloatArray, compliance: float = 3.5) -> ContactProblem:
    """Return bodies of 1 kg on the ground, one spatial contact each, with free velocities ``c``, shape (n, 3).

    Args:
        c: free velocity of each contact [m/s], shape (n, 3).
        friction: μ of each contact, shape (n,).
        compliance: tangential diagonal of G [1/kg], 3.5 for spheres, 1 for blocks.
    """
    n = len(c)
    normal = np.maximum(-c[:, 0], 0.0)
    wanted = -c[:, 1:] / compliance
    length = np.hypot(wanted[:, 0], wanted[:, 1])
    cut = np.minimum(1.0, friction * normal / np.where(length > 0.0, length, 1.0))
    impulses = np.column_stack([normal, cut[:, None] * wanted]).ravel()
    diagonal = np.tile([1.0, compliance, compliance], n)
    answer = Answer(impulses=(impulses,), velocity=diagonal * impulses + c.ravel())
    return ContactProblem.from_factors(
        sp.eye_array(3 * n), diagonal, c.ravel(), friction, free_motion=c.ravel(), answer=answer
    )


def incline(friction: float, excess: float, compliance: float = 1.0) -> ContactProblem:
    """Return a block (or a sphere, compliance 3.5) at rest on an incline ``excess`` [rad] beyond the critical angle.

    The critical angle is tan θ = μ · compliance: a block stays up to it and slides with g (sin θ − μ cos θ) beyond, a
    sphere rolls up to it and slides beyond.
    """
    return _on_inclines(np.array([friction]), np.array([excess]), compliance)


def oblique_impacts(n: int, restitution: float, friction: float) -> ContactProblem:
    """Return ``n`` spheres that strike the ground at 1 m/s under angles on both sides of the critical one.

    With ε_T = 0 a sphere sticks iff |v_T| ≤ 7/2 μ (1 + ε_N) |v_N|; the middle one of an odd n strikes exactly there.
    """
    critical = np.arctan(3.5 * friction * (1.0 + restitution))
    angle = critical * (1.0 + np.linspace(-0.5, 0.5, n))
    heading = np.linspace(0.0, 6.0, n)
    along, across = np.sin(angle) * np.cos(heading), np.sin(angle) * np.sin(heading)
    c = np.column_stack([-(1.0 + restitution) * np.cos(angle), along, across])
    return separate_contacts(c, np.full(n, friction))


def scattered(n: int) -> ContactProblem:
    """Return ``n`` spheres thrown at and away from the ground, with friction from 0 to 10."""
    rng = np.random.default_rng(n)
    return separate_contacts(rng.normal(size=(n, 3)), 10.0 * rng.random(n) ** 3)


def inclines(n: int, compliance: float = 1.0) -> ContactProblem:
    """Return ``n`` blocks (or spheres), each on its own incline, at rest and of friction spread from 0.05 to 10.

    The inclines are 1e-9 rad below, at and above their critical angle in turn, see ``incline``.
    """
    return _on_inclines(np.geomspace(0.05, 10.0, n), np.resize([-1e-9, 0.0, 1e-9], n), compliance)


def _on_inclines(friction: FloatArray, excess: FloatArray, compliance: float) -> ContactProblem:
    slope = np.arctan(friction * compliance) + excess
    c = WEIGHT * np.column_stack([-np.cos(slope), np.sin(slope), np.zeros(len(slope))])
    return separate_contacts(c, friction, compliance)
