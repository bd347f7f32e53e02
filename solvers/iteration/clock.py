"""The time that a solve has left."""

import time

from ...problems.arrays import FloatArray
from ..interface import Observer


class Clock:
    """Runs while a solver works, and stops while an observer looks at an iterate.

    Args:
        seconds: time limit of the solve [s], ``Stop.max_seconds``.
    """

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
