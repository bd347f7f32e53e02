"""One solve of a conformance check, and the requirements that all checks share."""

from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.judge import judge
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Solution, Solver, Status, Stop
from ...problems.errors import ProblemError
from ...solvers.contract import solution_fault
from ..store.outcome import WRONG_FACTOR
from .checks import Violation

ROUNDING = 8.0 * float(np.finfo(float).eps)
"""Relative rounding error of a known answer."""


@dataclass(frozen=True)
class Trial:
    """A problem, its solution by a solver, and the judged residual under the solver's own model."""

    problem: ContactProblem
    solution: Solution
    residual: float

    @property
    def is_solved(self) -> bool:
        """Whether the solver claims to have solved the problem."""
        return self.solution.status is Status.SOLVED


def run_trial(solver: Solver, problem: ContactProblem, stop: Stop, start: FloatArray | None = None) -> Trial:
    """Solve ``problem``, which the solver supports.

    Raises:
        Violation: if the problem is changed, or the result is not a solution, is not finite, claims more than the judge
            of the solver's model confirms, or contradicts the known answer.
    """
    digest = problem.fresh().digest
    solution = solution_of(solver, problem, stop, start)
    require_unchanged(problem, digest)
    require_finite(problem, solution)
    answer = problem.answer
    if answer is not None and not answer.solvable and solution.status is Status.SOLVED:
        raise Violation(f"{problem.name} has no solution, but is reported as solved; stop on the judge's residual.")
    if answer is not None and answer.solvable and solution.status is Status.INFEASIBLE:
        raise Violation(
            f"{problem.name} has a solution, but is reported as infeasible; report infeasible only with a proof, "
            "otherwise stalled."
        )
    return Trial(problem, solution, confirmed_residual(solver, problem, solution, stop.tolerance))


def solution_of(solver: Solver, problem: ContactProblem, stop: Stop, start: FloatArray | None = None) -> Solution:
    """Solve ``problem``; raise ``Violation`` unless the result is a ``Solution`` with a float array of impulses."""
    solution = solver.prepare(problem).solve(stop, start=start)
    fault = solution_fault(problem, solution)
    if fault:
        raise Violation(f"on {problem.name}: {fault}.")
    return solution


def require_unchanged(problem: ContactProblem, digest: str) -> None:
    """Raise ``Violation`` if the digest of a problem is not ``digest``."""
    if problem.fresh().digest != digest:
        raise Violation(f"it modified the arrays of {problem.name}; copy arrays before modifying them.")


def require_finite(problem: ContactProblem, solution: Solution) -> None:
    """Raise ``Violation`` if impulses are not finite."""
    if not np.isfinite(solution.impulses).all():
        raise Violation(
            f"on {problem.name} it returned impulses that are not finite, with status {solution.status}; "
            "return the best finite iterate."
        )


def confirmed_residual(solver: Solver, problem: ContactProblem, solution: Solution, tolerance: float) -> float:
    """Return the residual under the solver's own model; raise ``Violation`` if it contradicts the solver's claim."""
    residual = own_residual(solver, problem, solution.impulses)
    if solution.status is Status.SOLVED and not residual <= WRONG_FACTOR * tolerance:
        raise Violation(
            f"it claims to have solved {problem.name} to {tolerance:g}, but its judged residual ({solver.model}) "
            f"is {residual:.1e}; stop on the judge's residual."
        )
    return residual


def own_residual(solver: Solver, problem: ContactProblem, impulses: FloatArray) -> float:
    """Return the judge's residual under the solver's own model.

    Raises:
        Violation: if the model does not apply to a problem that the solver supports.
    """
    try:
        return judge(problem, impulses, solver.model).residual
    except ProblemError as error:
        raise Violation(f"supports accepts {problem.name}, but {error}") from error


def require_known_answer(problem: ContactProblem, impulses: FloatArray) -> None:
    """Raise ``Violation`` if the error of confirmed impulses is larger than their residual implies."""
    answer = problem.answer
    if answer is None:
        return
    prepared = Residual(problem)
    error = answer.error(impulses, problem.accurate_velocity(impulses)[0], prepared.scale)
    if error is None:
        return
    residual = judge(problem, impulses).residual
    allowed = answer.sensitivity * (residual + prepared.rounding(impulses) + ROUNDING)
    if not error <= allowed:
        raise Violation(
            f"on {problem.name} its error against the known answer is {error:.1e}, but its residual of "
            f"{residual:.1e} implies at most {allowed:.1e}."
        )
