"""Newly solved and no longer solved problems are reported, unless a shared core can explain a time limit."""

from pathlib import Path

import msgspec
import pytest
from proxbench.bench import compare
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.bench.store.records import CaseRecord, Point
from simulated_runs import solved_point, store_run
from stored_cases import case_record, measured_in, timed_round

LIMIT = Limits().solve_seconds


def case_of(*points: Point, **others: object) -> list[CaseRecord]:
    return [case_record(points=list(points), **others)]


def solved(seconds: float = 0.01) -> Point:
    return solved_point(1e-2, [timed_round(0, seconds)])


def unsolved(outcome: Outcome, excluded: str = "") -> Point:
    measured = measured_in([timed_round(0, LIMIT, excluded=excluded)], residual=0.3)
    return Point(tolerance=1e-2, outcome=outcome, status=outcome.value, reason="", measured=measured)


def changes(tmp_path: Path, before: list[CaseRecord], after: list[CaseRecord], **others: object) -> list[str]:
    found = compare(store_run(tmp_path / "before", before), store_run(tmp_path / "after", after, **others))
    return list(found.changes["change"])


def changes_of_problems(tmp_path: Path, before: list[CaseRecord], after: list[CaseRecord]) -> dict[str, str]:
    found = compare(store_run(tmp_path / "before", before), store_run(tmp_path / "after", after))
    return dict(zip(found.changes["problem"], found.changes["change"], strict=True))


UNSOLVED = (Outcome.STALLED, Outcome.DIVERGED, Outcome.TIME_LIMIT, Outcome.WRONG)
FAILED = (Outcome.CRASHED, Outcome.MISBEHAVED, Outcome.OUT_OF_MEMORY)


def test_accuracies_lost_or_gained_are_listed_as_unsolved_or_solved(tmp_path: Path) -> None:
    """Each outcome is that of one problem of the runs, and so are the failures of the next test."""
    good = [case_record(problem=outcome.value, points=[solved()]) for outcome in UNSOLVED]
    bad = [case_record(problem=outcome.value, points=[unsolved(outcome)]) for outcome in UNSOLVED]
    for name, sides, expected in (("there", (good, bad), "unsolved"), ("back", (bad, good), "solved")):
        assert changes(tmp_path / name, *sides) == [expected] * len(UNSOLVED)


def test_a_case_that_fails_is_unsolved(tmp_path: Path) -> None:
    good = [case_record(problem=outcome.value, points=[solved()]) for outcome in FAILED]
    bad = [case_record(problem=outcome.value, outcome=outcome, reason="why") for outcome in FAILED]
    assert changes(tmp_path, good, bad) == ["unsolved"] * len(FAILED)


@pytest.mark.slow
def test_a_limit_of_time_that_a_shared_core_explains_decides_nothing(tmp_path: Path) -> None:
    late = unsolved(Outcome.TIME_LIMIT)
    waited = unsolved(Outcome.TIME_LIMIT, "preempted")
    assert changes(tmp_path / "waited", case_of(solved()), case_of(waited)) == ["undecided"]
    assert changes(tmp_path / "near", case_of(solved(0.6 * LIMIT)), case_of(late)) == ["undecided"]
    other = msgspec.structs.replace(Limits(), solve_seconds=0.5 * LIMIT)
    assert changes(tmp_path / "limits", case_of(solved()), case_of(late), limits=other) == ["undecided"]
    timeout = case_of(outcome=Outcome.TIMEOUT, reason="60 s")
    long = case_of(solved(), wall_seconds=0.6 * Limits().case_seconds)
    assert changes(tmp_path / "case", long, timeout) == ["undecided"]


def test_a_case_that_hangs_where_it_took_a_part_of_its_limit_is_unsolved(tmp_path: Path) -> None:
    timeout = case_of(outcome=Outcome.TIMEOUT, reason="60 s")
    assert changes(tmp_path, case_of(solved(), wall_seconds=1.0), timeout) == ["unsolved"]


def test_identical_runs_have_no_changes(tmp_path: Path) -> None:
    assert changes(tmp_path, case_of(solved()), case_of(solved())) == []
    reached = compare(tmp_path / "before", tmp_path / "after")
    assert reached.failures("solved<") == []


def test_the_solved_condition_fails_only_on_points_that_become_unsolved(tmp_path: Path) -> None:
    runs = [
        store_run(tmp_path / name, case_of(point))
        for name, point in (("a", solved()), ("b", unsolved(Outcome.STALLED)))
    ]
    assert compare(*runs).failures("solved<") == ["solved<: S on p to 1e-02"]
    assert compare(*reversed(runs)).failures("solved<") == []


PARTS = {0.6: "undecided", 0.4: "unsolved"}
"""Parts of a limit of time that a solve took before, each on one problem, and the change if it reaches the limit."""


def test_a_solve_that_took_more_than_half_the_limit_may_miss_it_on_a_shared_core(tmp_path: Path) -> None:
    before = [case_record(problem=f"{part}", points=[solved(part * LIMIT)]) for part in PARTS]
    late = [case_record(problem=f"{part}", points=[unsolved(Outcome.TIME_LIMIT)]) for part in PARTS]
    assert changes_of_problems(tmp_path, before, late) == {f"{part}": change for part, change in PARTS.items()}


def test_case_time_limit_may_be_missed_on_a_shared_core(tmp_path: Path) -> None:
    seconds = Limits().case_seconds
    before = [case_record(problem=f"{part}", points=[solved()], wall_seconds=part * seconds) for part in PARTS]
    timeout = [case_record(problem=f"{part}", outcome=Outcome.TIMEOUT, reason="60 s") for part in PARTS]
    assert changes_of_problems(tmp_path, before, timeout) == {f"{part}": change for part, change in PARTS.items()}


def test_a_limit_that_was_reached_in_excluded_rounds_decides_nothing(tmp_path: Path) -> None:
    late = case_of(unsolved(Outcome.TIME_LIMIT, "preempted"))
    assert changes(tmp_path, case_of(solved()), late) == ["undecided"]
