"""Judge the answers of timed and control solves; the worst answer counts."""

from collections.abc import Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from ....problems.arrays import FloatArray
from ....problems.contact.judge import Verdict
from ....problems.contact.model import Model
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Status
from ...store.impulses import Impulses, number_of, worst
from ...store.outcome import Outcome, claim_reason, point_outcome, verdicts
from ...store.records import Point
from .control import ControlSolve
from .iterations import iteration_fields


@dataclass(frozen=True)
class JudgedAnswers:
    """The judgement of all answers at one tolerance.

    Attributes:
        outcome: the outcome of the point.
        own: the worst verdict under the solver's own model.
        coulomb: the worst verdict under Coulomb's law.
        distinct: the distinct answers [N s], each of shape (n_rows,).
        claims: the claimed solutions, as bytes.
        iterations: iterations of the first solve whose answer has the verdict ``coulomb``.
        worst_impulses: the answers with the worst verdicts, with their residuals.
    """

    outcome: Outcome
    own: Verdict
    coulomb: Verdict
    distinct: list[FloatArray]
    claims: list[bytes]
    iterations: int
    worst_impulses: list[Impulses]

    def impulse_error(self, problem: ContactProblem) -> float | None:
        """Return the largest distance to the known impulses of a problem; None if they are unknown."""
        known = problem.answer
        errors = [] if known is None else [known.impulse_error(impulses) for impulses in self.distinct]
        return max((error for error in errors if error is not None), default=None)


def judge_answers(
    problem: ContactProblem,
    model: Model,
    tolerance: float,
    status: Status,
    rows: Sequence[FloatArray],
    *,
    iterations: Sequence[int],
) -> JudgedAnswers:
    """Judge the answers at one tolerance.

    Args:
        problem: the problem.
        model: the model of the solver.
        tolerance: the requested tolerance.
        status: status of the last solve; all earlier solves have the status SOLVED.
        rows: the answers, in the order of the solves [N s], each of shape (n_rows,).
        iterations: iterations of the solve of each answer.
    """
    distinct = {impulses.tobytes(): impulses for impulses in rows}
    counts = {row.tobytes(): count for row, count in zip(rows[::-1], iterations[::-1], strict=True)}  # the first wins
    judged = {key: verdicts(problem, impulses, model) for key, impulses in distinct.items()}
    claims = list(dict.fromkeys(row.tobytes() for row in (rows if status is Status.SOLVED else rows[:-1])))
    outcomes = {point_outcome(Status.SOLVED, tolerance, model, *judged[key]) for key in claims}
    outcome = Outcome(status.value)
    if Outcome.WRONG in outcomes:
        outcome = Outcome.WRONG
    elif status is Status.SOLVED and Outcome.RELAXED in outcomes:
        outcome = Outcome.RELAXED
    under_model, under_coulomb = (max(judged, key=lambda key: judged[key][law].residual) for law in (0, 1))
    candidates = (Impulses.of(distinct[key], *judged[key]) for key in dict.fromkeys((under_coulomb, under_model)))
    own, coulomb, count = judged[under_model][0], judged[under_coulomb][1], counts[under_coulomb]
    return JudgedAnswers(outcome, own, coulomb, list(distinct.values()), claims, count, worst(candidates))


def judge_control_solves(
    problem: ContactProblem, model: Model, point: Point, solves: Sequence[ControlSolve], place: str
) -> Point:
    """Judge the control solves of a point, and return the point with the outcome of the worst one that fails.

    A false claim is worse than any other failure, and a larger residual is worse than a smaller one. A control solve
    that reaches its time limit does not change the outcome. A copy may be harder than the problem: only false claims on
    it count, and its answers are not kept.

    Args:
        problem: the problem.
        model: the model of the solver.
        point: a solved point.
        solves: first solves of the problem or of copies.
        place: description of these solves, for the reason.
    """
    failures, measured = list[tuple[Outcome, float, Status]](), point.measured
    for solve in solves:
        own, coulomb = verdicts(solve.problem, solve.impulses, model)
        outcome = point_outcome(solve.timed.status, point.tolerance, model, own, coulomb)
        is_copy = solve.problem is not problem
        if outcome in (Outcome.SOLVED, Outcome.RELAXED, Outcome.TIME_LIMIT):
            continue
        if is_copy and outcome is not Outcome.WRONG:
            continue
        failures.append((outcome, number_of(own.residual), solve.timed.status))
        if not is_copy and measured is not None:
            is_worse = number_of(coulomb.residual) > number_of(measured.residual)
            if is_worse:
                fields = iteration_fields(solve.timed.iterations, measured.observed)
                measured = replace(measured, residual=coulomb.residual, **fields)
            measured = replace(
                measured,
                model_residual=max(measured.model_residual, own.residual, key=number_of),
                impulses=worst([*measured.impulses, Impulses.of(solve.impulses, own, coulomb)]),
            )
    if not failures:
        return point
    outcome, residual, status = max(failures, key=lambda failure: (failure[0] is Outcome.WRONG, failure[1]))
    reason = claim_reason(outcome, point.tolerance, model, residual) or f"it ends {outcome.value}"
    return replace(point, outcome=outcome, status=status.value, reason=f"{place}, {reason}", measured=measured)
