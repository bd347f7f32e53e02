"""The monitor tells convergence, oscillation, stall, divergence and limits apart."""

import numpy as np
import pytest
from proxbench.solvers import Status, Stop
from proxbench.solvers.prox.monitor import STALL_SWEEPS, Monitor, sweeps_to_next_look

LAMBDA = np.ones(3)


def status_of(monitor: Monitor, iteration: int, residual: float) -> Status | None:
    ended = monitor.look(iteration, residual, LAMBDA)
    return ended[0] if ended else None


def test_reaching_the_tolerance_is_solved() -> None:
    assert status_of(Monitor(Stop(1e-3)), 4, 1e-3) is Status.SOLVED


def test_nan_and_infinity_are_divergence_and_never_success() -> None:
    assert status_of(Monitor(Stop(1e-3)), 4, float("nan")) is Status.DIVERGED
    assert status_of(Monitor(Stop(1e-3)), 4, float("inf")) is Status.DIVERGED


def test_growth_by_many_orders_is_divergence() -> None:
    monitor = Monitor(Stop(1e-3))
    assert status_of(monitor, 0, 1.0) is None
    assert status_of(monitor, 1, 1e9) is Status.DIVERGED


def test_iteration_limit_is_named() -> None:
    assert status_of(Monitor(Stop(1e-3, max_iterations=10)), 10, 0.5) is Status.ITERATION_LIMIT


def test_time_limit_is_named() -> None:
    assert status_of(Monitor(Stop(1e-3, max_seconds=1e-9)), 1, 0.5) is Status.TIME_LIMIT


def test_slow_power_law_progress_is_a_stall_but_slow_geometric_progress_is_not() -> None:
    creeping, working = Monitor(Stop(1e-12, 10**9)), Monitor(Stop(1e-12, 10**9))
    ended = [status_of(creeping, n, n**-0.05) for n in range(10, 5000, 10)]
    assert Status.STALLED in ended
    assert 10 * (1 + ended.index(Status.STALLED)) >= STALL_SWEEPS
    assert not any(status_of(working, n, 0.999**n) for n in range(10, 20_000, 10))


def test_a_plateau_of_a_thousand_sweeps_is_no_stall() -> None:
    monitor = Monitor(Stop(1e-12, 10**9))
    residuals = [(n, 1e-2 if n < 1000 else 1e-2 * 0.99 ** ((n - 1000) / 10)) for n in range(10, 10_000, 10)]
    assert not any(status_of(monitor, n, residual) for n, residual in residuals)


def test_a_cycle_of_two_is_recognised_and_a_fixed_point_is_not_one() -> None:
    monitor = Monitor(Stop(1e-12))
    monitor.look(1, 0.5, LAMBDA)
    oscillating = monitor.cycle(LAMBDA, 2 * LAMBDA, LAMBDA)
    assert oscillating is not None
    assert oscillating[0] is Status.OSCILLATING
    fixed = monitor.cycle(LAMBDA, LAMBDA, LAMBDA)
    assert fixed is not None
    assert fixed[0] is Status.STALLED
    assert monitor.cycle(LAMBDA, 1.1 * LAMBDA, 1.2 * LAMBDA) is None


def test_the_best_iterate_is_kept() -> None:
    monitor = Monitor(Stop(1e-12, 3))
    monitor.look(1, 0.5, LAMBDA)
    monitor.look(2, 0.1, 2 * LAMBDA)
    ended = monitor.look(3, 0.3, 3 * LAMBDA)
    assert ended is not None
    assert np.array_equal(monitor.solution(ended, 3, 3).impulses, 2 * LAMBDA)


@pytest.mark.parametrize("iteration", [0, 1, 5, 100, 10_000])
def test_looks_are_frequent_at_first_and_never_rarer_than_ten_sweeps(iteration: int) -> None:
    assert 1 <= sweeps_to_next_look(iteration) <= 10
    assert sweeps_to_next_look(0) == 1
