"""Painlevé's rods: one planar contact whose normal and tangent are coupled, at friction below and above the critical.

Sliding with Λ_T = +μ Λ_N has G_NN + μ G_NT in the place of the normal compliance, which vanishes at the critical
friction μ = −G_NN/G_NT: beyond it a rod that presses on the ground may jam.
"""

from itertools import product

import numpy as np
import scipy.sparse as sp

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from ..contact.transformations import united

ROD = np.array([[1.87577975, -1.36394614], [-1.36394614, 3.12422025]])
"""G of the rod [1/kg]; of a rod ``mass`` times as heavy it is G/mass."""

CRITICAL_FRICTION = float(-ROD[0, 0] / ROD[0, 1])
"""1.3753, where sliding has no normal compliance."""


def _slip(c: FloatArray, friction: float, direction: float) -> FloatArray:
    """Closed contact sliding with Λ_T = direction · μ Λ_N: Λ_N = −c_N/(G_NN + direction μ G_NT)."""
    normal = -c[0] / (ROD[0, 0] + direction * friction * ROD[0, 1])
    return np.array([normal, direction * friction * normal])


def _in_state(state: str, c: FloatArray, friction: float) -> FloatArray:
    if state == "open":
        return np.zeros(2)
    if state == "stick":
        sticking: FloatArray = -np.linalg.solve(ROD, c)
        return sticking
    return _slip(c, friction, 1.0 if state == "slip+" else -1.0)


def rod(c: tuple[float, float], friction: float, states: tuple[str, ...], mass: float = 1.0) -> ContactProblem:
    """Return the planar rod contact with free velocity ``c`` whose solutions are in ``states``.

    "open" Λ = 0; "slip+" and "slip-" from Λ_T = ±μΛ_N and ξ_N = 0; "stick" from ξ = 0, Λ = −G⁻¹c; all of them in
    proportion to ``mass``. What a residual implies for the impulses grows as the compliance of sliding shrinks.
    """
    free = np.array(c)
    compliance = min(abs(ROD[0, 0] + sign * friction * ROD[0, 1]) for sign in (1.0, -1.0)) / ROD[0, 0]
    unscaled = tuple(_in_state(state, free, friction) for state in states)
    velocity = ROD @ unscaled[0] + free if len(unscaled) == 1 else None
    sensitivity = 100.0 * (1.0 + friction) / max(compliance, 0.1) if "slip+" not in states else 100.0 / compliance
    impulses = tuple(mass * known for known in unscaled)
    answer = Answer(impulses=impulses, velocity=velocity, sensitivity=sensitivity)
    return ContactProblem.from_delassus(ROD / mass, free, friction, dim=2, answer=answer)


def pressing_rod(friction: float, mass: float = 1.0) -> ContactProblem:
    """Return the rod pressed on the ground, c = (−0.0981, −1), which has one solution at any friction.

    It sticks if the impulse (0.41761, 0.50240) of sticking is admissible, μ ≥ 1.2030, else slides with Λ_T = +μΛ_N.
    """
    c = (-0.0981, -1.0)
    normal, tangent = -np.linalg.solve(ROD, np.array(c))
    return rod(c, friction, ("stick",) if friction * normal >= tangent else ("slip+",), mass)


def leaving_rod(friction: float, mass: float = 1.0) -> ContactProblem:
    """Return the rod that leaves the ground, c = (0.01, −1): open, and from μ = 1.3973 on two more solutions.

    Sticking takes (0.33318, 0.46554); where it is admissible, so is sliding with Λ_T = +μΛ_N.
    """
    c = (0.01, -1.0)
    normal, tangent = -np.linalg.solve(ROD, np.array(c))
    return rod(c, friction, ("open", "slip+", "stick") if friction * normal >= tangent else ("open",), mass)


def many_rods(n: int) -> ContactProblem:
    """Return ``n`` pressed rods side by side, their friction spread from 0.1 to 4 across the critical one."""
    return united([pressing_rod(float(friction)) for friction in np.geomspace(0.1, 4.0, n)])


def jammed_rods(n: int) -> ContactProblem:
    """Return ``n`` jammed rods side by side, their masses spread over six orders, their friction from 1.4 to 10."""
    masses, frictions = np.geomspace(1e-3, 1e3, n).tolist(), np.geomspace(1.4, 10.0, n).tolist()
    return united([pressing_rod(friction, mass) for friction, mass in zip(frictions, masses, strict=True)])


def opening_rods(n: int) -> ContactProblem:
    """Return ``n`` rods side by side that leave the ground, of friction 0.1 to 1.39 at which they have no other way."""
    masses, frictions = np.geomspace(1e-3, 1e3, n).tolist(), np.geomspace(0.1, 1.39, n).tolist()
    return united([leaving_rod(friction, mass) for friction, mass in zip(frictions, masses, strict=True)])


def undecided_rods(masses: tuple[float, ...]) -> ContactProblem:
    """Return rods of ``masses`` side by side, each with three solutions at μ = 2: every combination is a solution."""
    rods = [leaving_rod(2.0, mass) for mass in masses]
    answers = [rod.answer for rod in rods if rod.answer is not None]
    answer = Answer(
        impulses=tuple(np.concatenate(chosen) for chosen in product(*(known.impulses for known in answers))),
        sensitivity=max(known.sensitivity for known in answers),
    )
    matrix = sp.block_diag([rod.delassus() for rod in rods], format="csr")
    c = np.concatenate([rod.free_velocity for rod in rods])
    return ContactProblem.from_delassus(matrix, c, 2.0, dim=2, answer=answer)
