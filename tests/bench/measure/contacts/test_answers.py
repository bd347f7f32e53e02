"""The worst answer counts, under the solver's own model and under Coulomb's law; every claim is checked."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.bench.measure.contacts.answers import JudgedAnswers, judge_answers, judge_control_solves
from proxbench.bench.measure.contacts.control import ControlSolve
from proxbench.bench.measure.timed_round import TimedRound
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import ObservedSolve, Point
from proxbench.problems import ContactProblem, Model, judge
from proxbench.problems.contact.answer import Answer
from proxbench.solvers import Status
from stored_cases import measured_in, timed_round

PROBLEM = ContactProblem.from_delassus(2.0 * np.eye(3), (-1.0, 3.0, 0.0), 0.5)
SLIDES, ASSOCIATED = np.array([0.5, -0.25, 0.0]), np.array([1.0, -0.5, 0.0])
"""The solution under Coulomb's law, and the one of the convex model, in which a contact that slides lifts off."""


def judged(
    *rows: np.ndarray, model: Model = Model.COULOMB, status: Status = Status.SOLVED, tolerance: float = 1e-6
) -> JudgedAnswers:
    return judge_answers(PROBLEM, model, tolerance, status, rows, iterations=range(1, len(rows) + 1))


@pytest.mark.parametrize("order", [1, -1])
def test_the_worst_answer_counts_under_either_law(order: int) -> None:
    found = judged(*(SLIDES, ASSOCIATED)[::order], model=Model.CONVEX)
    assert max(judge(PROBLEM, SLIDES).residual, judge(PROBLEM, ASSOCIATED, Model.CONVEX).residual) <= 1e-15
    assert found.own.residual == judge(PROBLEM, SLIDES, Model.CONVEX).residual > 0.1
    assert found.coulomb.residual == judge(PROBLEM, ASSOCIATED).residual > 0.1
    assert {one.unpacked(3).tobytes() for one in found.worst_impulses} == {SLIDES.tobytes(), ASSOCIATED.tobytes()}
    assert found.outcome is Outcome.WRONG


@pytest.mark.parametrize("order", [1, -1])
def test_iterations_are_those_of_the_first_solve_with_the_worst_answer_under_coulombs_law(order: int) -> None:
    rows = [SLIDES, 1.1 * SLIDES, 1.1 * SLIDES, 1.01 * SLIDES][::order]
    assert judged(*rows).iterations == 2
    assert judged(*(SLIDES, ASSOCIATED)[::order], model=Model.CONVEX).iterations == (2, 1)[::order][0]


@pytest.mark.parametrize(
    ("rows", "model", "status", "outcome"),
    [
        ([SLIDES, SLIDES], Model.COULOMB, Status.SOLVED, Outcome.SOLVED),
        ([SLIDES, 2.0 * SLIDES, SLIDES], Model.COULOMB, Status.SOLVED, Outcome.WRONG),
        ([2.0 * SLIDES, SLIDES], Model.COULOMB, Status.TIME_LIMIT, Outcome.WRONG),
        ([SLIDES, 2.0 * SLIDES], Model.COULOMB, Status.TIME_LIMIT, Outcome.TIME_LIMIT),  # the last one makes no claim
        ([ASSOCIATED], Model.CONVEX, Status.SOLVED, Outcome.RELAXED),
        ([ASSOCIATED, ASSOCIATED], Model.CONVEX, Status.STALLED, Outcome.STALLED),
    ],
)
def test_claims_are_judged_by_the_model_of_the_solver(
    rows: list[np.ndarray], model: Model, status: Status, outcome: Outcome
) -> None:
    found = judged(*rows, model=model, status=status)
    assert found.outcome is outcome
    assert len(found.distinct) == len({one.tobytes() for one in rows})


def first(
    impulses: np.ndarray, status: Status = Status.SOLVED, problem: ContactProblem = PROBLEM, iterations: int = 1
) -> ControlSolve:
    return ControlSolve(problem, TimedRound(status, iterations, "", [0.0], [2.0], [2.0], 0, 0, 0.0), impulses)


def point_with(*firsts: ControlSolve, place: str = "in a first solve in a fresh process") -> Point:
    measured = measured_in([timed_round(0, 1.0)], residual=1e-7, model_residual=1e-8)
    point = Point(tolerance=1e-6, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
    return judge_control_solves(PROBLEM, Model.COULOMB, point, firsts, place)


def test_correct_first_solves_leave_the_point_solved() -> None:
    found = point_with(first(SLIDES), first(SLIDES, Status.TIME_LIMIT))
    assert (found.outcome, found.status, found.reason) == (Outcome.SOLVED, "solved", "")
    assert found.measured is not None
    assert (found.measured.residual, found.measured.model_residual) == (1e-7, 1e-8)


def test_wrong_or_failed_first_solve_determines_the_outcome() -> None:
    wrong = point_with(first(SLIDES), first(2.0 * SLIDES))
    assert wrong.outcome is Outcome.WRONG
    assert wrong.reason.startswith("in a first solve in a fresh process, claimed 1e-06, but judged ")
    assert wrong.measured is not None
    assert wrong.measured.residual == wrong.measured.model_residual == judge(PROBLEM, 2.0 * SLIDES).residual
    stalled = point_with(first(2.0 * SLIDES, Status.STALLED))
    assert (stalled.outcome, stalled.status) == (Outcome.STALLED, "stalled")
    assert stalled.reason == "in a first solve in a fresh process, it ends stalled"


@pytest.mark.parametrize("order", [1, -1])
def test_the_worst_failure_of_first_solves_counts_in_any_order(order: int) -> None:
    """A false claim is worse than a solve that stalls, and a larger residual is worse than a smaller one."""
    failures = [first(9.0 * SLIDES, Status.STALLED), first(2.0 * SLIDES), first(5.0 * SLIDES)][::order]
    found, residuals = point_with(*failures), [judge(PROBLEM, factor * SLIDES).residual for factor in (5.0, 9.0)]
    assert (found.outcome, found.status) == (Outcome.WRONG, "solved")
    assert found.reason.endswith(f"claimed 1e-06, but judged {residuals[0]:.1e}")
    assert found.measured is not None
    assert found.measured.residual == found.measured.model_residual == residuals[1]


def test_iterations_are_those_of_the_first_solve_whose_residual_replaces_a_smaller_one() -> None:
    found = point_with(first(5.0 * SLIDES, iterations=50), first(2.0 * SLIDES, iterations=20), first(SLIDES))
    assert found.measured is not None
    assert (found.measured.residual, found.measured.iterations) == (judge(PROBLEM, 5.0 * SLIDES).residual, 50)
    kept = point_with(first(SLIDES, iterations=7)).measured
    assert kept is not None
    assert kept.iterations == measured_in([timed_round(0, 1.0)]).iterations


def test_iterates_of_an_observed_solve_count_more_than_fewer_reported_iterations_of_a_first_solve() -> None:
    observed = ObservedSolve(observed_iterates=40, observed_iterations=4)
    measured = measured_in([timed_round(0, 1.0)], iterations=40, claimed_iterations=4, observed=observed)
    point = Point(tolerance=1e-6, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
    found = judge_control_solves(PROBLEM, Model.COULOMB, point, [first(5.0 * SLIDES, iterations=5)], "there").measured
    assert found is not None
    assert (found.iterations, found.claimed_iterations) == (40, 5)


def test_a_wrong_answer_to_a_copy_decides_and_is_not_kept() -> None:
    copy = replace(PROBLEM, free_velocity=2.0 * PROBLEM.free_velocity)
    found = point_with(first(2.0 * SLIDES, problem=copy), first(SLIDES, problem=copy), place="on a copy of the problem")
    assert found.outcome is Outcome.WRONG
    assert found.reason.startswith("on a copy of the problem, claimed 1e-06, but judged ")
    assert found.measured is not None
    assert (found.measured.residual, found.measured.impulses) == (1e-7, [])


def test_the_largest_distance_to_known_impulses_counts() -> None:
    assert judged(SLIDES).impulse_error(PROBLEM) is None
    known = replace(PROBLEM, answer=Answer(impulses=(SLIDES,)))
    assert judged(SLIDES, 0.9 * SLIDES, SLIDES).impulse_error(known) == known.answer.impulse_error(0.9 * SLIDES) > 0.0
