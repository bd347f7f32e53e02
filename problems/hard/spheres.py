"""Spheres and blocks that touch the ground at one point each: sticking, sliding and rolling in closed form.

G of a sphere's contact is diag(1, 7/2, 7/2)/m, and that of a block without rotation diag(1, 1, 1)/m. The normal impulse
Λ_N = m max(−c_N, 0) is therefore independent of friction. It bounds the tangential impulse: Λ_T = −m_T c_T, shortened
to the length μ Λ_N if it is longer, where 1/m_T is the tangential diagonal entry of G.

With rolling friction, Λ_N bounds the friction impulse and the rolling moment of a sphere that moves in one direction,
|Λ_T| ≤ μ Λ_N and |Λ_R| ≤ μ_r Λ_N. On a slope the sphere stays at rest if tan θ ≤ μ_r/r. If it rolls, its velocity grows
by 5/7 g (sin θ − μ_r/r cos θ) Δt.
"""

import numpy as np
import scipy.sparse as sp

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.laws import Laws
from ..contact.problem import ContactProblem
from ..errors import ProblemError
from .bodies import WEIGHT, body_problem, box_friction_impulses

RADIUS = 0.1
"""Radius of the spheres with rolling friction [m]."""


def separate_contacts(c: FloatArray, friction: FloatArray, compliance: float = 3.5) -> ContactProblem:
    """Return bodies of 1 kg on the ground, each with one spatial contact.

    Args:
        c: free velocity of each contact [m/s], shape (n, 3).
        friction: μ of each contact, shape (n,).
        compliance: tangential diagonal of G [1/kg], 3.5 for spheres, 1 for blocks.
    """
    n = len(c)
    normal = np.maximum(-c[:, 0], 0.0)
    sticking = -c[:, 1:] / compliance
    length = np.hypot(sticking[:, 0], sticking[:, 1])
    scale = np.minimum(1.0, friction * normal / np.where(length > 0.0, length, 1.0))
    impulses = np.column_stack([normal, scale[:, None] * sticking]).ravel()
    diagonal = np.tile([1.0, compliance, compliance], n)
    answer = Answer(impulses=(impulses,), velocity=diagonal * impulses + c.ravel())
    return body_problem(sp.eye_array(3 * n), diagonal, c.ravel(), friction, answer=answer)


def incline(friction: float, excess: float, compliance: float = 1.0) -> ContactProblem:
    """Return a block (or a sphere, compliance 3.5) at rest on an incline ``excess`` [rad] above the critical angle.

    The critical angle θ satisfies tan θ = μ · compliance. Below it, a block stays and a sphere rolls. Above it, both
    slide, a block with the acceleration g (sin θ − μ cos θ).
    """
    return _spheres_on_inclines(np.array([friction]), np.array([excess]), compliance)


def oblique_impacts(n: int, restitution: float, friction: float) -> ContactProblem:
    """Return ``n`` spheres that strike the ground at 1 m/s, at angles below and above the critical angle.

    With ε_T = 0 a sphere sticks iff |v_T| ≤ 7/2 μ (1 + ε_N) |v_N|. For odd ``n``, equality holds for the middle sphere.
    """
    critical = np.arctan(3.5 * friction * (1.0 + restitution))
    angle = critical * (1.0 + np.linspace(-0.5, 0.5, n))
    heading = np.linspace(0.0, 6.0, n)
    along, across = np.sin(angle) * np.cos(heading), np.sin(angle) * np.sin(heading)
    c = np.column_stack([-(1.0 + restitution) * np.cos(angle), along, across])
    return separate_contacts(c, np.full(n, friction))


def scattered(n: int) -> ContactProblem:
    """Return ``n`` spheres thrown towards or away from the ground, with friction from 0 to 10."""
    rng = np.random.default_rng(n)
    return separate_contacts(rng.normal(size=(n, 3)), 10.0 * rng.random(n) ** 3)


def inclines(n: int, compliance: float = 1.0) -> ContactProblem:
    """Return ``n`` blocks (or spheres, compliance 3.5) at rest on separate inclines, with friction from 0.05 to 10.

    The inclines are 1e-9 rad below, at and above their critical angle in turn; see ``incline``.
    """
    return _spheres_on_inclines(np.geomspace(0.05, 10.0, n), np.resize([-1e-9, 0.0, 1e-9], n), compliance)


def _spheres_on_inclines(friction: FloatArray, excess: FloatArray, compliance: float) -> ContactProblem:
    slope = np.arctan(friction * compliance) + excess
    c = WEIGHT * np.column_stack([-np.cos(slope), np.sin(slope), np.zeros(len(slope))])
    return separate_contacts(c, friction, compliance)


def spheres_with_rolling_friction(
    motion: FloatArray, friction: FloatArray, rolling_friction: FloatArray, heading: FloatArray, axes: int = 2
) -> ContactProblem:
    """Return spheres of 1 kg on the ground that slide and roll, each along its heading, with both kinds of friction.

    Rows are N, T1, T2, then the angular velocities about T1 and T2, and about N for three ``axes``. A single axis is
    T2, and the heading must then be 0. The degrees of freedom of a sphere are (v, ω).

    Args:
        motion: free velocity into the ground and along the heading [m/s], and free angular velocity of rolling in this
            direction, about the horizontal axis perpendicular to it [rad/s], shape (n, 3).
        friction: μ, shape (n,).
        rolling_friction: μ_r [m], shape (n,).
        heading: angle of the direction to T1 [rad], shape (n,).
        axes: number of axes of rolling friction, 1, 2 or 3.
    """
    n, inertia = len(motion), 0.4 * RADIUS**2
    reduced = np.array([[1.0 + RADIUS**2 / inertia, -RADIUS / inertia], [-RADIUS / inertia, 1.0 / inertia]])
    normal, along, impulses = motion[:, 0], np.column_stack([np.cos(heading), np.sin(heading)]), np.zeros((n, 6))
    for k, (_, speed, spin) in enumerate(motion):
        bound = normal[k] * np.array([friction[k], rolling_friction[k]])
        held = box_friction_impulses(reduced, np.array([speed - RADIUS * spin, spin]), bound)
        impulses[k] = normal[k], *(held[0] * along[k]), -held[1] * along[k, 1], held[1] * along[k, 0], 0.0
    # ξ = (v_z, v_x − r ω_y, v_y + r ω_x, ω_x, ω_y, ω_z)
    whole = np.zeros((6, 6))
    whole[[2, 0, 1], [0, 1, 2]] = 1.0
    whole[4, 1], whole[3, 2] = -RADIUS, RADIUS
    whole[[3, 4, 5], [3, 4, 5]] = 1.0
    kept = {1: [0, 1, 2, 4], 2: [0, 1, 2, 3, 4], 3: [0, 1, 2, 3, 4, 5]}[axes]
    free_motion = np.zeros((n, 6))
    free_motion[:, :2], free_motion[:, 2] = motion[:, 1:2] * along, -normal
    free_motion[:, 3], free_motion[:, 4] = -motion[:, 2] * along[:, 1], motion[:, 2] * along[:, 0]
    directions = sp.csc_array(sp.block_diag([whole[:, kept]] * n))
    inverse_mass = np.tile([1.0, 1.0, 1.0, *[1.0 / inertia] * 3], n)
    known, motion = impulses[:, kept].ravel(), free_motion.ravel()
    velocity = directions.T @ (inverse_mass * (directions @ known)) + directions.T @ motion
    answer = Answer(impulses=(known,), velocity=velocity)
    laws = Laws.contacts(friction, 3, n).with_rolling(rolling_friction, axes)
    return body_problem(directions, inverse_mass, motion, laws=laws, answer=answer)


def sphere_on_slope(excess: float, friction: float = 0.5, share: float = 0.2, axes: int = 2) -> ContactProblem:
    """Return a sphere at rest on a slope ``excess`` [rad] above the critical angle θ, tan θ = μ_r/r = ``share``."""
    slope = np.arctan(share) + excess
    motion = WEIGHT * np.array([[np.cos(slope), np.sin(slope), 0.0]])
    return spheres_with_rolling_friction(motion, np.array([friction]), np.array([share * RADIUS]), np.zeros(1), axes)


def slowing_sphere(speed: float, share: float = 0.2) -> ContactProblem:
    """Return a sphere that rolls on level ground; it stops if ``speed`` [m/s] is at most 5/7 g Δt μ_r/r.

    The coefficient μ_r is ``share`` times r.
    """
    motion = np.array([[WEIGHT, speed, speed / RADIUS]])
    return spheres_with_rolling_friction(motion, np.array([0.5]), np.array([share * RADIUS]), np.zeros(1))


def random_spheres_with_rolling_friction(n: int, axes: int = 2) -> ContactProblem:
    """Return ``n`` spheres that slide, roll, do both or stick, with random friction and directions."""
    rng = np.random.default_rng(n)
    motion = np.column_stack([rng.random(n), rng.normal(size=n), rng.normal(size=n) / RADIUS])
    motion[::4, 1:] *= 0.01
    friction, rolling = rng.random(n), 0.5 * RADIUS * rng.random(n)
    return spheres_with_rolling_friction(motion, friction, rolling, 2.0 * np.pi * rng.random(n) * (axes > 1), axes)


def with_rolling_friction(problem: ContactProblem, rolling_friction: float, axes: int = 2) -> ContactProblem:
    """Return a problem of contacts between balls with rolling friction added.

    Args:
        problem: spatial contacts in factor form, with the velocity and the angular velocity of each ball as degrees of
            freedom, and the free motion known.
        rolling_friction: μ_r of all contacts [m].
        axes: 2 for rolling, 3 for rolling and spinning.

    Raises:
        ProblemError: if the problem does not have this form.
    """
    factors = problem.factors
    is_spatial = problem.layout.width == 3 and problem.layout.is_dense and problem.layout.bounds_are_own
    if factors is None or factors.free_motion is None or factors.n_dofs % 6 or not is_spatial or axes not in (2, 3):
        raise ProblemError(
            f"{problem.name!r} cannot have rolling friction: this requires spatial contacts of balls in factor form "
            "with their free motion, and 2 or 3 axes."
        )
    n = problem.n_contacts
    # the directions T1, T2 and N of forces are also axes of moments, in the three following degrees of freedom
    shift = sp.csr_array(sp.block_diag([np.eye(6, k=-3)] * (factors.n_dofs // 6)))
    moments = sp.csc_array(shift @ factors.force_directions)
    order = np.arange(n)[:, None]
    columns = np.hstack([3 * order + np.arange(3), 3 * n + 3 * order + np.array([1, 2, 0])[:axes]]).ravel()
    directions = sp.csc_array(sp.hstack([factors.force_directions, moments], format="csc")[:, columns])
    c = np.hstack([problem.free_velocity, moments.T @ factors.free_motion])[columns]
    return ContactProblem.from_factors(
        directions,
        factors.inverse_mass,
        c,
        laws=problem.laws.with_rolling(rolling_friction, axes),
        free_motion=factors.free_motion,
        name=f"{problem.name} that resists rolling",
        provenance=problem.provenance,
    )
