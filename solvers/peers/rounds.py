"""Rounds of an external solver: each continues the previous one, and the judge's residual is checked after each.

External solvers know neither a time limit nor the judge's residual. Each call is limited to the iterations that fit
into the remaining time at the speed of earlier rounds. If a solver reports convergence although the judge's residual is
too large, the next round has a smaller tolerance.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop
from ..iteration.loop import infeasible_solution, initial_impulses
from ..iteration.stopping import Clock

MIN_TOLERANCE = 1e-15
"""Smaller tolerances are meaningless in double precision."""

TIGHTENING = 0.1
"""Factor by which a tolerance is reduced if it was met although the residual is too large."""

TIME_SHARE = 0.9
"""Largest expected time of a round, relative to the time left."""


@dataclass(frozen=True)
class Round:
    """The result of one call: Λ over rows [N s], its iterations, and whether its own tolerance is met."""

    impulses: FloatArray
    iterations: int
    is_converged: bool


Call = Callable[[FloatArray, float, int], Round]
"""``call(impulses, tolerance, iterations)`` continues from Λ to its own tolerance, for at most ``iterations``."""


class PreparedRounds(ABC):
    """An external solver that is prepared for one problem and works in rounds.

    Attributes:
        problem: the problem.
        residual: its residual.
    """

    first_iterations: ClassVar[int] = 20
    """Number of iterations of the first round."""

    growth: ClassVar[float] = 2.0
    """Factor of the number of iterations from one round to the next."""

    def __init__(self, problem: ContactProblem) -> None:
        self.problem, self.residual = problem, Residual(problem)

    @abstractmethod
    def begin(self, max_seconds: float) -> Call:
        """Return the call of the solver for one solve with this time limit [s]."""

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve until the judge's residual reaches the tolerance; the observer is ignored."""
        check_stop(stop)
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        clock, best = Clock(stop.max_seconds), initial_impulses(self.problem, self.residual, start)
        lowest, n_iterations, planned = self.residual.judged(self.problem, best), 0, float(self.first_iterations)
        impulses, tolerance, seconds = best, min(stop.tolerance, 0.1), 0.0
        call = self.begin(stop.max_seconds)
        while lowest > stop.tolerance:
            limit = clock.reached_limit(stop, n_iterations)
            if limit is not None:
                return Solution(best, limit, n_iterations, f"residual {lowest:.1e} after {n_iterations} iterations")
            affordable = TIME_SHARE * clock.remaining * n_iterations / seconds if seconds > 0.0 else planned
            count = int(max(1.0, min(planned, affordable, stop.max_iterations - n_iterations)))
            start_time = time.perf_counter()
            result = call(impulses, tolerance, count)
            seconds += time.perf_counter() - start_time
            n_iterations += max(result.iterations, 1)
            if not np.isfinite(result.impulses).all():
                reason = f"the impulses are not finite after {n_iterations} iterations"
                return Solution(best, Status.DIVERGED, n_iterations, reason)
            impulses = result.impulses
            residual = self.residual.judged(self.problem, impulses)
            if residual < lowest:
                best, lowest = impulses, residual
            if not result.is_converged:
                planned *= self.growth
            elif tolerance > MIN_TOLERANCE:
                tolerance *= TIGHTENING
            elif lowest > stop.tolerance:
                reason = f"its own tolerance {tolerance:.0e} is met, but the residual is {lowest:.1e}"
                return Solution(best, Status.STALLED, n_iterations, reason)
        return Solution(best, Status.SOLVED, n_iterations)
