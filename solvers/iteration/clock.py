"""The time that a solve has left."""

import time

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Observer, Status, Stop


class Clock:
    """Runs while a solver works, up to a limit [s], and stops while an observer looks at an iterate."""

    def __init__(self, seconds: float) -> None:
        self._limit = seconds
        self._began = time.perf_counter()

    @property
    def used(self) -> float:
        """Time used so far [s]."""
        return time.perf_counter() - self._began

    @property
    def left(self) -> float:
        """Time left [s], negative if it is up."""
        return self._limit - self.used

    @property
    def is_up(self) -> bool:
        """Whether the time is up."""
        return self.left < 0.0

    def show(self, observe: Observer | None, iteration: int, impulses: FloatArray) -> None:
        """Show Λ, shape (n_rows,), which is not written to any more, to an observer if there is one."""
        if observe is None:
            return
        began = time.perf_counter()
        shown = impulses.view()
        shown.setflags(write=False)
        observe(iteration, shown)
        self._began += time.perf_counter() - began

    def limit_met(self, stop: Stop, iterations: int) -> Status | None:
        """Return the limit of a solve that is met after ``iterations``, or None."""
        if iterations >= stop.max_iterations:
            return Status.ITERATION_LIMIT
        return Status.TIME_LIMIT if time.perf_counter() - self._began > self._limit else None
