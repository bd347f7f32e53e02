"""A solver is charged exactly for its preparation and its solves, not for the harness."""

import _thread
import builtins
import gc
import signal
import sys
import time
import tracemalloc
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pytest
from proxbench.bench.isolation.child import MisbehaviourError
from proxbench.bench.measure.contacts import case_process as measure
from proxbench.bench.measure.contacts.case_process import Measurement
from proxbench.bench.measure.timed_round import TimedRound
from proxbench.problems import ContactProblem, load
from proxbench.solvers import Model, Solution, Status, Stop
from proxbench.solvers.prox.coloured_sorprox import ColouredSORprox

STOP = Stop(1e-4)

SORTED, ERRORS = sorted, np.geterr()


@dataclass
class Clock:
    """A clock that advances only when it is moved; each reading of it takes ``reading`` seconds."""

    now: float = 100.0
    reading: float = 0.0

    def perf_counter(self) -> float:
        self.now += self.reading
        return self.now


@dataclass
class Timed:
    """A solver that moves the clock by known times in ``prepare`` and ``solve``."""

    clock: Clock
    prepare_seconds: float = 0.0
    solve_seconds: float = 0.0
    status: Status = Status.SOLVED
    raises: bool = False
    seen: list[ContactProblem] = field(default_factory=list)
    collecting: list[bool] = field(default_factory=list)
    observed: list[bool] = field(default_factory=list)
    limits: list[float] = field(default_factory=list)

    name: ClassVar[str] = "Timed"
    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> "Timed":
        self.seen.append(problem)
        self.collecting.append(gc.isenabled())
        self.clock.now += self.prepare_seconds
        return self

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        self.collecting.append(gc.isenabled())
        self.observed.append(observe is not None)
        self.limits.append(stop.max_seconds)
        self.clock.now += self.solve_seconds
        if self.raises:
            raise RuntimeError
        return Solution(np.zeros(self.seen[-1].n_rows), self.status, 1)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """A clock in place of the harness's, on which copying a problem takes seven seconds."""
    clock = Clock()
    monkeypatch.setattr(measure, "perf_counter", clock.perf_counter)
    fresh = ContactProblem.fresh

    def slow_copy(problem: ContactProblem) -> ContactProblem:
        clock.now += 7.0
        return fresh(problem)

    monkeypatch.setattr(ContactProblem, "fresh", slow_copy)
    return clock


def measured(solver: Timed) -> Measurement:
    return Measurement(load("hard-counterexample"), solver)


def measured_round(solver: Timed, stop: Stop, seconds: float) -> TimedRound:
    return measured(solver).round(stop, seconds)[0]


def times(found: TimedRound) -> list[tuple[float, float]]:
    return [*zip(found.prepare, found.solve, strict=True)]


def ignore(*arguments: object) -> None:
    """Do nothing."""


FILTER = ("ignore", None, UserWarning, None, 7)

THRESHOLDS = gc.get_threshold()

TAMPERING: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
    "the trace function": (lambda: sys.settrace(ignore), lambda: sys.settrace(None)),
    "the profile function": (lambda: sys.setprofile(ignore), lambda: sys.setprofile(None)),
    "memory tracing": (tracemalloc.start, tracemalloc.stop),
    "the settings of the garbage collector": (lambda: gc.set_threshold(7), lambda: gc.set_threshold(*THRESHOLDS)),
    "the warning filters": (
        lambda: warnings.filters.insert(0, FILTER),  # type: ignore[attr-defined]
        lambda: warnings.filters.remove(FILTER),  # type: ignore[attr-defined]
    ),
    "numpy's error state": (lambda: np.seterr(all="ignore"), lambda: np.seterr(**ERRORS)),
    "the switch interval": (lambda: sys.setswitchinterval(0.1), lambda: sys.setswitchinterval(0.005)),
    "signal handlers": (
        lambda: signal.signal(signal.SIGALRM, ignore),
        lambda: signal.signal(signal.SIGALRM, signal.SIG_DFL),
    ),
    "builtins.sorted": (lambda: setattr(builtins, "sorted", list), lambda: setattr(builtins, "sorted", SORTED)),
}
"""Changes that a solver may make in its process, and how the test reverts each."""


def test_known_time_is_charged_exactly_without_copies_of_the_problem(clock: Clock) -> None:
    assert times(measured_round(Timed(clock, 0.25, 0.5), STOP, 0.0)) == [(0.25, 0.5)]


@pytest.mark.parametrize("times_library", [False, True])
def test_the_time_of_a_library_counts_alone_for_an_adapter_of_proxbench(clock: Clock, times_library: bool) -> None:
    solver = Timed(clock, 0.25, 0.5)
    solver.library_seconds = 0.125  # type: ignore[attr-defined]
    found = Measurement(load("hard-counterexample"), solver, times_library=times_library).round(STOP, 0.0)[0]
    assert times(found) == [(0.0, 0.125) if times_library else (0.25, 0.5)]
    assert found.uncounted == ([0.625] if times_library else [])


def test_a_solver_that_does_nothing_is_charged_one_reading_of_the_clock_for_each_part(clock: Clock) -> None:
    clock.reading = 0.125
    assert times(measured_round(Timed(clock), STOP, 0.0)) == [(0.125, 0.125)]


def test_a_round_goes_on_until_its_time_is_up_and_charges_every_solve(clock: Clock) -> None:
    found = measured_round(Timed(clock, 1.0, 2.0), STOP, 25.0)  # each takes ten seconds with the copy
    assert times(found) == [(1.0, 2.0)] * 3


def test_solves_of_the_known_problem_warm_the_caches_before_first_solves(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Warm-up solves are repeated for 20 s and not counted; each takes 7 s, including the copy of the problem."""
    monkeypatch.setattr(measure, "WARM_SECONDS", 20.0)
    solver, new = Timed(clock, solve_seconds=1.0), load("hard-groove")
    measurement = measured(solver)
    known = measurement.problem.digest
    found, _ = measurement.first_solves(STOP, [new])
    assert [problem.digest for problem in solver.seen] == [known] * 3 + [new.digest]
    assert times(found) == [(0.0, 1.0)]


def test_a_round_has_the_threads_that_the_prepared_solver_names() -> None:
    problem = load("funnel-100")
    for threads, expected in ((1, None), (2, 1)):  # its colours have fewer than 250 contacts per thread
        solver = ColouredSORprox(threads=threads)
        assert Measurement(problem, solver).round(Stop(1e-2), 0.0)[0].threads == expected


def test_preparing_and_solving_have_one_limit_of_time(clock: Clock) -> None:
    solver = Timed(clock, prepare_seconds=0.6)
    measured(solver).round(Stop(1e-4, max_seconds=1.0), 0.0)
    assert solver.limits == [pytest.approx(0.4)]
    late = Timed(clock, prepare_seconds=1.5)
    found = measured_round(late, Stop(1e-4, max_seconds=1.0), 0.0)
    assert (found.status, late.limits) == (Status.TIME_LIMIT, [])


@pytest.mark.parametrize("what", sorted(TAMPERING))
def test_process_changes_left_by_a_solver_are_misbehaviour(what: str) -> None:
    act, restore = TAMPERING[what]
    measurement = measured(Timed(Clock()))
    try:
        act()
        with pytest.raises(MisbehaviourError, match=what):
            measurement.compare_process()
    finally:
        restore()
    measurement.compare_process()


def test_a_thread_that_is_started_without_the_module_threading_is_refused() -> None:
    lock, measurement = _thread.allocate_lock(), measured(Timed(Clock()))
    lock.acquire()
    before = _thread._count()
    _thread.start_new_thread(lock.acquire, ())
    while _thread._count() == before:  # until the thread has started
        time.sleep(1e-3)
    try:
        with pytest.raises(MisbehaviourError, match="leaves 1 thread running"):
            measurement.round(STOP, 0.0)
    finally:
        lock.release()
        while _thread._count() > before:
            time.sleep(1e-3)


def test_a_solve_that_fails_ends_the_round(clock: Clock) -> None:
    solver = Timed(clock, 1.0, 2.0, status=Status.STALLED)
    found = measured_round(solver, STOP, 1e3)
    assert found.status is Status.STALLED
    assert times(found) == [(1.0, 2.0)]


def test_a_round_has_the_iterations_of_the_first_solve_with_each_answer(clock: Clock) -> None:
    """Solves take 10, 20, … iterations, and every second one has the same answer."""

    class Alternating(Timed):
        def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
            found, number = super().solve(stop, start, observe), len(self.observed)
            status = Status.SOLVED if number < 5 else Status.STALLED
            return Solution(found.impulses + number % 2, status, 10 * number)

    timed, answers = measured(Alternating(clock)).round(STOP, 1e3)
    assert [impulses[0] for impulses in answers] == [1.0, 0.0, 1.0]
    assert timed.answer_iterations == [10, 20, 50]


def test_every_timed_solve_has_a_problem_of_its_own_and_no_observer(clock: Clock) -> None:
    solver = Timed(clock)
    measurement = measured(solver)
    measurement.warm_up(STOP)
    measurement.round(STOP, 20.0)
    assert len(solver.seen) == 4
    arrays = [problem.free_velocity for problem in (measurement.problem, *solver.seen)]
    assert not any(np.shares_memory(one, other) for i, one in enumerate(arrays) for other in arrays[:i])
    assert solver.observed == [False] * 4


def test_an_observed_solve_is_not_timed(clock: Clock) -> None:
    solver = Timed(clock, 1.0, 2.0)
    clock.reading = 1.0
    measured(solver).observe(STOP)
    assert solver.observed == [True]
    assert clock.now == 100.0 + 7.0 + 3.0  # the times of a copy and of a solve; the clock is not read


@pytest.mark.parametrize("raises", [False, True])
def test_garbage_collection_is_disabled_while_timing_and_enabled_afterwards(clock: Clock, raises: bool) -> None:
    solver = Timed(clock, raises=raises)
    measurement = measured(solver)
    assert gc.isenabled()
    if raises:
        with pytest.raises(RuntimeError):
            measurement.round(STOP, 0.0)
    else:
        measurement.round(STOP, 0.0)
    assert solver.collecting == [False, False]
    assert gc.isenabled()


def test_garbage_collections_after_the_warm_up_skip_the_objects_that_it_left(clock: Clock) -> None:
    measurement = measured(Timed(clock))
    visited = len(gc.get_objects())
    try:
        measurement.warm_up(STOP)
        assert len(gc.get_objects()) < visited / 100.0
    finally:
        gc.unfreeze()


def test_garbage_collection_disabled_by_the_caller_stays_disabled(clock: Clock) -> None:
    gc.disable()
    try:
        measured(Timed(clock)).round(STOP, 0.0)
        assert not gc.isenabled()
    finally:
        gc.enable()
