"""Solving in rounds: an external solver continues where it stopped, and the judge's residual is checked in between.

External solvers have neither a time limit nor the judge's residual. They are called for a number of iterations that
fits into the time left, as measured in earlier rounds. If a solver claims convergence and the judge's residual is too
large, the next round has a tighter tolerance.
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
"""Factor of a tolerance that was met although the residual is too large."""

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
    """Iterations of the first round."""

    growth: ClassVar[float] = 2.0
    """Factor of the iterations from one round to the next."""

    def __init__(self, problem: ContactProblem) -> None:
        self.problem, self.residual = problem, Residual(problem)

    @abstractmethod
    def begin(self, max_seconds: float) -> Call:
        """Return the call of the solver for one solve with this time limit [s]."""

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve to the judge's residual; the observer is ignored."""
        check_stop(stop)
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        clock, best = Clock(stop.max_seconds), initial_impulses(self.problem, self.residual, start)
        lowest, done, planned = self.residual.judged(self.problem, best), 0, float(self.first_iterations)
        impulses, tolerance, seconds = best, min(stop.tolerance, 0.1), 0.0
        call = self.begin(stop.max_seconds)
        while lowest > stop.tolerance:
            limit = clock.reached_limit(stop, done)
            if limit is not None:
                return Solution(best, limit, done, f"residual {lowest:.1e} after {done} iterations")
            affordable = TIME_SHARE * clock.remaining * done / seconds if seconds > 0.0 else planned
            count = int(max(1.0, min(planned, affordable, stop.max_iterations - done)))
            began = time.perf_counter()
            made = call(impulses, tolerance, count)
            seconds += time.perf_counter() - began
            done += max(made.iterations, 1)
            if not np.isfinite(made.impulses).all():
                reason = f"the impulses are not finite after {done} iterations"
                return Solution(best, Status.DIVERGED, done, reason)
            impulses = made.impulses
            found = self.residual.judged(self.problem, impulses)
            if found < lowest:
                best, lowest = impulses, found
            if not made.is_converged:
                planned *= self.growth
            elif tolerance > MIN_TOLERANCE:
                tolerance *= TIGHTENING
            elif lowest > stop.tolerance:
                reason = f"its own tolerance {tolerance:.0e} is met, but the residual is {lowest:.1e}"
                return Solution(best, Status.STALLED, done, reason)
        return Solution(best, Status.SOLVED, done)
