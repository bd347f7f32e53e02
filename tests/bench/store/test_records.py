"""A case is finished once its points are measured in all passes, except for those that the solver itself ended."""

import pytest
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import PlanRecord
from proxbench.bench.store.records import CaseRecord, Point
from stored_cases import case_record, measured_in, timed_round

PLAN = PlanRecord(problems=["p"], solvers=["S"], tolerances=[1e-2, 1e-4], passes=2)


def point(tolerance: float, outcome: Outcome, passes: int, excluded: str = "") -> Point:
    rounds = [timed_round(number, 1.0, excluded=excluded) for number in range(passes)]
    return Point(tolerance=tolerance, outcome=outcome, status="solved", reason="", measured=measured_in(rounds))


def case_of(*points: Point) -> CaseRecord:
    record: CaseRecord = case_record(outcome=Outcome.MEASURED, points=list(points))
    return record


@pytest.mark.parametrize(("excluded", "is_finished"), [("", True), ("preempted", False), ("unsteady", False)])
def test_a_time_limit_ends_a_case_unless_other_programs_caused_it(excluded: str, is_finished: bool) -> None:
    late = point(1e-4, Outcome.TIME_LIMIT, 1, excluded)
    assert case_of(point(1e-2, Outcome.SOLVED, 2), late).is_finished(PLAN) is is_finished


@pytest.mark.parametrize(("passes", "is_finished"), [(1, False), (2, True), (3, True)])
def test_a_solved_point_is_measured_in_every_pass(passes: int, is_finished: bool) -> None:
    points = (point(tolerance, Outcome.SOLVED, passes) for tolerance in PLAN.tolerances)
    assert case_of(*points).is_finished(PLAN) is is_finished


def test_a_case_without_its_finest_point_is_not_finished() -> None:
    assert not case_of(point(1e-2, Outcome.SOLVED, 2)).is_finished(PLAN)
