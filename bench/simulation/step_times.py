"""Times of steps, with or without compilation: numba compiles or loads a kernel at its first call."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

from numba.core import event

from ...problems.contact.solver import Solver
from ...problems.motion.stepping.step import AcceptedStep
from ..isolation.process_usage import used_processor_seconds

COMPILER_EVENT = "numba:compiler_lock"
"""Event of the lock that numba holds while it compiles or loads a kernel."""


def without_compilation(steps: Iterator[AcceptedStep]) -> Iterator[AcceptedStep]:
    """Yield ``steps`` with wall times that exclude compilation.

    A stepper may try the next step before it yields one, so the excess of a compilation over its step is subtracted
    from the following steps. Do not use this function if code of a plugin runs, because it could hold the compiler
    lock.
    """
    compilation_seconds = 0.0
    while True:
        listener: Any = event.TimingListener()  # type: ignore[no-untyped-call]
        with event.install_listener(COMPILER_EVENT, listener):
            step = next(steps, None)
        if step is None:
            return
        compilation_seconds += listener.duration if listener.done else 0.0
        seconds = max(step.seconds - compilation_seconds, 0.0)
        compilation_seconds -= step.seconds - seconds
        yield replace(step, seconds=seconds)


@dataclass
class StepClocks:
    """Wall and processor time of the steps of a simulation.

    Attributes:
        solver: the solver; if it is an executable, the processor time of that program is included.
        wall: wall time [s].
        processor: processor time [s].
    """

    solver: Solver
    wall: float = 0.0
    processor: float = 0.0

    def watch(self, steps: Iterator[AcceptedStep]) -> Iterator[AcceptedStep]:
        """Yield the steps, and add their times and that of a step that fails."""
        while True:
            start_processor, start_wall = used_processor_seconds(self.solver), perf_counter()
            try:
                step = next(steps, None)
            finally:
                self.wall += perf_counter() - start_wall
                self.processor += used_processor_seconds(self.solver) - start_processor
            if step is None:
                return
            yield step
