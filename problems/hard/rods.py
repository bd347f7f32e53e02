"""Painlevé's rods: one planar contact with coupled normal and tangent, below and above the critical friction.

The normal compliance of sliding with Λ_T = +μ Λ_N is G_NN + μ G_NT. It vanishes at the critical friction
μ = −G_NN/G_NT. Above that value, a rod that presses on the ground may jam.
"""

from itertools import product

import numpy as np
import scipy.sparse as sp

from ..arrays import FloatArray
from ..contact.answer import Answer
from ..contact.problem import ContactProblem
from ..contact.transformations import united

ROD = np.array([[1.87577975, -1.36394614], [-1.36394614, 3.12422025]])
"""G of the rod [1/kg]; a rod that is ``mass`` times as heavy has G/mass."""

CRITICAL_FRICTION = float(-ROD[0, 0] / ROD[0, 1])
"""The critical friction, 1.3753, at which the normal compliance of sliding vanishes."""


def _slip(c: FloatArray, friction: float, direction: float) -> FloatArray:
    """Return Λ of sliding with Λ_T = direction · μ Λ_N, Λ_N = −c_N/(G_NN + direction μ G_NT)."""
    normal = -c[0] / (ROD[0, 0] + direction * friction * ROD[0, 1])
    return np.array([normal, direction * friction * normal])


def _impulses_in_state(state: str, c: FloatArray, friction: float) -> FloatArray:
    """Return Λ of a rod of mass 1 in one of the states of ``rod``."""
    if state == "open":
        return np.zeros(2)
    if state == "stick":
        sticking: FloatArray = -np.linalg.solve(ROD, c)
        return sticking
    return _slip(c, friction, 1.0 if state == "slip+" else -1.0)


def rod(c: tuple[float, float], friction: float, states: tuple[str, ...], mass: float = 1.0) -> ContactProblem:
    """Return the planar rod contact with free velocity ``c`` whose solutions have ``states``.

    The states are "open", Λ = 0; "slip+" and "slip-", with Λ_T = ±μΛ_N and ξ_N = 0; and "stick", with ξ = 0 and
    Λ = −G⁻¹c. Impulses are proportional to ``mass``. The sensitivity grows as the compliance of sliding decreases.
    """
    free_velocity = np.array(c)
    compliance = min(abs(ROD[0, 0] + sign * friction * ROD[0, 1]) for sign in (1.0, -1.0)) / ROD[0, 0]
    unscaled = tuple(_impulses_in_state(state, free_velocity, friction) for state in states)
    velocity = ROD @ unscaled[0] + free_velocity if len(unscaled) == 1 else None
    sensitivity = 100.0 / compliance if "slip+" in states else 100.0 * (1.0 + friction) / max(compliance, 0.1)
    impulses = tuple(mass * known for known in unscaled)
    answer = Answer(impulses=impulses, velocity=velocity, sensitivity=sensitivity)
    return ContactProblem.from_delassus(ROD / mass, free_velocity, friction, dim=2, answer=answer)


def pressing_rod(friction: float, mass: float = 1.0) -> ContactProblem:
    """Return the rod pressed on the ground, c = (−0.0981, −1), with one solution at any friction.

    It sticks if the impulse (0.41761, 0.50240) of sticking is admissible, μ ≥ 1.2030. Otherwise it slides with
    Λ_T = +μΛ_N.
    """
    c = (-0.0981, -1.0)
    normal, tangent = -np.linalg.solve(ROD, np.array(c))
    return rod(c, friction, ("stick",) if friction * normal >= tangent else ("slip+",), mass)


def leaving_rod(friction: float, mass: float = 1.0) -> ContactProblem:
    """Return the rod that leaves the ground, c = (0.01, −1): open, with two more solutions from μ = 1.3973 on.

    The impulse of sticking is (0.33318, 0.46554). If it is admissible, so is sliding with Λ_T = +μΛ_N.
    """
    c = (0.01, -1.0)
    normal, tangent = -np.linalg.solve(ROD, np.array(c))
    return rod(c, friction, ("open", "slip+", "stick") if friction * normal >= tangent else ("open",), mass)


def many_rods(n: int) -> ContactProblem:
    """Return ``n`` uncoupled pressed rods, with friction from 0.1 to 4, below and above the critical value."""
    return united([pressing_rod(float(friction)) for friction in np.geomspace(0.1, 4.0, n)])


def jammed_rods(n: int) -> ContactProblem:
    """Return ``n`` uncoupled jammed rods, with masses over six orders of magnitude and friction from 1.4 to 10."""
    masses, frictions = np.geomspace(1e-3, 1e3, n).tolist(), np.geomspace(1.4, 10.0, n).tolist()
    return united([pressing_rod(friction, mass) for friction, mass in zip(frictions, masses, strict=True)])


def opening_rods(n: int) -> ContactProblem:
    """Return ``n`` uncoupled rods that leave the ground, with friction from 0.1 to 1.39; this solution is unique."""
    masses, frictions = np.geomspace(1e-3, 1e3, n).tolist(), np.geomspace(0.1, 1.39, n).tolist()
    return united([leaving_rod(friction, mass) for friction, mass in zip(frictions, masses, strict=True)])


def undecided_rods(masses: tuple[float, ...]) -> ContactProblem:
    """Return uncoupled rods of ``masses``, each with three solutions at μ = 2; every combination is a solution."""
    problems = [leaving_rod(2.0, mass) for mass in masses]
    answers = [problem.answer for problem in problems if problem.answer is not None]
    answer = Answer(
        impulses=tuple(np.concatenate(chosen) for chosen in product(*(known.impulses for known in answers))),
        sensitivity=max(known.sensitivity for known in answers),
    )
    matrix = sp.block_diag([problem.delassus() for problem in problems], format="csr")
    c = np.concatenate([problem.free_velocity for problem in problems])
    return ContactProblem.from_delassus(matrix, c, 2.0, dim=2, answer=answer)
