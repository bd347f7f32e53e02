"""Small algebraic cases with known answers: redundant, degenerate, ill-conditioned, ambiguous and impossible contacts.

Every case is one contact problem in Delassus or factor form with its ``Answer``; what is not unique is left out of it.
Δt = 1e-3 s and g = 9.81 m/s² throughout. The counterexample and the rods come from the same 2 × 2 matrix of one planar
contact, G = [[G_NN, G_NT], [G_NT, G_TT]].
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from .answer import Answer
from .contact import ContactProblem
from .laws import FloatArray, LawKind, Laws

GRAVITY = 9.81
TIME_STEP = 1e-3

_ROD = np.array([[1.87577975, -1.36394614], [-1.36394614, 3.12422025]])


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
    answer = Answer(velocity=velocity, functionals=directions, values=np.array([-friction * weight, 0.0, weight]))
    return ContactProblem.from_factors(
        directions, np.ones(3), directions.T @ motion, friction, free_motion=motion, answer=answer
    )


def sliding_block(friction: float = 0.3) -> ContactProblem:
    """Return a planar block of 1 kg that slides at 1 m/s on 4 supports under its centre of mass.

    With the supports at the height of the centre no moment arises: Σ Λ_N = m g Δt, Σ Λ_T = −μ m g Δt.
    """
    weight, arms = GRAVITY * TIME_STEP, np.linspace(-0.5, 0.5, 4)
    directions = np.zeros((3, 8))
    directions[1, 0::2], directions[2, 0::2], directions[0, 1::2] = 1.0, arms, 1.0
    motion = np.array([1.0, -weight, 0.0])
    velocity = np.tile([0.0, 1.0 - friction * weight], 4)
    sums = np.zeros((3, 8))
    sums[0, 0::2], sums[1, 1::2], sums[2, 0::2] = 1.0, 1.0, arms
    answer = Answer(velocity=velocity, functionals=sums, values=np.array([weight, -friction * weight, 0.0]))
    inverse_mass = np.array([1.0, 1.0, 12.0])
    return ContactProblem.from_factors(
        directions, inverse_mass, directions.T @ motion, friction, dim=2, free_motion=motion, answer=answer
    )


def sticking_box(speed: float = 1e-3) -> ContactProblem:
    """Return a flat box of 1 kg on 4 corners, pushed slowly by ``speed`` along x, that sticks: Σ Λ_T = −m v_0."""
    weight = GRAVITY * TIME_STEP
    directions = np.zeros((6, 12))
    inertia = np.array([1.0 / 12.0, 1.0 / 12.0, 1.0 / 6.0])
    for corner, (x, y) in enumerate([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)]):
        arm = np.array([x, y, 0.0])
        for lane, axis in enumerate((np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))):
            directions[:3, 3 * corner + lane] = axis
            directions[3:, 3 * corner + lane] = np.cross(arm, axis)
    motion = np.array([speed, 0.0, -weight, 0.0, 0.0, 0.0])
    answer = Answer(velocity=np.zeros(12), functionals=directions[:3], values=np.array([-speed, 0.0, weight]))
    inverse_mass = np.concatenate([np.ones(3), 1.0 / inertia])
    return ContactProblem.from_factors(
        directions, inverse_mass, directions.T @ motion, 0.5, free_motion=motion, answer=answer
    )


def stack(masses: FloatArray) -> ContactProblem:
    """Return blocks on top of each other, ``masses`` [kg] from below: Λ_k = g Δt Σ_{j≥k} m_j, ξ = 0."""
    n = len(masses)
    directions = np.eye(n) - np.eye(n, k=1)
    motion = np.full(n, -GRAVITY * TIME_STEP)
    impulses = GRAVITY * TIME_STEP * np.cumsum(masses[::-1])[::-1]
    answer = Answer(impulses=(impulses,), velocity=np.zeros(n))
    return ContactProblem.from_factors(
        directions, 1.0 / masses, directions.T @ motion, dim=1, free_motion=motion, answer=answer
    )


def v_groove(friction: float, half_angle: float = np.pi / 4) -> ContactProblem:
    """Return a disc of 1 kg in a groove whose walls stand at ``half_angle`` to the vertical.

    Without friction Λ_N = m g Δt/(2 sin α) at each wall; with friction u = 0 is unique and Λ is not.
    """
    weight, sin, cos = GRAVITY * TIME_STEP, np.sin(half_angle), np.cos(half_angle)
    normals = np.array([[cos, -cos], [sin, sin]])
    motion = np.array([0.0, -weight, 0.0])
    if friction == 0.0:
        answer = Answer(impulses=(np.full(2, weight / (2.0 * sin)),), velocity=np.zeros(2))
        return ContactProblem.from_factors(normals, np.ones(2), normals.T @ motion[:2], dim=1, answer=answer)
    directions = np.zeros((3, 4))
    directions[:2, 0::2] = normals
    directions[:2, 1::2] = np.array([[-sin, -sin], [cos, -cos]])
    directions[2, 1::2] = -1.0
    answer = Answer(velocity=np.zeros(4), functionals=directions[:2], values=np.array([0.0, weight]))
    inverse_mass = np.array([1.0, 1.0, 2.0])
    return ContactProblem.from_factors(directions, inverse_mass, directions.T @ motion, friction, dim=2, answer=answer)


def scaled_rows() -> ContactProblem:
    """Return a stack of five whose contacts are measured in units 1, 1e3, 1e-3, 1 and 1e6 apart.

    With D the scales, G → D G D and c → D c; the solution is Λ → D⁻¹ Λ.
    """
    plain = stack(np.ones(5))
    scales = np.array([1.0, 1e3, 1e-3, 1.0, 1e6])
    assert plain.answer is not None
    delassus = plain.delassus().toarray() * np.outer(scales, scales)
    answer = Answer(impulses=(plain.answer.impulses[0] / scales,), velocity=np.zeros(5))
    return ContactProblem.from_delassus(delassus, scales * plain.free_velocity, dim=1, answer=answer)


def _slip(c: FloatArray, friction: float, direction: float) -> FloatArray:
    """Closed contact sliding with Λ_T = direction · μ Λ_N: Λ_N = −c_N/(G_NN + direction μ G_NT)."""
    normal = -c[0] / (_ROD[0, 0] + direction * friction * _ROD[0, 1])
    return np.array([normal, direction * friction * normal])


def rod(c: tuple[float, float], friction: float, states: tuple[str, ...]) -> ContactProblem:
    """Return the planar rod contact with free velocity ``c`` whose solutions are in ``states``.

    "open" Λ = 0; "slip+" and "slip−" from Λ_T = ±μΛ_N and ξ_N = 0; "stick" from ξ = 0, Λ = −G⁻¹c.
    """
    free = np.array(c)
    known: dict[str, FloatArray] = {
        "open": np.zeros(2),
        "slip+": _slip(free, friction, 1.0),
        "slip-": _slip(free, friction, -1.0),
        "stick": -np.linalg.solve(_ROD, free),
    }
    impulses = tuple(known[state] for state in states)
    velocity = _ROD @ impulses[0] + free if len(impulses) == 1 else None
    return ContactProblem.from_delassus(
        _ROD, free, friction, dim=2, answer=Answer(impulses=impulses, velocity=velocity)
    )


def no_motion() -> ContactProblem:
    """Return three coupled spatial contacts with c = 0; Λ = 0 solves."""
    root = np.random.default_rng(1).normal(size=(12, 9))
    answer = Answer(impulses=(np.zeros(9),), velocity=np.zeros(9))
    return ContactProblem.from_delassus(root.T @ root, np.zeros(9), 0.4, answer=answer)


def immovable_contact() -> ContactProblem:
    """Return two contacts of which the second has G_ii = 0 and c_i < 0: nothing can stop it, there is no solution."""
    return ContactProblem.from_delassus(
        np.diag([1.0, 0.0]), np.array([-1.0, -1.0]), dim=1, answer=Answer(solvable=False)
    )


def tresca_joint() -> ContactProblem:
    """Return joints with dry friction a = 0.2 N s, pushed by 1, 0.1 and (3, 4) m/s on unit masses.

    Λ = −0.2 (slip), −0.1 (stick), and −0.2 · (0.6, 0.8) (slip).
    """
    laws = Laws(
        np.array([LawKind.PLANAR_FRICTION, LawKind.PLANAR_FRICTION, LawKind.SPATIAL_FRICTION]),
        np.array([0, 1, 2]),
        np.zeros(3),
        np.full(3, 0.2),
        np.full(3, -1),
    )
    impulses = np.array([-0.2, -0.1, -0.12, -0.16])
    c = np.array([1.0, 0.1, 3.0, 4.0])
    answer = Answer(impulses=(impulses,), velocity=impulses + c)
    return ContactProblem.from_delassus(sp.eye_array(4), c, laws=laws, answer=answer)


def mixed_laws() -> ContactProblem:
    """Return contacts of one, two and three rows and a joint in one problem, its solution chosen first.

    Λ and ξ are complementary by choice (open, closed; stick, slip; at the bound a + μΛ_N), then c = ξ − G Λ; G has full
    rank and is nearly diagonal, so the solution is the only one.
    """
    kind = np.array([0, 0, 0, 1, 0, 1, 0, 2, 0, 2, 1])
    first_row = np.concatenate([[0], np.cumsum(np.where(kind == LawKind.SPATIAL_FRICTION, 2, 1))[:-1]])
    partner = np.array([-1, -1, -1, 2, -1, 4, -1, 6, -1, 8, -1])
    friction = np.where(partner >= 0, 0.5, 0.0)
    fixed = np.where(kind > 0, 0.1, 0.0)
    impulses = np.array([0.0, 1.0, 1.0, 0.6, 1.0, 0.2, 2.0, -0.66, 0.88, 1.0, 0.1, 0.2, -0.1])
    velocity = np.array([1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.5, -2.0, 0.0, 0.0, 0.0, 0.7])
    root = np.random.default_rng(2).normal(size=(13, 13))
    delassus = np.eye(13) + 0.02 * (root @ root.T) / 13
    answer = Answer(impulses=(impulses,), velocity=velocity)
    return ContactProblem.from_delassus(
        delassus,
        velocity - delassus @ impulses,
        laws=Laws(kind, first_row, friction, fixed, partner),
        answer=answer,
    )


HARD_CASES: dict[str, Callable[[], ContactProblem]] = {
    **{f"hard-supports-{n}": (lambda n=n: block_on_supports(n)) for n in (2, 4, 8, 32)},  # type: ignore[misc]
    "hard-identical-contacts": lambda: identical_contacts(8),
    "hard-duplicated-slider": duplicated_slider,
    "hard-sliding-block": sliding_block,
    "hard-sticking-box": sticking_box,
    "hard-stack-10": lambda: stack(np.ones(10)),
    "hard-stack-10-top-heavy": lambda: stack(np.array([1.0] * 9 + [100.0])),
    "hard-stack-2-top-heavy": lambda: stack(np.array([1.0, 1e6])),
    "hard-groove-frictionless": lambda: v_groove(0.0),
    "hard-groove": lambda: v_groove(0.3),
    "hard-scaled-rows": scaled_rows,
    "hard-counterexample": lambda: rod((-0.0981, 1.0), 2.0, ("slip-",)),
    "hard-counterexample-mu4": lambda: rod((-0.0981, 1.0), 4.0, ("slip-",)),
    "hard-painleve-jam": lambda: rod((-0.0981, -1.0), 2.0, ("stick",)),
    "hard-three-solutions": lambda: rod((0.01, -1.0), 2.0, ("open", "slip+", "stick")),
    "hard-no-motion": no_motion,
    "hard-immovable": immovable_contact,
    "hard-tresca-joint": tresca_joint,
    "hard-mixed-laws": mixed_laws,
}
"""The cases of the suite ``hard``, by name."""


def hard_case(name: str) -> ContactProblem:
    """Return one case by name."""
    return HARD_CASES[name]().renamed(name, scene="hard")
