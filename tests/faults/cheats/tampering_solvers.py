"""Solvers that work off the clock, change the clock, or leave processes or changes behind."""

import _thread
import builtins
import gc
import os
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from cheating_solvers import LARGE, Honest
from proxbench.bench.isolation import process_usage
from proxbench.bench.isolation.process_state import ProcessState
from proxbench.bench.measure.contacts import case_process
from proxbench.bench.store.plans import Limits
from proxbench.problems import ContactProblem
from proxbench.solvers import Solution, Stop


class Tampering(Honest):
    """Changes something in its process when it first prepares a problem."""

    def tamper(self) -> None:
        raise NotImplementedError

    @cached_property
    def is_done(self) -> bool:
        self.tamper()
        return True

    def prepare(self, problem: ContactProblem) -> Any:
        return super().prepare(problem) if self.is_done else None


def _replace_sorted() -> None:
    true = builtins.sorted

    def slow(*arguments: Any, **options: Any) -> Any:
        for _ in range(1000):
            pass
        return true(*arguments, **options)

    builtins.sorted = slow


CHANGES: dict[str, Callable[[], Any]] = {
    "Slowing": lambda: tracemalloc.start(10),
    "Profiling": lambda: sys.setprofile(lambda frame, event, argument: None),
    "ReplacingSorted": _replace_sorted,
    "RareCollection": lambda: gc.set_threshold(1_000_000),
    "SilentErrors": lambda: np.seterr(all="ignore"),
    "Preferred": lambda: os.setpriority(os.PRIO_PROCESS, 0, 5),
}
"""The changes that some cheats make in their process, by the names of the cheats."""


@dataclass
class Changing(Tampering):
    """Makes one of ``CHANGES``."""

    name: str = ""

    def tamper(self) -> None:
        CHANGES[self.name]()


class Hiding(Tampering):
    """Also replaces the comparison of process states, so that only counts from outside reveal the change."""

    tried_on = LARGE

    def tamper(self) -> None:
        self.spoil()
        case_process.replacement_text = lambda before: ""
        ProcessState.changed_timing_settings = lambda state: []

    def spoil(self) -> None:
        raise NotImplementedError


class SlowClock(Hiding):
    def spoil(self) -> None:
        true, process = time.perf_counter, time.process_time
        case_process.perf_counter = lambda: true() / 10.0
        process_usage.process_time = lambda: process() / 10.0


class StoppedClock(Hiding):
    limits = Limits(solve_seconds=1.0, case_seconds=5.0)

    def spoil(self) -> None:
        case_process.perf_counter = lambda: 0.0


class BeforeSolving(Hiding):
    ready: dict[int, Solution]

    def spoil(self) -> None:
        true, self.ready = case_process.Measurement._solve, {}

        def solve(measurement: Any, problem: ContactProblem, stop: Stop, start: Any = None) -> Any:
            self.ready[id(problem)] = Honest.solve(self, problem, stop, None)
            return true(measurement, problem, stop, start)

        case_process.Measurement._solve = solve

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known = self.ready.pop(id(problem), None)
        return super().solve(problem, stop, observe) if known is None or observe is not None else known


class OtherCoresMeanwhile(Honest):
    tried_on = LARGE

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        own, matrix = os.sched_getaffinity(0), np.ones((600, 600))
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
        helper = threading.Thread(target=lambda: matrix @ matrix)
        helper.start()
        found = super().solve(problem, stop, observe)
        helper.join()
        os.sched_setaffinity(0, own)
        return found


class Orphaning(Honest):
    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        _fork(lambda: _fork(_spin))
        return super().solve(problem, stop, observe)


class AheadInBareThread(Honest):
    """Leaves a thread that runs on after the warm-up."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        if stop.max_iterations == 200:
            _thread.start_new_thread(time.sleep, (60.0,))
        return super().solve(problem, stop, observe)


def _fork(act: Callable[[], Any]) -> None:
    if os.fork() == 0:
        act()
        os._exit(0)


def _spin() -> None:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        pass
