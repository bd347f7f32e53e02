"""Cases of one problem: how they run side by side, and which results an interrupt keeps."""

import threading
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest
from counting_task import Counting
from proxbench.bench.isolation.worker import Fault
from proxbench.bench.measure import ladder
from proxbench.bench.measure.ladder import CasePass, LadderCase, measure_ladder
from proxbench.bench.measure.measuring_core import MeasuringCore
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.bench.store.records import CaseRecord, Point
from stored_cases import case_record


class Fake(LadderCase[None]):
    """A case without a process, whose ``begin`` is a function."""

    def __init__(self, begin: Any) -> None:
        limits = Limits(solve_seconds=1.0, case_seconds=1.0, memory_bytes=1, max_iterations=1)
        super().__init__([1e-2], limits, None, CasePass())
        self.is_told = threading.Event()
        self._begin = begin

    def is_pending(self, level: int) -> bool:
        return True

    def begin(self) -> None:
        self._begin(self)

    def dismiss(self) -> None:
        super().dismiss()
        self.is_told.set()

    def dies(self) -> None:
        self._fail(Fault(Outcome.CRASHED, "it died"))

    def measure(self, value: float, number: int) -> None:
        return None

    def needs_round(self, results: Sequence[None]) -> bool:
        return False

    def point(self, value: float, results: list[None]) -> Point:
        raise NotImplementedError

    def reason_to_stop(self, point: Point) -> str:
        return ""

    def identity(self) -> dict[str, Any]:
        return {}


def test_cases_begin_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ladder.os, "cpu_count", lambda: 2)
    both = threading.Barrier(2, timeout=30.0)
    measure_ladder([Fake(lambda case: both.wait()), Fake(lambda case: both.wait())])


def test_an_interrupt_ends_cases_that_begin_and_fails_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ladder.os, "cpu_count", lambda: 2)

    def interrupted(case: Fake) -> None:
        raise KeyboardInterrupt

    def ended(case: Fake) -> None:
        assert case.is_told.wait(30.0)
        case.dies()

    cases = [Fake(interrupted), Fake(ended), Fake(ended)]
    with pytest.raises(KeyboardInterrupt):
        measure_ladder(cases)
    assert [case.outcome for case in cases] == [Outcome.MEASURED] * 3


def test_a_case_that_dies_as_it_begins_has_failed() -> None:
    case = Fake(Fake.dies)
    measure_ladder([case])
    assert case.outcome is Outcome.CRASHED


class Conversing(Fake):
    """A case whose process answers one request."""

    def __init__(self, stored: CaseRecord | None = None) -> None:
        LadderCase.__init__(self, [1e-2], Limits(solve_seconds=1.0), stored, CasePass())

    def begin(self) -> None:
        self._start(Counting())
        assert self._ask("count") is not None

    def identity(self) -> dict[str, Any]:
        plain = case_record()
        return {name: getattr(plain, name) for name in ("problem", "digest", "solver", "model", "has_iterates")} | {
            "n_rows": plain.n_rows,
            "n_contacts": plain.n_contacts,
        }


def test_a_case_that_is_resumed_keeps_its_peak_memory_and_adds_up_its_time() -> None:
    found = []
    for stored in (None, case_record(wall_seconds=1000.0, peak_memory_bytes=1), case_record(wall_seconds=1000.0)):
        case = Conversing(stored)
        case.begin()
        case.end()
        found.append(case.record())
    fresh, small, large = found
    assert 2**20 < fresh.peak_memory_bytes < 2**40
    assert 0.0 < fresh.wall_seconds < 1000.0 < small.wall_seconds
    assert small.peak_memory_bytes > 2**20
    assert large.peak_memory_bytes == 2**40


def test_more_threads_than_the_run_may_use_are_unsupported(monkeypatch: pytest.MonkeyPatch) -> None:
    case, pinned = Fake(lambda case: None), list[int]()
    monkeypatch.setattr(Fake, "threads", 3)
    monkeypatch.setattr(case, "_worker", SimpleNamespace(process=0, busy_seconds=0.0, close=lambda: None))
    monkeypatch.setattr(MeasuringCore, "pin", lambda core, process, count: pinned.append(count))
    case.pin_to_core(MeasuringCore(1, allowed=frozenset({0, 1, 2})))
    assert (pinned, case.outcome) == ([3], Outcome.MEASURED)
    monkeypatch.setattr(case, "end", lambda: setattr(case, "_worker", None))
    case.pin_to_core(MeasuringCore(1, allowed=frozenset({0, 1})))
    assert (pinned, case.outcome) == ([3], Outcome.UNSUPPORTED)
