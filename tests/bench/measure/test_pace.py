"""Times on a free core: slowness is that around a short solve and that of all moments of a long one; work scales."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.bench.measure import pace
from proxbench.bench.measure.pace import MOMENT, free_probe_seconds, free_share, probe_seconds, slowness

SLOW = st.floats(1.0, 3.0)
SECONDS = st.floats(1e-6, 1e3)


def met(around: float, mean: float, seconds: float) -> float:
    return float(slowness(np.array([around]), mean, np.array([seconds]))[0])


def share(seconds: float, work: float, slow: float) -> float:
    return float(free_share(np.array([seconds]), np.array([work]), np.array([slow]))[0])


@pytest.mark.slow
@given(SLOW, SLOW, SECONDS)
def test_slowness_lies_between_that_around_a_solve_and_the_mean(around: float, mean: float, seconds: float) -> None:
    low, high = sorted((around, mean))
    assert low * (1.0 - 1e-12) <= met(around, mean, seconds) <= high * (1.0 + 1e-12)


def test_short_solves_meet_what_surrounds_them_and_long_ones_the_mean() -> None:
    assert met(2.0, 1.0, 1e-4 * MOMENT) == pytest.approx(2.0, rel=1e-4)
    assert met(2.0, 1.0, MOMENT) == pytest.approx(1.5)
    assert met(2.0, 1.0, 1e4 * MOMENT) == pytest.approx(1.0, rel=1e-3)


@given(SLOW, SECONDS)
def test_work_is_faster_by_the_slowness_and_waiting_is_not(slow: float, seconds: float) -> None:
    assert share(seconds, seconds, slow) == pytest.approx(1.0 / slow)
    assert share(seconds, 2.0 * seconds, slow) == pytest.approx(1.0 / slow)  # two threads
    assert share(seconds, 0.0, slow) == 1.0
    assert share(seconds, 0.5 * seconds, slow) == pytest.approx(0.5 + 0.5 / slow)


def test_a_solve_without_time_has_none_on_a_free_core() -> None:
    assert 0.0 * share(0.0, 0.0, 2.0) == 0.0


def test_the_probe_of_a_free_core_is_one_of_the_fast_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([2.0, *[1.0] * 5, *[2.0] * 94])
    clock = iter(range(1000))
    monkeypatch.setattr(pace, "probe_seconds", lambda: next(times))
    monkeypatch.setattr(pace, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(pace, "SEARCH", 99.5)
    assert free_probe_seconds.__wrapped__() == 1.0


def test_a_probe_takes_time() -> None:
    assert 0.0 < probe_seconds() < 1.0
