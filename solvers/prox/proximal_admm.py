"""ProximalADMM: multipliers z make the impulses x of the equations and the impulses y of the laws agree.

    x ← −(G + (ρ+η) I)⁻¹ (c + s e_N − η x − ρ y + z),      y ← P_K(x + z/ρ),      z ← z + ρ (x − y)

De Saxcé's shift s = μ‖z_T‖ is updated in every iteration, because −z is ξ + s e_N in the limit (Carpentier, Le Lidec &
Montaut, RSS 2024). The first ρ is √(Lm) (L/m)^0.2, where L is the largest eigenvalue of G and m = η. ρ changes by
(L/m)^±0.05 if the primal and dual residuals, ‖x − y‖ and ρ‖y − y'‖ with the previous y', differ more than tenfold. Each
new ρ needs a factorisation.

Anderson acceleration acts on w = x + z/ρ, because one iteration is a map of w. It restarts if ρ changes, or if w moves
more than twice as far as before.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle
from ...problems.contact.solver import SolverError
from ..iteration.anderson import Anderson
from ..iteration.loop import PreparedIteration, iterate
from ..iteration.method import SLIDING, Method, check_option
from ..newton.linear_solver import factorise
from ..sweeps.cone import ConeProblem

PROXIMAL = 1e-6
"""η relative to L."""

FIRST_EXPONENT, CHANGE_EXPONENT, MAX_RESIDUAL_RATIO = 0.2, 0.05, 10.0
"""Exponents of the first ρ and of its changes, and the ratio of residuals that triggers a change."""

INTERVAL = 10
"""Number of iterations between comparisons of residuals; a change of ρ takes as long as several dozen iterations."""

MAX_PENALTY = 1e3
"""Largest ρ relative to L."""

MAX_GROWTH = 2.0
"""The acceleration restarts if w moves more than this many times as far as before."""


@dataclass(frozen=True)
class ProximalADMM(Method):
    """The alternating direction method of multipliers with a proximal term; one iteration is one pass over x, y, z.

    Attributes:
        memory: number of differences that Anderson acceleration keeps, 0 for no acceleration.

    Raises:
        SolverError: if an option is out of range.
    """

    memory: int = 5

    law_kinds: ClassVar[frozenset[int]] = SLIDING

    def __post_init__(self) -> None:
        check_option("memory", self.memory, type(self.memory) is int and self.memory >= 0, "a whole number, 0 or more")

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or convex_obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and estimate its largest eigenvalue."""
        self.check_supports(problem)
        cone = ConeProblem.of(problem)
        largest = cone.largest_eigenvalue()
        return iterate(
            problem, lambda start: (cone.size * y for y in _passes(cone, largest, self.memory, start / cone.size))
        )


def _passes(cone: ConeProblem, largest: float, memory: int, start: FloatArray) -> Iterator[FloatArray]:
    """Yield y after each iteration, shape (n_rows,); ``largest`` is L, and ``start`` is the first x."""
    eta = PROXIMAL * largest
    rho = float(np.sqrt(largest * eta) * (largest / eta) ** FIRST_EXPONENT)
    solve = _factorise(cone, rho + eta)
    velocity = cone.matrix @ start + cone.free
    x, y = start, start
    w = x - (velocity + cone.lift(velocity)) / rho
    acceleration, previous_change, passes = Anderson(memory), np.inf, 0
    while True:
        y_before, y = y, cone.projected(w)
        z = rho * (w - y)
        x = solve(eta * x + rho * y - z - cone.free - cone.lift(z))
        yield y
        image, passes = x + z / rho, passes + 1
        change = float(np.linalg.norm(image - w))
        if change > MAX_GROWTH * previous_change:
            acceleration.restart()
        previous_change, w = change, acceleration.next(w, image)
        if passes % INTERVAL:
            continue
        primal, dual = float(np.linalg.norm(x - y)), rho * float(np.linalg.norm(y - y_before))
        if primal > MAX_RESIDUAL_RATIO * dual or dual > MAX_RESIDUAL_RATIO * primal:
            factor = (largest / eta) ** (CHANGE_EXPONENT if primal > dual else -CHANGE_EXPONENT)
            rho = float(np.clip(factor * rho, eta, MAX_PENALTY * largest))
            solve = _factorise(cone, rho + eta)
            w, previous_change = x + z / rho, np.inf
            acceleration.restart()


def _factorise(cone: ConeProblem, weight: float) -> Callable[[FloatArray], FloatArray]:
    """Factorise G + weight · I and return its solve function."""
    if len(cone.free) == 0:
        return lambda right: right
    factors = factorise(sp.csr_array(cone.matrix + weight * sp.eye_array(len(cone.free))))
    if factors is None:
        raise SolverError("G + (rho + eta) I is singular; use a positive semidefinite G.")
    return lambda right: np.asarray(factors.solve(right))
