"""Solving in rounds: an outside solver goes on from where it was, and the judge looks in between.

Outside solvers have neither a limit of time nor the judge's residual. So they are called for a number of iterations
that fits into the time left, as measured on the rounds before, and what they return is judged: a claim of theirs ends
nothing, it makes the next round's tolerance tighter.
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
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.clock import Clock
from ..iteration.loop import first_impulses, judged, refuted

TIGHTEST = 1e-15
"""Own tolerances below mean nothing in double precision."""

TIGHTENING = 0.1
"""Factor of a tolerance that was met while the judge says otherwise."""

SHARE = 0.9
"""Of the time left that a round may be expected to take."""


@dataclass(frozen=True)
class Round:
    """What one call returned: Λ over rows [N s], its iterations, and whether its own tolerance is met."""

    impulses: FloatArray
    iterations: int
    is_converged: bool


Call = Callable[[FloatArray, float, int], Round]
"""``call(impulses, tolerance, iterations)`` goes on from Λ to a tolerance of its own, for so many iterations."""


class InRounds(ABC):
    """A solver made ready for one problem, which works in rounds.

    Attributes:
        problem: the problem.
        residual: the judge's residual of it.
    """

    first_iterations: ClassVar[int] = 20
    """Iterations of the first round."""

    growth: ClassVar[float] = 2.0
    """Factor from one round's iterations to the next one's."""

    def __init__(self, problem: ContactProblem) -> None:
        self.problem, self.residual = problem, Residual(problem)

    @abstractmethod
    def begin(self, max_seconds: float) -> Call:
        """Return the solver as it is called in one solve with this time limit [s]."""

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve to the judge's residual; no iterates are shown."""
        if self.residual.infeasible:
            return refuted(self.problem)
        clock, best = Clock(stop.max_seconds), first_impulses(self.problem, self.residual, start)
        lowest, done, planned = judged(self.problem, self.residual, best), 0, float(self.first_iterations)
        impulses, tolerance, seconds = best, min(stop.tolerance, 0.1), 0.0
        call = self.begin(stop.max_seconds)
        while lowest > stop.tolerance:
            limit = clock.limit_met(stop, done)
            if limit is not None:
                return Solution(best, limit, done, f"residual {lowest:.1e} after {done} iterations")
            affordable = SHARE * clock.left * done / seconds if seconds > 0.0 else planned
            count = int(max(1.0, min(planned, affordable, stop.max_iterations - done)))
            began = time.perf_counter()
            made = call(impulses, tolerance, count)
            seconds += time.perf_counter() - began
            done += max(made.iterations, 1)
            if not np.isfinite(made.impulses).all():
                reason = f"it returns numbers that are not finite after {done} iterations"
                return Solution(best, Status.DIVERGED, done, reason)
            impulses = made.impulses
            found = judged(self.problem, self.residual, impulses)
            if found < lowest:
                best, lowest = impulses, found
            if not made.is_converged:
                planned *= self.growth
            elif tolerance > TIGHTEST:
                tolerance *= TIGHTENING
            elif lowest > stop.tolerance:
                reason = f"its own tolerance {tolerance:.0e} is met at residual {lowest:.1e}"
                return Solution(best, Status.STALLED, done, reason)
        return Solution(best, Status.SOLVED, done)
