"""The answers of timed and of first solves, judged: all claims count, and of all answers the worst."""

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from ....problems.arrays import FloatArray
from ....problems.contact.judge import Verdict
from ....problems.contact.model import Model
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Status
from ...store.impulses import Impulses, number_of, worst
from ...store.outcome import ON_COPY, Outcome, claim_reason, point_outcome, verdicts
from ...store.records import Measured, Point
from .control import CopySolve, FirstSolve
from .verdicts import VerdictCache


@dataclass(frozen=True)
class JudgedAnswers:
    """What the judge finds in the answers to one tolerance.

    Attributes:
        outcome: of all of them.
        own: the worst verdict under the solver's own model.
        coulomb: the worst verdict under Coulomb's law.
        different: the different answers, each of shape (n_rows,).
        claims: those that claim to be solutions, as bytes.
        kept: the answers of the worst verdicts.
    """

    outcome: Outcome
    own: Verdict
    coulomb: Verdict
    different: list[FloatArray]
    claims: list[bytes]
    kept: list[Impulses]

    def impulse_error(self, problem: ContactProblem) -> float | None:
        """Return the largest distance to the known impulses of a problem, None where none are known."""
        known = problem.answer
        found = [] if known is None else [known.impulse_error(impulses) for impulses in self.different]
        return max((error for error in found if error is not None), default=None)


def judge_answers(
    problem: ContactProblem,
    model: Model,
    tolerance: float,
    status: Status,
    rows: Sequence[FloatArray],
    remembered: VerdictCache,
) -> JudgedAnswers:
    """Judge the answers to one tolerance.

    Args:
        problem: the problem.
        model: what the solver solves.
        tolerance: what it was asked for.
        status: how the last solve ended; all others claim to have solved.
        rows: the answers in their order [N s], each of shape (n_rows,).
        remembered: verdicts of the run.
    """
    different = {impulses.tobytes(): impulses for impulses in rows}
    judged = {key: remembered.of(problem, impulses, model) for key, impulses in different.items()}
    claims = list(dict.fromkeys(one.tobytes() for one in (rows if status is Status.SOLVED else rows[:-1])))
    outcomes = {point_outcome(Status.SOLVED, tolerance, model, *judged[key]) for key in claims}
    outcome = Outcome(status.value)
    if Outcome.WRONG in outcomes:
        outcome = Outcome.WRONG
    elif status is Status.SOLVED and Outcome.RELAXED in outcomes:
        outcome = Outcome.RELAXED
    under_model, under_coulomb = (max(judged, key=lambda key: judged[key][law].residual) for law in (0, 1))
    kept = worst(Impulses.of(different[key], *judged[key]) for key in dict.fromkeys((under_coulomb, under_model)))
    own, coulomb = judged[under_model][0], judged[under_coulomb][1]
    return JudgedAnswers(outcome, own, coulomb, list(different.values()), claims, kept)


def confirmed(
    problem: ContactProblem, model: Model, measured: Measured, point: Point, firsts: Sequence[FirstSolve]
) -> Point:
    """Return a point with its first solves, whose answers count as those of timed solves do.

    A first solve that ends for want of time alone changes no outcome.

    Args:
        problem: the problem.
        model: what the solver solves.
        measured: numbers of the point.
        point: a point that ends solved.
        firsts: its first solves.
    """
    solved = [one.seconds for one in firsts if one.timed.status is Status.SOLVED and not one.timed.is_preempted]
    measured = replace(measured, first_seconds=[*measured.first_seconds, *solved])
    for first in firsts:
        own, coulomb = verdicts(problem, first.impulses, model)
        outcome = point_outcome(first.timed.status, point.tolerance, model, own, coulomb)
        if outcome in (Outcome.SOLVED, Outcome.RELAXED, Outcome.TIME_LIMIT):
            continue
        reason = claim_reason(outcome, point.tolerance, model, own.residual) or f"it ends {outcome.value}"
        worse = {
            "residual": max(measured.residual, coulomb.residual, key=number_of),
            "model_residual": max(measured.model_residual, own.residual, key=number_of),
            "impulses": worst([*measured.impulses, Impulses.of(first.impulses, own, coulomb)]),
        }
        return replace(
            point,
            outcome=outcome,
            status=first.timed.status.value,
            reason=f"in a first solve in a fresh process, {reason}",
            measured=replace(measured, **worse),
        )
    return replace(point, measured=measured)


def with_copies(model: Model, measured: Measured, point: Point, copies: Sequence[CopySolve]) -> Point:
    """Return a point with the times of copies of its problem, whose answers are judged too.

    Args:
        model: what the solver solves.
        measured: numbers of the point.
        point: a point that ends solved.
        copies: first solves of copies, which claim to be solutions.
    """
    seconds = [float(one.timed.totals[0]) for one in copies if one.is_steady]
    measured = replace(measured, copy_seconds=[*measured.copy_seconds, *seconds])
    for copy in copies:
        own, coulomb = verdicts(copy.problem, copy.impulses, model)
        outcome = point_outcome(copy.timed.status, point.tolerance, model, own, coulomb)
        if outcome is Outcome.WRONG:
            reason = f"{ON_COPY}, {claim_reason(outcome, point.tolerance, model, own.residual)}"
            return replace(point, outcome=outcome, reason=reason, measured=measured)
    return replace(point, measured=measured)
