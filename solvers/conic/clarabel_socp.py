"""ClarabelSOCP: the associated (convex) contact model as a second-order cone program, solved by Clarabel.

The optimality condition of the model is −ξ ∈ N_K(Λ). It agrees with Coulomb's law where contacts stick or open. A
sliding contact, however, separates with ξ_N = μ‖ξ_T‖. The programs are those of ``programs``. Clarabel is an interior
point method (Goulart & Chen 2024).

The tolerance of a conic solver does not bound the residual. It is therefore reduced until the judge's residual under
the convex model reaches the tolerance of the solve. Once a tolerance is too tight for the solver's factorisations, all
other tolerances are tried, because the attainable residual is not predictable. All tolerances are then tried with more
accurate linear algebra. A solve that fails to reach a smaller tolerance thus includes all runs of a solve to a larger
one, and its residual is not larger.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import ModelResidual
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop, start_impulses
from ..iteration.loop import infeasible_solution
from ..iteration.method import Method, check_form
from .programs import ClarabelProgram, ConicStatus, Form, unsupported_reason

LADDER = tuple(10.0**-digits for digits in range(3, 16))
"""Tolerances of the conic solver; smaller ones are meaningless in double precision."""

FIRST_ACCURACY = 1e-2
"""Upper bound of the conic solver's first tolerance, relative to the tolerance of the solve."""

STRIDE = 2
"""Number of steps down the ladder from one run to the next."""

_LIMITS = {ConicStatus.ITERATION_LIMIT: Status.ITERATION_LIMIT, ConicStatus.TIME_LIMIT: Status.TIME_LIMIT}


@dataclass(frozen=True)
class ClarabelSOCP(Method):
    """Clarabel on the convex model, through its direct interface.

    Its interior-point iterates satisfy no force law, so they are not passed to observers.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.

    Raises:
        SolverError: if the form is unknown.
    """

    form: Form = "delassus"

    model: ClassVar[Model] = Model.CONVEX
    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_form(self.form)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or unsupported_reason(problem, self.form)

    def prepare(self, problem: ContactProblem) -> "PreparedConvex":
        """Create the cone program of a problem."""
        self.check_supports(problem)
        return PreparedConvex(problem, ModelResidual(problem, Model.CONVEX), ClarabelProgram(problem, self.form))


@dataclass(frozen=True)
class PreparedConvex:
    """The cone program of one problem."""

    problem: ContactProblem
    residual: ModelResidual = field(repr=False)
    program: ClarabelProgram = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve until the judge's residual in the convex model reaches the tolerance; ignore start and observer."""
        check_stop(stop)
        start_impulses(start, self.problem.n_rows)  # raises an error if the start is invalid
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        seconds, iterations, best = 0.0, 0, np.zeros(self.problem.n_rows)
        best_residual = self.residual(best, self.problem.free_velocity)
        if best_residual <= stop.tolerance:
            return Solution(best, Status.SOLVED, 0)
        if stop.max_iterations == 0:
            return Solution(best, Status.ITERATION_LIMIT, 0, f"residual {best_residual:.1e} in the convex model")
        accuracies = _Accuracies(stop.tolerance)
        for accuracy, refines_more in accuracies:
            iterations_left = stop.max_iterations - iterations
            velocity, seconds_left = self.problem.free_velocity, stop.max_seconds - seconds
            result = self.program.run(velocity, accuracy, iterations_left, seconds_left, refines_more)
            seconds += result.seconds
            iterations += result.iterations
            if np.isfinite(result.impulses).all():
                residual = self.residual.judged(self.problem, result.impulses)
                if residual < best_residual:
                    best, best_residual = result.impulses, residual
            if best_residual <= stop.tolerance:
                return Solution(best, Status.SOLVED, iterations)
            limit = _LIMITS.get(result.status)
            if limit is None and iterations >= stop.max_iterations:
                limit = Status.ITERATION_LIMIT
            elif limit is None and seconds >= stop.max_seconds:
                limit = Status.TIME_LIMIT
            if limit is not None:
                return Solution(best, limit, iterations, f"residual {best_residual:.1e} in the convex model")
            accuracies.is_failing = result.status is not ConicStatus.CONVERGED
        reason = f"residual {best_residual:.1e} at the tightest tolerances of the conic solver"
        if accuracies.is_failing:
            reason = f"the conic solver {result.status} at residual {best_residual:.1e}"
        return Solution(best, Status.STALLED, iterations, reason)


class _Accuracies:
    """Tolerances to try: decreasing until the conic solver fails, then the others, then all with more refinement."""

    def __init__(self, tolerance: float) -> None:
        tight_steps = [step for step, accuracy in enumerate(LADDER) if accuracy <= FIRST_ACCURACY * tolerance]
        self._first = tight_steps[0] if tight_steps else len(LADDER) - 1
        self.is_failing = False

    def __iter__(self) -> Iterator[tuple[float, bool]]:
        tried = set()
        for accuracy in LADDER[self._first :: STRIDE]:
            tried.add(accuracy)
            yield accuracy, False
            if self.is_failing:
                break
        yield from ((accuracy, False) for accuracy in reversed(LADDER) if accuracy not in tried)
        yield from ((accuracy, True) for accuracy in reversed(LADDER))
