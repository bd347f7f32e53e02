"""The cores that this process may use, and threads of numerical libraries."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from threadpoolctl import OpenBLASController, ThreadpoolController


def usable_cores() -> int:
    """Return the number of cores that this process may use, which ``taskset`` and containers restrict."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_requirement(cores: int) -> str:
    """Return the valid numbers of threads, as a text for messages."""
    if cores == 1:
        return "1, because this process may use only one core"
    return f"a whole number from 1 to {cores}, the cores that this process may use"


@contextmanager
def one_library_thread() -> Iterator[None]:
    """Limit BLAS to one thread in the whole process, until the last of several simultaneous uses ends.

    With several threads, the rounding of sums depends on the number of threads. On hard problems, the difference can
    grow until another method solves the problem. OpenBLAS also keeps all cores busy for a tenth of a second after each
    call. The libraries are those of NumPy and SciPy, and any other BLAS that is loaded before the first use.
    """
    _limit.enter()
    try:
        yield
    finally:
        _limit.leave()


class _SharedLimit:
    """The limit of a process, and the number of its users."""

    def __init__(self) -> None:
        self._lock, self._n_users = threading.Lock(), 0
        self._limiter: Any = None

    def enter(self) -> None:
        """Set the limit for the first user."""
        with self._lock:
            if self._n_users == 0:
                self._limiter = _libraries().limit(limits=1, user_api="blas")
                _release_control()
            self._n_users += 1

    def leave(self) -> None:
        """Restore the numbers of threads after the last user, which may run in a different thread from the first."""
        with self._lock:
            self._n_users -= 1
            if self._n_users == 0:
                self._limiter.restore_original_limits()
                _release_control()


_limit = _SharedLimit()


def _release_control() -> None:
    """Let any thread change the number of threads; threadpoolctl 3.8 allows only the thread that did so first."""
    release: Any = getattr(OpenBLASController, "clear_controlling_thread", None)
    if release is not None:
        release(force=True)


@cache
def _libraries() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401  # a controller knows only libraries that are loaded, and finding them takes 2 ms

    return ThreadpoolController()
