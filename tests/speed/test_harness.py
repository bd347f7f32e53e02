"""Overhead of measurements: the time charged to a solver that does nothing, and to one with a known time.

The charged time is reported by the harness from a case's own process, as in a run, and stored in ``extra_info``. Its
least value is below 20 µs for a solver that does nothing; its median is within 2 % of a known time.
"""

import time
from collections.abc import Callable, Iterator
from statistics import median
from typing import Any

import numpy as np
import pytest
from contestants import funnel_step
from known_solvers import Known
from numba import njit
from proxbench.bench.isolation.worker import Worker
from proxbench.bench.measure.contacts.case_process import Measurement, MeasuringTask
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.plans import Limits
from proxbench.problems.exchange.files.problem_file import problem_bytes
from proxbench.solvers import Solution, Solver, Status, Stop

STOP = Stop(1e-4)
LIMITS = Limits()

CHARGED_FOR_NOTHING = 20e-6
"""Upper bound of the least time charged to a solver that does nothing [s]."""

CHARGED_TOO_MUCH = 0.02
"""Largest difference between charged and known time, relative to the known one."""

Start = Callable[[Solver], Worker]


@pytest.fixture
def start() -> Iterator[Start]:
    """Yield a function that starts a case's process, which ends after the test."""
    data, workers = problem_bytes(funnel_step("funnel-1000")), []

    def started(solver: Solver) -> Worker:
        workers.append(Worker(MeasuringTask(data, solver_spec(solver)), LIMITS.case_seconds, LIMITS.memory_bytes))
        workers[-1].ask("warm_up", STOP)
        return workers[-1]

    yield started
    for worker in workers:
        worker.close()


def test_charging_nothing(benchmark: Any, start: Start) -> None:
    """One round of one empty solve: a fresh problem, the solve, the check, and the messages in both directions."""
    worker = start(Known())
    charged: list[list[float]] = []

    def ask() -> None:
        charged.extend(worker.ask("round", STOP, 0.0)[0]["times"])

    benchmark.pedantic(ask, rounds=200, warmup_rounds=5)
    seconds = [sum(times) for times in charged]
    benchmark.extra_info["charged_microseconds"] = 1e6 * median(seconds)
    assert 0.0 < min(seconds) < CHARGED_FOR_NOTHING  # other programs can only increase it


@pytest.mark.parametrize("part", ["prepare", "solve"])
def test_charging_a_known_time(benchmark: Any, start: Start, part: str) -> None:
    worker, column = start(Known(**{f"{part}_seconds": 5e-3})), ("prepare", "solve").index(part)
    ratios: list[float] = []

    def ask() -> None:
        answer = worker.ask("round", STOP, 0.0)[0]
        ratios.append(answer["times"][0][column] / float(answer["message"].split()[column]))

    benchmark.pedantic(ask, rounds=100, warmup_rounds=3)
    benchmark.extra_info["charged_over_known"] = median(ratios)
    assert median(ratios) == pytest.approx(1.0, abs=CHARGED_TOO_MUCH)


@njit(cache=True)
def _count(steps):  # type: ignore[no-untyped-def]
    """Marsaglia's xorshift; each step depends on the previous one, so every run takes the same processor cycles."""
    value = np.uint64(88172645463325252)
    for _ in range(steps):
        value ^= value << np.uint64(13)
        value ^= value >> np.uint64(7)
        value ^= value << np.uint64(17)
    return value


class Counting(Known):
    """Counts a fixed number of steps in place of watching a clock."""

    steps = 1_000_000

    def prepare(self, problem: Any) -> Any:
        return self

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        _count(self.steps)
        return Solution(np.zeros(funnel_step("funnel-1000").n_rows), Status.SOLVED, 1)


def test_charging_a_calibrated_loop(benchmark: Any) -> None:
    """The same loop is timed alternately by itself and as a solver; the least times are uninterrupted."""
    solver = Counting()
    measurement = Measurement(funnel_step("funnel-1000").fresh(), solver)
    measurement.warm_up(STOP)
    known: list[float] = []
    charged: list[float] = []

    def in_turn() -> None:
        began = time.perf_counter()
        _count(solver.steps)
        known.append(time.perf_counter() - began)
        charged.append(sum(measurement.round(STOP, 0.0).times[0]))

    benchmark.pedantic(in_turn, rounds=200, warmup_rounds=3)
    benchmark.extra_info["charged_over_known"] = min(charged) / min(known)
    assert min(charged) == pytest.approx(min(known), rel=CHARGED_TOO_MUCH)


def test_starting_a_case(benchmark: Any, start: Start) -> None:
    """Starting forks a case's process, sends it the problem and warms it up; none of this is charged to the solver."""
    start(Known())  # the first one starts the server, which loads everything
    benchmark.pedantic(start, args=(Known(),), rounds=15)
    charged = [sum(start(Known()).ask("round", STOP, 0.0)[0]["times"][0]) for _ in range(15)]
    assert median(charged) < 0.1 * benchmark.stats.stats.min
