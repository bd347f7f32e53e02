"""A round is excluded if something else ran on its core, but not because its solver sleeps."""

from typing import Any

import pytest
from proxbench.bench.isolation.worker import Fault
from proxbench.bench.measure.timed_round import TimedRound
from times_under_load import restore_limits


@pytest.fixture(autouse=True)
def _limits_of_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    restore_limits(monkeypatch, "measure.timed_round.TOLERATED_SECONDS")


PLAIN = {
    "status": "solved",
    "iterations": 3,
    "message": "",
    "prepare": [0.001, 0.001],
    "solve": [0.009, 0.011],
    "processor": [0.010, 0.012],
    "involuntary": 0,
    "voluntary": 0,
    "waited": 0.0,
}


def read(**changes: Any) -> TimedRound:
    return TimedRound.read({**PLAIN, **changes}, wall_seconds=1.0)


@pytest.mark.parametrize(
    ("changes", "is_preempted"),
    [
        ({}, False),
        ({"involuntary": 1, "waited": 0.0002}, False),  # one per cent
        ({"involuntary": 2, "waited": 0.004, "processor": [0.008, 0.010]}, True),
        ({"processor": [0.008, 0.010]}, True),  # the hypervisor took the core
        ({"processor": [0.001, 0.001], "voluntary": 2}, False),  # it slept
        ({"processor": [0.001, 0.001], "voluntary": 2, "waited": 0.004, "involuntary": 1}, True),
        ({"processor": [0.020, 0.024], "involuntary": 5, "waited": 0.0}, False),  # two threads
        ({"processor": [0.008, 0.010], "voluntary": 1, "waited": None}, False),
        ({"processor": [0.008, 0.010], "voluntary": 1, "involuntary": 1, "waited": None}, True),
    ],
)
def test_time_that_others_took_excludes_a_round(changes: dict[str, Any], is_preempted: bool) -> None:
    timed = read(**changes)
    assert timed.is_preempted is is_preempted
    assert timed.record(0, 0, 0, 1e-4, is_steady=True).excluded == ("preempted" if is_preempted else "")


def test_a_round_beside_a_slow_probe_is_excluded_and_keeps_what_the_clock_counted() -> None:
    calm, unsteady = (read().record(0, 1, 0, 1e-4, is_steady) for is_steady in (True, False))
    assert (calm.excluded, unsteady.excluded) == ("", "unsteady")
    assert calm.total_seconds == unsteady.total_seconds
    assert calm.total_seconds.median == pytest.approx(0.012)  # the first solve of several does not count
    assert (calm.wall_seconds, calm.processor_seconds) == pytest.approx((0.022, 0.022))


@pytest.mark.parametrize(
    "changes",
    [
        {"prepare": [0.001]},
        {"prepare": []},
        {"solve": [[0.1], [0.1]]},
        {"processor": ["a", 1.0]},
        {"processor": [float("nan"), 1.0]},
        {"solve": [-0.1, 0.1]},
        {"involuntary": 0.5},
        {"waited": "long"},
        {"status": "well"},
    ],
)
def test_a_malformed_round_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(Fault, match="an invalid answer"):
        read(**changes)


def test_uncounted_work_is_neither_solve_time_nor_preemption() -> None:
    """Judging takes 30 ms of each solve; without them, the processor time would look like that of four cores."""
    changes: dict[str, Any] = {**PLAIN, "uncounted": [0.030, 0.030], "processor": [0.040, 0.042]}
    timed = TimedRound.read(changes, wall_seconds=1.0, is_built_in=True)
    assert timed.totals.tolist() == read().totals.tolist()
    assert not timed.is_preempted
    assert not timed.exceeds(1)
    record = timed.record(0, 0, 0, 1e-4, is_steady=True)
    assert (record.solve_seconds, record.wall_seconds) == pytest.approx((0.011, 0.082))
    lost = TimedRound.read({**changes, "processor": [0.010, 0.012], "involuntary": 1}, 1.0, is_built_in=True)
    assert lost.is_preempted
    with pytest.raises(Fault, match=r"counted 0\.082 s of solving in 0\.05 s"):
        TimedRound.read(changes, wall_seconds=0.05, is_built_in=True)


def test_a_plugin_cannot_take_time_off_its_solves() -> None:
    with pytest.raises(Fault, match="invalid"):
        read(uncounted=[0.001, 0.001])
    with pytest.raises(Fault, match="invalid"):
        TimedRound.read({**PLAIN, "uncounted": [0.001]}, wall_seconds=1.0, is_built_in=True)


def test_a_clock_that_counts_more_than_passed_is_refused() -> None:
    with pytest.raises(Fault, match=r"counted 0\.022 s of solving in 0\.01 s"):
        TimedRound.read(PLAIN, wall_seconds=0.01)
