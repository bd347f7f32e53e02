"""A notice on standard error when compilation takes long."""

import os
import sys
import time
from mmap import mmap
from typing import TextIO

from numba.core import event

SECONDS_BEFORE_NOTICE = 1.0
"""Compilation time after which the notice is written [s]."""

NOTICE = "Compiling kernels for the first use; they are cached for the next time."
"""Text of the notice on standard error."""

CLEAR_LINE = "\r\x1b[2K"
"""Control sequence of terminals: go to the start of the line and delete it."""


class CompilationListener(event.Listener):
    """A listener that measures the time that kernels take to compile; kernels loaded from the cache do not count.

    Attributes:
        seconds: wall time of all compilations that have ended, counting nested ones once [s].
        kernels: number of functions that were compiled.
    """

    def __init__(self) -> None:
        self.seconds, self.kernels = 0.0, 0
        self._depth, self._begin = 0, 0.0
        self._silent: bytearray | mmap = bytearray(1)
        self._stream: TextIO | None = None

    @property
    def is_silent(self) -> bool:
        """Whether no further notice is written."""
        return bool(self._silent[0])

    def silence(self) -> None:
        """Write no further notice."""
        self._silent[0] = 1

    def share_with_forks(self) -> None:
        """Let this process and its forks write one notice in total, to the current standard error.

        A forked process may redirect its own standard error.
        """
        silent = mmap(-1, 1)
        silent[0] = self._silent[0]
        self._silent, self._stream = silent, os.fdopen(os.dup(2), "w")

    def on_start(self, compilation: event.Event) -> None:
        """Count the compilation, and write the notice if earlier ones took too long."""
        now = time.perf_counter()
        if self._depth == 0:
            self._begin = now
        self._depth, self.kernels = self._depth + 1, self.kernels + 1
        self._write_notice(now)

    def on_end(self, compilation: event.Event) -> None:
        """Write the notice if compilations so far took too long, and add the time unless this one is nested."""
        now = time.perf_counter()
        self._write_notice(now)
        self._depth -= 1
        if self._depth == 0:
            self.seconds += now - self._begin

    def _write_notice(self, now: float) -> None:
        """Write the notice once, if compilations have taken too long by the time ``now``."""
        if not self.is_silent and self.seconds + now - self._begin > SECONDS_BEFORE_NOTICE:
            self.silence()
            if self._stream is None:
                print(NOTICE, file=sys.stderr, flush=True)
            else:  # another process may show a progress bar on the same line
                print(f"{CLEAR_LINE if self._stream.isatty() else ''}{NOTICE}", file=self._stream, flush=True)


COMPILATION = CompilationListener()
"""The compilations of this process."""

event.register("numba:compile", COMPILATION)  # type: ignore[no-untyped-call]
