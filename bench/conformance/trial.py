"""One solve for a conformance check, with what every check requires of it."""

from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Residual, judge
from ...problems.contact.problem import ContactProblem
from ...problems.errors import ProblemError
from ...solvers.interface import Solution, Solver, Status, Stop
from ..measure.protocol import solution_fault
from ..store.outcome import WRONG_FACTOR
from .checks import Violation

ROUNDINGS = 8.0
"""Units of rounding of ξ = GΛ + c that the error against a known answer may have beyond what the residual implies."""


@dataclass(frozen=True)
class Trial:
    """A problem, what a solver made of it, and the judge's residual under the solver's own model."""

    problem: ContactProblem
    solution: Solution
    residual: float

    @property
    def is_solved(self) -> bool:
        """Whether the solver claims to have solved."""
        return self.solution.status is Status.SOLVED


def tried(solver: Solver, problem: ContactProblem, stop: Stop, start: FloatArray | None = None) -> Trial:
    """Solve ``problem``, which the solver supports.

    Raises:
        Violation: if the problem is written to, or the result is none, is not finite, claims more than the judge of
            the solver's model confirms, or contradicts what is known about the problem.
    """
    digest = problem.fresh().digest
    solution = solver.prepare(problem).solve(stop, start=start)
    if problem.fresh().digest != digest:
        raise Violation(f"it changed the numbers of {problem.name}; copy what it writes to.")
    expect_form(problem, solution)
    expect_finite(problem, solution)
    residual = own_residual(solver, problem, solution.impulses)
    solvable = problem.answer is None or problem.answer.solvable
    if solution.status is Status.SOLVED:
        if not solvable:
            raise Violation(f"{problem.name} has no solution, and ends as solved; stop on the judge's residual.")
        if not residual <= WRONG_FACTOR * stop.tolerance:
            raise Violation(
                f"it claims to have solved {problem.name} to {stop.tolerance:g}, but the judge of its model "
                f"({solver.model}) reads {residual:.1e}; stop on the judge's residual."
            )
    if solution.status is Status.INFEASIBLE and solvable and problem.answer is not None:
        raise Violation(
            f"{problem.name} has a solution, and ends as infeasible; say so only where it is proved, else stalled."
        )
    return Trial(problem, solution, residual)


def expect_form(problem: ContactProblem, solution: Solution) -> None:
    """Raise ``Violation`` if what a solver returned is no solution, or its impulses no floats of shape (n_rows,)."""
    fault = solution_fault(problem, solution)
    if fault:
        raise Violation(f"on {problem.name}: {fault}.")


def expect_finite(problem: ContactProblem, solution: Solution) -> None:
    """Raise ``Violation`` if impulses are not finite, whatever the status."""
    if not np.isfinite(solution.impulses).all():
        raise Violation(
            f"on {problem.name} it returned impulses that are not finite, with status {solution.status}; "
            "return the best finite iterate."
        )


def own_residual(solver: Solver, problem: ContactProblem, impulses: FloatArray) -> float:
    """Return the judge's residual under the solver's own model.

    Raises:
        Violation: if the model does not apply to a problem that the solver supports.
    """
    try:
        return judge(problem, impulses, solver.model).residual
    except ProblemError as error:
        raise Violation(f"its supports lets {problem.name} through, but {error}") from error


def meet_answer(problem: ContactProblem, impulses: FloatArray) -> None:
    """Raise ``Violation`` if impulses that the judge confirms miss the known answer by more than that implies."""
    known, scale = problem.answer, Residual(problem).scale
    if known is None:
        return
    velocity = problem.relative_velocity(impulses)
    error = known.error(impulses, velocity, scale)
    if error is None:
        return
    residual = judge(problem, impulses).residual
    allowed = known.sensitivity * (residual + rounding(problem, impulses))
    if not error <= allowed:
        raise Violation(
            f"on {problem.name} it misses the known answer by {error:.1e} where its residual of {residual:.1e} implies "
            f"at most {allowed:.1e}."
        )


def rounding(problem: ContactProblem, impulses: FloatArray) -> float:
    """Return how far rounding alone may move ξ = GΛ + c, relative to the largest free velocity."""
    scale = Residual(problem).scale
    if scale == 0.0:
        return 0.0
    size = abs(problem.delassus()) @ np.abs(impulses) + np.abs(problem.free_velocity)
    return ROUNDINGS * float(np.finfo(float).eps) * float(size.max(initial=0.0)) / scale
