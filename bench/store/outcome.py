"""Outcomes of cases and ladder points, and the rule that separates right answers from wrong ones."""

from dataclasses import dataclass
from enum import StrEnum

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Verdict, judge
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Status
from .fields import accuracy_tag

WRONG_FACTOR = 10.0
"""A claim at tolerance t is wrong if the residual under the solver's own model exceeds this multiple of t."""

RELAXED_FACTOR = 10.0
"""A Coulomb residual above this multiple of that under the solver's own model is due to the model, not the solve."""

ROUNDING = 1e-13
"""Residuals below this are rounding errors."""


class Outcome(StrEnum):
    """Outcome of a case, or of one point of its ladder."""

    MEASURED = "measured"
    UNSUPPORTED = "unsupported"
    TIMEOUT = "timeout"
    CRASHED = "crashed"
    OUT_OF_MEMORY = "out of memory"
    MISBEHAVED = "misbehaved"

    SOLVED = "solved"
    RELAXED = "relaxed"
    WRONG = "wrong"
    ITERATION_LIMIT = "iteration limit"
    TIME_LIMIT = "time limit"
    STALLED = "stalled"
    OSCILLATING = "oscillating"
    DIVERGED = "diverged"
    INFEASIBLE = "infeasible"
    NOT_ATTEMPTED = "not attempted"

    UNFINISHED = "unfinished"
    """In reports only: a case whose ladder an interrupted run did not complete."""


FAULTS = (Outcome.TIMEOUT, Outcome.CRASHED, Outcome.OUT_OF_MEMORY, Outcome.MISBEHAVED)
"""Failures of a whole case."""

BAD_OUTCOMES = (*FAULTS, Outcome.WRONG)
"""Outcomes that no cell of a solver matrix may have."""


@dataclass(frozen=True)
class Cell:
    """The result of one solver on one problem.

    Attributes:
        problem: name of the problem.
        solver: name of the solver, with options.
        outcome: the outcome.
        residual: judged residual under Coulomb's law; NaN without impulses.
        model_residual: judged residual under the solver's own model; NaN without impulses.
        iterations: number of iterations.
        reason: why the problem is not solved; empty if it is solved.
        is_finite: whether all impulses are finite numbers.
        answer_error: largest relative error of the known parts of the solution; None if nothing is known.
    """

    problem: str
    solver: str
    outcome: Outcome
    residual: float = float("nan")
    model_residual: float = float("nan")
    iterations: int = 0
    reason: str = ""
    is_finite: bool = True
    answer_error: float | None = None


def verdicts(problem: ContactProblem, impulses: FloatArray, model: Model) -> tuple[Verdict, Verdict]:
    """Return the verdicts on impulses [N s], shape (n_rows,), under a solver's own model and under Coulomb's law."""
    coulomb = judge(problem, impulses)
    return (coulomb if model == Model.COULOMB else judge(problem, impulses, model)), coulomb


def point_outcome(status: Status, tolerance: float, model: Model, own: Verdict, coulomb: Verdict) -> Outcome:
    """Return the outcome of a solve that claims ``status`` at ``tolerance``.

    Args:
        status: status that the solver returned.
        tolerance: residual to reach.
        model: model that the solver solves.
        own: verdict under the solver's own model.
        coulomb: verdict under Coulomb's law.
    """
    claims_solution = status is Status.SOLVED
    return claim_outcome(tolerance, model, own.residual, coulomb.residual) if claims_solution else Outcome(status.value)


def claim_outcome(tolerance: float, model: Model, own: float, coulomb: float) -> Outcome:
    """Return the outcome of a claim of success, by the residuals under the solver's own model and Coulomb's law.

    Returns:
        WRONG if the residual under the solver's own model refutes the claim; RELAXED for a correct solution of another
        model, whose Coulomb residual exceeds the claim or is far above that of its own model; otherwise SOLVED.
    """
    if not own <= WRONG_FACTOR * tolerance:
        return Outcome.WRONG
    is_relaxed = model != Model.COULOMB and not coulomb <= min(tolerance, RELAXED_FACTOR * max(own, ROUNDING))
    return Outcome.RELAXED if is_relaxed else Outcome.SOLVED


ON_COPY = "on a copy of the problem"
"""Beginning of the reason of a claim that is wrong on a changed copy of the problem; its impulses are not stored."""

IN_FIRST_SOLVE = "in a first solve in a fresh process"
"""Beginning of the reason of a claim that is wrong, or of a failure, in a first solve of the problem."""

LATE_PREPARING = "preparing took longer than the time limit"
"""Reason of a solve that did not begin within its time limit."""


def late_reason(seconds: float, limit: float) -> str:
    """Return why a claim of success after the time limit [s] does not count; empty within the limit."""
    return f"solved after {seconds:.3g} s, but its limit is {limit:g} s" if seconds > limit else ""


def claim_reason(outcome: str, tolerance: float, model: Model | str, own_residual: float) -> str:
    """Return why a claim of success does not count, with the residual under the solver's own model.

    The text is empty for other outcomes.
    """
    if outcome == Outcome.WRONG:
        return f"claimed {accuracy_tag(tolerance)}, but judged {own_residual:.1e}"
    return f"solves the {model} model, not Coulomb friction" if outcome == Outcome.RELAXED else ""
