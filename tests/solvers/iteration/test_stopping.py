"""Convergence, oscillation, stall, divergence and limits are distinguished, and a plateau does not end a solve."""

import numpy as np
import pytest
from proxbench.problems.compilation.notice import COMPILATION
from proxbench.solvers import Status, Stop
from proxbench.solvers.iteration.stopping import MIN_PLATEAU_SWEEPS, Clock, Monitor, sweeps_to_next_check

LAMBDA = np.ones(3)


def status_of(monitor: Monitor, iteration: int, residual: float) -> Status | None:
    ended = monitor.check_convergence(iteration, residual, LAMBDA)
    return ended[0] if ended else None


def test_reaching_the_tolerance_is_solved() -> None:
    assert status_of(Monitor(Stop(1e-3)), 4, 1e-3) is Status.SOLVED


def test_nan_and_infinity_are_divergence_and_never_success() -> None:
    assert status_of(Monitor(Stop(1e-3)), 4, float("nan")) is Status.DIVERGED
    assert status_of(Monitor(Stop(1e-3)), 4, float("inf")) is Status.DIVERGED


def test_growth_by_many_orders_of_magnitude_is_divergence() -> None:
    monitor = Monitor(Stop(1e-3))
    assert status_of(monitor, 0, 1.0) is None
    assert status_of(monitor, 1, 1e9) is Status.DIVERGED


def test_iteration_limit_is_reported() -> None:
    assert status_of(Monitor(Stop(1e-3, max_iterations=10)), 10, 0.5) is Status.ITERATION_LIMIT


def test_time_limit_is_reported() -> None:
    assert status_of(Monitor(Stop(1e-3, max_seconds=1e-9)), 1, 0.5) is Status.TIME_LIMIT


@pytest.mark.parametrize("one", [1, True, np.int64(1), np.float32(1.0)], ids=lambda one: type(one).__name__)
def test_tolerance_and_time_of_any_type_are_stored_as_floats_for_which_kernels_are_compiled(one: float) -> None:
    stop = Stop(one, max_seconds=one)
    assert (type(stop.tolerance), type(stop.max_seconds)) == (float, float)
    assert stop == Stop(1.0, max_seconds=1.0)


def test_clock_excludes_compilation_time(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(1.0)
    monkeypatch.setattr(COMPILATION, "seconds", COMPILATION.seconds + 100.0)
    assert clock.elapsed < -99.0
    assert clock.reached_limit(Stop(1e-3), 1) is None
    monkeypatch.undo()
    assert clock.elapsed >= 0.0


def test_slow_progress_does_not_end_a_solve_and_power_law_progress_is_lacking() -> None:
    for residual_at, lacks in ((lambda n: n**-0.05, True), (lambda n: 0.999**n, False)):
        monitor, lacking = Monitor(Stop(1e-12, 10**9)), []
        for n in range(10, 20_000, 10):
            assert monitor.check_convergence(n, residual_at(n), n * LAMBDA) is None
            lacking.append(monitor.lacks_progress)
        assert any(lacking) is lacks
        assert not any(lacking[: MIN_PLATEAU_SWEEPS // 10 - 1])


def test_progress_is_lacking_without_gain_in_the_last_three_quarters_of_the_sweeps() -> None:
    """All digits are gained at sweep 3000, which is in the last three quarters up to sweep 12 000, but not later."""
    monitor, lacking = Monitor(Stop(1e-12, 10**9)), {}
    for n in range(10, 16_010, 10):
        assert status_of(monitor, n, 1.0 if n < 3000 else 1e-3) is None
        lacking[n] = monitor.lacks_progress
    assert not lacking[8000]
    assert not lacking[11_900]
    assert lacking[12_100]


def test_a_plateau_of_a_million_sweeps_is_not_a_stall() -> None:
    monitor = Monitor(Stop(1e-12, 10**9))
    assert not any(status_of(monitor, n, 1e-2) for n in range(10))
    assert not any(status_of(monitor, n, 1e-2) for n in range(10, 1_000_000, 100))
    assert status_of(monitor, 1_000_010, 1e-12) is Status.SOLVED


def repeated(monitor: Monitor, newest: np.ndarray, previous: np.ndarray, before: np.ndarray) -> list[Status | None]:
    ended = [monitor.check_cycle(newest, previous, before) for _ in range(4)]
    return [status[0] if status else None for status in ended]


def test_constant_impulses_are_a_stall_at_the_second_comparison() -> None:
    assert repeated(Monitor(Stop(1e-12)), LAMBDA, LAMBDA, LAMBDA) == [None, *3 * [Status.STALLED]]


def test_a_cycle_of_two_is_recognised_on_the_second_comparison() -> None:
    nearly = LAMBDA * (1.0 + 1e-15)
    assert repeated(Monitor(Stop(1e-12)), LAMBDA, 2 * LAMBDA, nearly) == [None, *3 * [Status.OSCILLATING]]


def test_rounding_of_zero_does_not_hide_a_cycle() -> None:
    newest, before = np.array([1e-17, 1.0, 1.0]), np.array([3e-17, 1.0, 1.0])
    assert repeated(Monitor(Stop(1e-12)), newest, LAMBDA + 1.0, before) == [None, *3 * [Status.OSCILLATING]]


def test_changing_iterates_are_neither_a_stall_nor_a_cycle() -> None:
    one_digit = np.array([1.0, np.nextafter(1.0, 2.0), 1.0])
    slowly_decaying = (1.0 - 1e-12) * LAMBDA
    small_one_moves = np.array([1e9, 1.0 + 1e-12, 1.0])
    assert repeated(Monitor(Stop(1e-12)), one_digit, LAMBDA, LAMBDA) == 4 * [None]
    assert repeated(Monitor(Stop(1e-12)), slowly_decaying, -LAMBDA, LAMBDA) == 4 * [None]
    assert repeated(Monitor(Stop(1e-12)), small_one_moves, 2 * LAMBDA, np.array([1e9, 1.0, 1.0])) == 4 * [None]


def test_temporary_cycles_and_stalls_are_ignored() -> None:
    monitor = Monitor(Stop(1e-12))
    for _ in range(4):
        assert monitor.check_cycle(LAMBDA, 2 * LAMBDA, LAMBDA) is None
        assert monitor.check_cycle(LAMBDA, 1.1 * LAMBDA, 1.2 * LAMBDA) is None
    for size in (1.0, 2.0, 3.0):  # stops at another point every time
        assert monitor.check_cycle(size * LAMBDA, size * LAMBDA, size * LAMBDA) is None


def test_the_best_iterate_is_kept() -> None:
    monitor = Monitor(Stop(1e-12, 3))
    monitor.check_convergence(1, 0.5, LAMBDA)
    monitor.check_convergence(2, 0.1, 2 * LAMBDA)
    ended = monitor.check_convergence(3, 0.3, 3 * LAMBDA)
    assert ended is not None
    assert np.array_equal(monitor.solution(ended, 3, 3).impulses, 2 * LAMBDA)


@pytest.mark.parametrize("iteration", [0, 1, 5, 100, 10_000])
def test_checks_are_frequent_at_first_and_at_most_ten_sweeps_apart(iteration: int) -> None:
    assert 1 <= sweeps_to_next_check(iteration) <= 10
    assert sweeps_to_next_check(0) == 1
