"""The associated (convex) contact model as a second-order cone program, solved by Clarabel's interior point method.

Its optimality condition is −ξ ∈ N_K(Λ), which agrees with Coulomb's law where contacts stick or open; a sliding contact
separates with ξ_N = μ‖ξ_T‖ instead of staying closed. The programs are those of ``programs``. Clarabel: Goulart & Chen
2024.
"""

from dataclasses import dataclass
from typing import ClassVar, get_args

import clarabel
import numpy as np

from ...problems.contact import ContactProblem
from ...problems.judge import Residual, convex_obstacle, judge
from ...problems.laws import FloatArray
from ...problems.model import Model
from ..interface import Observer, Solution, SolverError, Status, Stop, described
from .programs import ConicProgram, Form, conic_program, factors_obstacle

FIRST_ACCURACY = 1e-2
"""Clarabel's tolerances at the first try, relative to the residual asked for."""

TIGHTENING = 1e-2
"""Factor on Clarabel's tolerances when the residual is not yet reached."""

TIGHTEST = 1e-15
"""Below this Clarabel's tolerances mean nothing in double precision."""

_ENDED = {
    clarabel.SolverStatus.MaxIterations: Status.ITERATION_LIMIT,
    clarabel.SolverStatus.MaxTime: Status.TIME_LIMIT,
}


def check_form(form: str) -> None:
    """Raise ``SolverError`` unless ``form`` is one of both."""
    if form not in get_args(Form):
        raise SolverError(f"form must be 'delassus' or 'factors', got {form!r}.")


def obstacle(problem: ContactProblem, form: Form) -> str | None:
    """Say why the cone program of ``problem`` does not exist in ``form``, or None."""
    if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
        return "G is not symmetric, so the convex model has no energy to minimise"
    return convex_obstacle(problem) or (factors_obstacle(problem) if form == "factors" else None)


@dataclass(frozen=True)
class ClarabelSOCP:
    """Clarabel on the convex model, through its direct interface.

    Its interior point iterates satisfy no force law, so they are not shown to observers.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.

    Raises:
        SolverError: for an unknown form.
    """

    form: Form = "delassus"

    model: ClassVar[Model] = Model.CONVEX
    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_form(self.form)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem, self.form)

    def prepare(self, problem: ContactProblem) -> "PreparedSOCP":
        """Set the program up."""
        reason = self.supports(problem)
        if reason:
            raise SolverError(f"{self.name} cannot treat {problem.name!r}: {reason}.")
        residual = Residual(problem)
        return PreparedSOCP(problem, residual, conic_program(problem, residual, self.form))


@dataclass(frozen=True)
class PreparedSOCP:
    """The cone program of one problem."""

    problem: ContactProblem
    residual: Residual
    program: ConicProgram

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve to the judge's residual of the convex model; Clarabel cannot use a start, and shows no iterates."""
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
                residual = judge(self.problem, result.impulses, Model.CONVEX).residual
                if residual < best_residual:
                    best, best_residual = result.impulses, residual
            if best_residual <= stop.tolerance:
                return Solution(best, Status.SOLVED, iterations)
            limit = _ENDED.get(result.status)
            if limit is not None or iterations >= stop.max_iterations or seconds >= stop.max_seconds:
                ended = (limit or Status.ITERATION_LIMIT, f"residual {best_residual:.1e} in the convex model")
                break
            if not converged(result.status):
                ended = (Status.STALLED, f"Clarabel ended with {result.status} at residual {best_residual:.1e}")
                break
            accuracy *= TIGHTENING
            if accuracy < TIGHTEST:
                ended = (Status.STALLED, f"Clarabel's tolerances are at their floor, residual {best_residual:.1e}")
                break
        return Solution(best, ended[0], iterations, ended[1])


def converged(status: object) -> bool:
    """Whether Clarabel says that it has reached its tolerances, or nearly."""
    return status in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
