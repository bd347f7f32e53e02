"""One line on standard error, at most once in a process, where kernels compile for more than a second."""

import sys
import time

from numba.core import event

SECONDS_BEFORE_NOTICE = 1.0
"""Compilation time before the notice [s]."""

NOTICE = "Compiling kernels for the first use; they are cached for the next time."


class CompilationListener(event.Listener):
    """Measure the time that kernels take to compile; kernels loaded from the cache do not count.

    Attributes:
        seconds: wall time of all compilations that have ended, nested ones counted once [s].
        kernels: number of functions that were compiled.
        is_silent: whether no notice is written, or no second one.
    """

    def __init__(self) -> None:
        self.seconds, self.kernels, self.is_silent = 0.0, 0, False
        self._depth, self._begin = 0, 0.0

    def on_start(self, compilation: event.Event) -> None:
        """Count the compilation, and write the notice if the ones before it took too long."""
        now = time.perf_counter()
        if self._depth == 0:
            self._begin = now
        self._depth, self.kernels = self._depth + 1, self.kernels + 1
        if not self.is_silent and self.seconds + now - self._begin > SECONDS_BEFORE_NOTICE:
            self.is_silent = True
            print(NOTICE, file=sys.stderr, flush=True)

    def on_end(self, compilation: event.Event) -> None:
        """Add the time of the compilation unless it is part of another."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._begin


COMPILATION = CompilationListener()
"""The compilations of this process."""

event.register("numba:compile", COMPILATION)  # type: ignore[no-untyped-call]


def silence_notice() -> None:
    """Disable the notice in this process, for example where its standard error is recorded."""
    COMPILATION.is_silent = True
