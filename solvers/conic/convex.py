"""Solving the associated (convex) contact model to the judge's residual, with any cone program.

A conic solver's own tolerance is no residual: it is tightened until the judge, held to the convex model, agrees. Where
it gets too tight for the solver's factorisations, all others follow, and once more with more careful linear algebra:
how near to that edge a solver comes is a matter of luck. A solve to a tighter residual that fails has so run what one
to a looser residual runs, and ends no worse.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import ModelResidual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.loop import judged, refuted
from ..iteration.method import Method
from .programs import ConicProgram, Ended

LADDER = tuple(10.0**-digits for digits in range(3, 16))
"""The conic solver's tolerances; below the last a tolerance means nothing in double precision."""

FIRST_ACCURACY = 1e-2
"""The first try is the loosest of the ladder that is no more than this, relative to the tolerance of the solve."""

STRIDE = 2
"""Steps on the ladder from one try to the next."""

_LIMITS = {Ended.ITERATION_LIMIT: Status.ITERATION_LIMIT, Ended.TIME_LIMIT: Status.TIME_LIMIT}


class ConvexMethod(Method, ABC):
    """A solver of the convex model by one cone program."""

    has_iterates: ClassVar[bool] = False

    @abstractmethod
    def program(self, problem: ContactProblem) -> ConicProgram:
        """Return the program of ``problem``, set up."""

    def prepare(self, problem: ContactProblem) -> "PreparedConvex":
        """Set the program up."""
        self.check_supports(problem)
        return PreparedConvex(problem, ModelResidual(problem, Model.CONVEX), self.program(problem))


@dataclass(frozen=True)
class PreparedConvex:
    """The cone program of one problem."""

    problem: ContactProblem
    residual: ModelResidual = field(repr=False)
    program: ConicProgram = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve to the judge's residual of the convex model; a start has no use here, and no iterates are shown."""
        if self.residual.infeasible:
            return refuted(self.problem)
        seconds, iterations, best = 0.0, 0, np.zeros(self.problem.n_rows)
        best_residual = self.residual(best, self.problem.free_velocity)
        if best_residual <= stop.tolerance:
            return Solution(best, Status.SOLVED, 0)
        accuracies = _Accuracies(stop.tolerance, self.program.can_be_careful)
        for accuracy, is_careful in accuracies:
            left = stop.max_iterations - iterations
            velocity, seconds_left = self.problem.free_velocity, stop.max_seconds - seconds
            result = self.program.run(velocity, accuracy, left, seconds_left, is_careful)
            seconds += result.seconds
            iterations += result.iterations
            if np.isfinite(result.impulses).all():
                residual = judged(self.problem, self.residual, result.impulses)
                if residual < best_residual:
                    best, best_residual = result.impulses, residual
            if best_residual <= stop.tolerance:
                return Solution(best, Status.SOLVED, iterations)
            limit = _LIMITS.get(result.ended)
            if limit is not None or iterations >= stop.max_iterations or seconds >= stop.max_seconds:
                reason = f"residual {best_residual:.1e} in the convex model"
                return Solution(best, limit or Status.ITERATION_LIMIT, iterations, reason)
            accuracies.is_failing = result.ended is not Ended.CONVERGED
        reason = f"residual {best_residual:.1e} at the tightest tolerances of the conic solver"
        if accuracies.is_failing:
            reason = f"the conic solver ended with {result.ended} at residual {best_residual:.1e}"
        return Solution(best, Status.STALLED, iterations, reason)


class _Accuracies:
    """The tolerances to try: tighter and tighter ones until the conic solver fails, then all others, then carefully."""

    def __init__(self, tolerance: float, can_be_careful: bool) -> None:
        fitting = [step for step, accuracy in enumerate(LADDER) if accuracy <= FIRST_ACCURACY * tolerance]
        self._first = fitting[0] if fitting else len(LADDER) - 1
        self._can_be_careful = can_be_careful
        self.is_failing = False

    def __iter__(self) -> Iterator[tuple[float, bool]]:
        tried = set()
        for accuracy in LADDER[self._first :: STRIDE]:
            tried.add(accuracy)
            yield accuracy, False
            if self.is_failing:
                break
        yield from ((accuracy, False) for accuracy in reversed(LADDER) if accuracy not in tried)
        if self._can_be_careful:
            yield from ((accuracy, True) for accuracy in reversed(LADDER))
