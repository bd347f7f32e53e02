"""Solvers that work off the clock, spoil the clock, or leave something running or changed."""

import _thread
import builtins
import gc
import os
import sys
import threading
import time
import tracemalloc
import warnings
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from cheating_solvers import Honest
from proxbench.bench.isolation.process_state import ProcessState
from proxbench.bench.measure.contacts import protocol
from proxbench.problems import ContactProblem
from proxbench.solvers import Solution, Status, Stop


class Tampering(Honest):
    """Changes something in its process when it first prepares a problem.

    One that hides replaces the comparison of the process too, so that only what others count from outside shows it.
    """

    hides: ClassVar[bool] = False

    @cached_property
    def is_done(self) -> bool:
        self.tamper()
        if self.hides:
            protocol.replaced_names = lambda before: ""
            ProcessState.changed_for_timing = lambda state: []
        return True

    def tamper(self) -> None:
        raise NotImplementedError

    def prepare(self, problem: ContactProblem) -> Any:
        return super().prepare(problem) if self.is_done else None


class SlowClock(Tampering):
    """Lets the clock of the harness count a tenth."""

    hides = True

    def tamper(self) -> None:
        true, process = time.perf_counter, time.process_time
        protocol.perf_counter = lambda: true() / 10.0
        protocol.process_time = lambda: process() / 10.0


class StoppedClock(Tampering):
    """Lets it stand."""

    hides = True

    def tamper(self) -> None:
        protocol.perf_counter = lambda: 0.0


class Accountant(Tampering):
    """Divides the times that the harness reports by a hundred."""

    hides = True

    def tamper(self) -> None:
        true = protocol.Measurement.round

        def flattered(measurement: Any, stop: Stop, seconds: float) -> Any:
            found = true(measurement, stop, seconds)
            for one in found.solves:
                one.prepare, one.solve, one.processor = one.prepare / 100.0, one.solve / 100.0, one.processor / 100.0
            return found

        protocol.Measurement.round = flattered


class Ahead(Tampering):
    """Solves each problem before the clock starts; the subclasses say when."""

    hides = True
    ready: dict[int, Any]
    stop: Stop

    def prepare(self, problem: ContactProblem) -> Any:
        if not hasattr(self, "ready"):
            self.ready = {}
        return super().prepare(problem)

    def ahead(self, problem: ContactProblem, stop: Stop) -> None:
        self.ready[id(problem)] = Honest.solve(self, problem, stop, None)

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known = self.ready.pop(id(problem), None)
        return super().solve(problem, stop, observe) if known is None or observe is not None else known


class BeforeSolving(Ahead):
    """When the harness begins a solve, whose function it replaces."""

    def tamper(self) -> None:
        true = protocol.Measurement._solve

        def solve(measurement: Any, problem: ContactProblem, stop: Stop) -> Any:
            self.ahead(problem, stop)
            return true(measurement, problem, stop)

        protocol.Measurement._solve = solve


class Postponing(Tampering):
    """Solves after the clock has stopped, into the array that the harness has copied to."""

    hides = True

    def tamper(self) -> None:
        self.copies: list[Any] = []
        true_fault, true_copy = protocol.solution_fault, np.copyto

        def copy(into: Any, given: Any, *more: Any, **options: Any) -> None:
            self.copies.append(into)
            true_copy(into, given, *more, **options)

        def fault(problem: ContactProblem, solution: Any) -> Any:
            found = Honest.solve(self, problem, self.stop, None)
            self.copies.pop()[:] = found.impulses
            return true_fault(problem, solution)

        protocol.solution_fault, np.copyto = fault, copy

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        self.stop = stop
        if observe is not None:
            return super().solve(problem, stop, observe)
        return Solution(np.zeros(problem.n_rows), Status.SOLVED, 1)


class Slowing(Tampering):
    """Makes everything else in its process slow, so that a correction by it would flatter its own times."""

    def tamper(self) -> None:
        tracemalloc.start(10)


class Profiling(Tampering):
    def tamper(self) -> None:
        sys.setprofile(lambda frame, event, argument: None)


class ReplacingSorted(Tampering):
    def tamper(self) -> None:
        true = builtins.sorted

        def slow(*arguments: Any, **options: Any) -> Any:
            for _ in range(1000):
                pass
            return true(*arguments, **options)

        builtins.sorted = slow


class RareCollection(Tampering):
    """Lets garbage be collected hardly ever."""

    def tamper(self) -> None:
        gc.set_threshold(1_000_000)


class Silent(Tampering):
    """Ignores all warnings and floating-point errors of its process, once it has warmed up."""

    def tamper(self) -> None:
        """Do nothing while it warms up."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        if observe is not None:
            warnings.simplefilter("ignore")
            np.seterr(all="ignore")
        return super().solve(problem, stop, observe)


class SilentErrors(Tampering):
    """Ignores floating-point errors from its first solve on."""

    def tamper(self) -> None:
        np.seterr(all="ignore")


class Preferred(Tampering):
    """Gives its process another priority."""

    def tamper(self) -> None:
        os.setpriority(os.PRIO_PROCESS, 0, 5)


class OtherCores(Tampering):
    """Leaves the core that it is pinned to."""

    def tamper(self) -> None:
        """Do nothing: it is pinned later."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
        return super().solve(problem, stop, observe)


class OtherCoresMeanwhile(OtherCores):
    """Works on other cores within a solve, and returns to its own before the solve ends."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        own, matrix = os.sched_getaffinity(0), np.ones((600, 600))
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
        helper = threading.Thread(target=lambda: matrix @ matrix)
        helper.start()
        found = Honest.solve(self, problem, stop, observe)
        helper.join()
        os.sched_setaffinity(0, own)
        return found


class Orphaning(Honest):
    """Leaves a process behind that is no child of its own any more."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        _left(lambda: _left(_spin))
        return super().solve(problem, stop, observe)


class AheadInBareThread(Honest):
    """Works on in a thread when it has warmed up, which the module threading does not list."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        if stop.max_iterations == 200:
            _thread.start_new_thread(time.sleep, (60.0,))
        return super().solve(problem, stop, observe)


def _left(act: Any) -> None:
    if os.fork() == 0:
        act()
        os._exit(0)


def _spin() -> None:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        pass
