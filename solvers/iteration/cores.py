"""The cores that this process may use, and threads of numerical libraries."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


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
    """Limit BLAS and similar libraries to one thread, also in other threads of this process.

    With several threads, the rounding of sums depends on their number, and hard problems amplify it until other methods
    succeed. OpenBLAS also keeps all cores busy for a tenth of a second after each call.
    """
    with _libraries().limit(limits=1):
        yield


@cache
def _libraries() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401  # a controller knows only libraries that are loaded, and finding them takes 2 ms

    return ThreadpoolController()
