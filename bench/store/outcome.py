"""How cases and ladder points end, and the rule that separates right answers from wrong ones."""

from dataclasses import dataclass
from enum import StrEnum

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Verdict, judge
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Status

WRONG_FACTOR = 10.0
"""A claim at tolerance t is wrong when the judge of the solver's own model reads more than this many t."""

RELAXED_FACTOR = 10.0
"""A Coulomb residual this many times that of the solver's own model comes from the model, not from the solve."""

ROUNDING = 1e-13
"""Residuals below this are rounding."""


class Outcome(StrEnum):
    """What came of a case or of one point of its ladder."""

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
    """Only in reports: a case that an interrupted run has left before the end of its ladder."""


FAULTS = (Outcome.TIMEOUT, Outcome.CRASHED, Outcome.OUT_OF_MEMORY, Outcome.MISBEHAVED)
"""Ways in which a whole case fails."""


BAD_OUTCOMES = (*FAULTS, Outcome.WRONG)
"""What no cell may end in."""


@dataclass(frozen=True)
class Cell:
    """One solver on one problem.

    Attributes:
        problem: name.
        solver: name, with options.
        outcome: how it ended.
        residual: the judge's, under Coulomb's law; NaN if there are no impulses.
        model_residual: the judge's, under the solver's own model.
        iterations: number of iterations.
        reason: why it is not solved; empty if it is.
        is_finite: whether all impulses are finite numbers.
        answer_error: largest relative error against the known answer; None where nothing is known.
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
    """Return the judge's verdict on impulses [N s] under a solver's own model, and that under Coulomb's law."""
    coulomb = judge(problem, impulses)
    return (coulomb if model == Model.COULOMB else judge(problem, impulses, model)), coulomb


def point_outcome(status: Status, tolerance: float, model: Model, own: Verdict, coulomb: Verdict) -> Outcome:
    """Return the outcome of a solve that claims ``status`` at ``tolerance``.

    Args:
        status: what the solver claims.
        tolerance: the residual to reach.
        model: what the solver solves.
        own: the verdict under the solver's own model.
        coulomb: the verdict under Coulomb's law.

    Returns:
        WRONG for a claim that the judge of the solver's own model refutes; RELAXED for a right answer to another
        question: its Coulomb residual is above the claim, or far above that of its own model; otherwise the outcome of
        the status.
    """
    if status is not Status.SOLVED:
        return Outcome(status.value)
    if not own.residual <= WRONG_FACTOR * tolerance:
        return Outcome.WRONG
    if model != Model.COULOMB:
        own_accuracy = max(own.residual, ROUNDING)
        if not coulomb.residual <= min(tolerance, RELAXED_FACTOR * own_accuracy):
            return Outcome.RELAXED
    return Outcome.SOLVED


LATE_PREPARING = "preparing took longer than the time limit"
"""Reason of a solve that did not begin within its limit."""


def late_reason(seconds: float, limit: float) -> str:
    """Say that a solve ended after its limit [s], where it claims to have solved; empty if it did not."""
    return f"solved after {seconds:.3g} s, its limit is {limit:g} s" if seconds > limit else ""


def claim_reason(outcome: str, tolerance: float, model: Model | str, own_residual: float) -> str:
    """Say why a claim to have solved does not count, with the residual under the solver's own model.

    Empty for outcomes that are no claims.
    """
    if outcome == Outcome.WRONG:
        return f"claimed {tolerance:.0e}, the judge reads {own_residual:.1e}"
    return f"solves the {model} model, not Coulomb friction" if outcome == Outcome.RELAXED else ""
