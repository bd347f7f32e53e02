"""Solvers that work off the clock, spoil the clock, or leave something running."""

import os
import sys
import threading
import time
from functools import cached_property
from types import FrameType
from typing import Any

import numpy as np
from cheating_solvers import Honest
from proxbench.bench.measure.contacts import protocol
from proxbench.problems import ContactProblem
from proxbench.solvers import Solution, Status, Stop


class Tampering(Honest):
    """Changes something in its process when it first prepares a problem."""

    @cached_property
    def is_done(self) -> bool:
        self.tamper()
        return True

    def tamper(self) -> None:
        raise NotImplementedError

    def prepare(self, problem: ContactProblem) -> Any:
        return super().prepare(problem) if self.is_done else None


class SlowClock(Tampering):
    """Lets the clock of the harness count a tenth."""

    def tamper(self) -> None:
        true = time.perf_counter
        protocol.perf_counter = lambda: true() / 10.0


class StoppedClock(Tampering):
    """Lets it stand."""

    def tamper(self) -> None:
        protocol.perf_counter = lambda: 0.0


class Accountant(Tampering):
    """Divides the times that the harness reports by a hundred."""

    def tamper(self) -> None:
        true = protocol.Measurement.round

        def flattered(measurement: Any, stop: Stop, seconds: float) -> Any:
            found = true(measurement, stop, seconds)
            found.times[:] = [(prepare / 100.0, solve / 100.0) for prepare, solve in found.times]
            found.work[:] = [work / 100.0 for work in found.work]
            return found

        protocol.Measurement.round = flattered


class Ahead(Tampering):
    """Solves each problem before the clock starts; the subclasses say when."""

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


class WhileTraced(Ahead):
    """When a trace function sees the harness begin a solve."""

    def tamper(self) -> None:
        def look(frame: FrameType, event: str, argument: Any) -> None:
            if event == "call" and frame.f_code is protocol.Measurement._solve.__code__:
                sys.setprofile(None)
                self.ahead(frame.f_locals["problem"], frame.f_locals["stop"])
                sys.setprofile(look)

        sys.setprofile(look)


class WhileSwitchingCollection(Ahead):
    """When the harness switches garbage collection off, just before the clock starts."""

    def tamper(self) -> None:
        true = protocol.gc

        class Collector:
            isenabled, enable = true.isenabled, true.enable

            @staticmethod
            def disable() -> None:
                frame = sys._getframe(1)
                self.ahead(frame.f_locals["problem"], frame.f_locals["stop"])
                true.disable()

        protocol.gc = Collector


class Postponing(Tampering):
    """Solves after the clock has stopped, into the array that the harness has copied to."""

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


class Loading(Honest):
    """Leaves processes behind that load the processor while others are measured."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        for _ in range(2):
            _left(_spin)
        return super().solve(problem, stop, observe)


class Orphaning(Honest):
    """Leaves a process behind that is no child of its own any more."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        _left(lambda: _left(_spin))
        return super().solve(problem, stop, observe)


class AheadInThread(Honest):
    """Works on in a thread when it has warmed up."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        if stop.tolerance >= 0.1:
            threading.Thread(target=time.sleep, args=(60.0,), name="ahead", daemon=True).start()
        return super().solve(problem, stop, observe)


def _left(act: Any) -> None:
    if os.fork() == 0:
        act()
        os._exit(0)


def _spin() -> None:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        pass
