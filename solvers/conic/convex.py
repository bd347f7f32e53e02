"""Solving the associated (convex) contact model to the judge's residual, with any cone program.

A conic solver's own tolerance is no residual: it is tightened until the judge, held to the convex model, agrees.
"""

from dataclasses import dataclass

import numpy as np

from ...problems.contact import ContactProblem
from ...problems.judge import ModelResidual
from ...problems.laws import FloatArray
from ..interface import Observer, Solution, Status, Stop
from .programs import ConicProgram, Ended

FIRST_ACCURACY = 1e-2
"""The conic solver's tolerances at the first try, relative to the residual asked for."""

TIGHTENING = 1e-2
"""Factor on the conic solver's tolerances when the residual is not yet reached."""

TIGHTEST = 1e-15
"""Below this a tolerance means nothing in double precision."""

_LIMITS = {Ended.ITERATION_LIMIT: Status.ITERATION_LIMIT, Ended.TIME_LIMIT: Status.TIME_LIMIT}


@dataclass(frozen=True)
class PreparedConvex:
    """The cone program of one problem."""

    problem: ContactProblem
    residual: ModelResidual
    program: ConicProgram

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve to the judge's residual of the convex model; a start has no use here, and no iterates are shown."""
        n_rows = self.problem.n_rows
        if self.residual.infeasible:
            return Solution(np.zeros(n_rows), Status.INFEASIBLE, 0, "a unilateral law has G_ii = 0 and c_i < 0")
        if n_rows == 0 or self.residual.scale == 0.0:
            return Solution(np.zeros(n_rows), Status.SOLVED, 0)
        accuracy, seconds, iterations = FIRST_ACCURACY * stop.tolerance, 0.0, 0
        no_shift = np.zeros(self.problem.n_contacts)
        best, best_residual = np.zeros(n_rows), np.inf
        while True:
            left = stop.max_iterations - iterations
            result = self.program.run(no_shift, accuracy, left, stop.max_seconds - seconds)
            seconds += result.seconds
            iterations += result.iterations
            if np.isfinite(result.impulses).all():
                residual = self.residual(result.impulses, self.problem.relative_velocity(result.impulses))
                if residual < best_residual:
                    best, best_residual = result.impulses, residual
            if best_residual <= stop.tolerance:
                return Solution(best, Status.SOLVED, iterations)
            limit = _LIMITS.get(result.ended)
            if limit is not None or iterations >= stop.max_iterations or seconds >= stop.max_seconds:
                ended = (limit or Status.ITERATION_LIMIT, f"residual {best_residual:.1e} in the convex model")
                break
            if result.ended is Ended.GAVE_UP:
                ended = (Status.STALLED, f"the conic solver ended with {result.ended} at residual {best_residual:.1e}")
                break
            accuracy *= TIGHTENING
            if accuracy < TIGHTEST:
                ended = (
                    Status.STALLED,
                    f"the conic solver's tolerances are at their floor, residual {best_residual:.1e}",
                )
                break
        return Solution(best, ended[0], iterations, ended[1])
