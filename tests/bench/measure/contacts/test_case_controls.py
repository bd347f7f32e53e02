"""A case compares its times and answers with those of first solves and of solves of copies of its problem."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cases_without_process import LADDER, PROBLEM, SOLUTION, made_case, measured_round, timed
from proxbench.bench.isolation.worker import Fault
from proxbench.bench.measure.contacts import case as case_module
from proxbench.bench.measure.contacts.case import (
    Case,
)
from proxbench.bench.measure.contacts.control import ControlSolve
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import ContactProblem
from proxbench.solvers import Status, Stop
from times_under_load import restore_limits


@pytest.fixture(autouse=True)
def _limits_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    restore_limits(
        monkeypatch,
        "measure.timed_round.TOLERATED_SECONDS",
        "store.notes.ALLOWANCE_SECONDS",
    )


class Controlled:
    """Control solves with given results, and the tolerances of the requested ones."""

    def __init__(self, first: Callable[[Stop], ControlSolve], copy: Callable[[Stop], ControlSolve]) -> None:
        self._first, self._copy = first, copy
        self.warm_up, self.core = b"", None
        self.firsts, self.copied = list[float](), list[float]()

    def first_solves(self, stop: Stop, seconds: float, again: Callable[[], float], start: None) -> list[ControlSolve]:
        self.firsts.append(stop.tolerance)
        return [self._first(stop)]

    def copies(self, stop: Stop, seconds: float, again: Callable[[], float]) -> list[ControlSolve]:
        self.copied.append(stop.tolerance)
        return [self._copy(stop)]


def solved_in(
    seconds: float, impulses: np.ndarray = SOLUTION, problem: ContactProblem = PROBLEM, **changes: Any
) -> Any:
    return lambda stop: ControlSolve(problem, timed(seconds, **changes), impulses)


def controlled(
    monkeypatch: pytest.MonkeyPatch, first: Any = None, copy: Any = None, **options: Any
) -> tuple[Case, Controlled]:
    controls = Controlled(first or solved_in(1e-3), copy or solved_in(1e-3))
    monkeypatch.setattr(case_module, "Controls", lambda *setting: controls)
    return made_case(**options), controls


def test_every_solved_point_has_a_first_solve_and_one_of_them_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    case, controls = controlled(monkeypatch, first=solved_in(2e-3), copy=solved_in(3e-3))
    for level in range(3):
        case.add_point(level, [measured_round(), measured_round()])
    assert controls.firsts == list(LADDER)
    assert len(controls.copied) == 1
    found = [one.measured for one in case.points if one.measured is not None]
    assert [one.first_seconds for one in found] == [[pytest.approx(2e-3)]] * 3
    assert sorted(one.copy_seconds for one in found) == [[], [], [pytest.approx(3e-3)]]
    assert [bool(one.impulses) for one in found] == [False, False, True]


def test_no_first_solve_follows_a_wrong_or_a_failed_point(monkeypatch: pytest.MonkeyPatch) -> None:
    case, controls = controlled(monkeypatch)
    case.add_point(0, [measured_round(impulses=np.zeros(3))])
    case.add_point(1, [measured_round(status=Status.STALLED)])
    assert [one.outcome for one in case.points] == [Outcome.WRONG, Outcome.STALLED]
    assert controls.firsts == controls.copied == []


@pytest.mark.parametrize(("seconds", "count"), [(1e-3, 0), (2e-3, 0), (1e-4, 1)])
def test_a_later_pass_repeats_first_solves_only_if_it_is_faster_than_the_earlier_ones_explain(
    seconds: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, controls = controlled(monkeypatch)
    case.add_point(0, [measured_round(1e-3)])
    case.add_point(0, [measured_round(seconds)])
    assert len(controls.firsts) == 1 + count


def test_excluded_rounds_do_not_decide_whether_first_solves_explain_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    case, controls = controlled(monkeypatch)
    case.add_point(0, [measured_round(1e-3)])
    case.add_point(0, [measured_round(1e-4, "preempted"), measured_round(1e-4, "preempted"), measured_round(1e-3)])
    assert len(controls.firsts) == 1


@pytest.mark.parametrize("changes", [{"status": Status.TIME_LIMIT}, {"waited": 1.0, "involuntary": 1}])
def test_the_time_of_a_first_solve_that_was_disturbed_or_late_is_not_kept(
    changes: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    case, _ = controlled(monkeypatch, first=solved_in(1e-3, **changes))
    case.add_point(0, [measured_round()])
    assert case.points[0].measured is not None
    assert case.points[0].measured.first_seconds == []


@pytest.mark.parametrize("which", ["first", "copy"])
def test_a_wrong_control_solve_makes_the_point_wrong(which: str, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = ContactProblem.from_delassus(PROBLEM.delassus().toarray(), PROBLEM.free_velocity, 0.3)
    wrong = solved_in(1e-3, np.zeros(3), PROBLEM if which == "first" else copy)
    case, controls = controlled(monkeypatch, **{which: wrong})
    for level in range(3):
        case.add_point(level, [measured_round()])
    reasons = [one.reason for one in case.points if one.outcome is Outcome.WRONG]
    if which == "first":
        assert len(reasons) == 3
        assert all(reason.startswith("in a first solve in a fresh process, claimed ") for reason in reasons)
    else:
        assert len(reasons) == 1
        assert reasons[0].startswith("on a copy of the problem, claimed ")
        assert len(controls.firsts) == 2  # one refutation suffices


def test_a_fault_of_a_control_solve_is_that_of_the_case(monkeypatch: pytest.MonkeyPatch) -> None:
    def repeats(stop: Stop) -> ControlSolve:
        raise Fault(Outcome.MISBEHAVED, "it repeats answers instead of solving")

    case, _ = controlled(monkeypatch, first=repeats)
    monkeypatch.setattr(case, "end", lambda: None)
    case.add_point(0, [measured_round()])
    assert (case.outcome, case.points) == (Outcome.MISBEHAVED, [])
    assert case.record().reason == "it repeats answers instead of solving"
