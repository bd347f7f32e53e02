"""Parts with few kernels, to be compiled by several processes."""

import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numba.core.caching import IndexDataCacheFile

VALUES: tuple[Any, ...] = (1, 1.0, 1j, np.float32(1), np.int8(1), np.int16(1), np.uint8(1), np.uint16(1))
"""Values of different types; each has a kernel of its own."""

READ = IndexDataCacheFile._load_index


@njit(cache=True)
def doubled(value: Any) -> Any:
    """Return twice the value."""
    return value + value


def read_slowly(file: Any) -> Any:
    """Read an index, and leave time for another process to do the same before it is written."""
    index = READ(file)
    time.sleep(0.1)
    return index


def meet() -> None:
    """Wait until two processes have reached this point."""
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    (folder / f"{os.getpid()}.met").touch()
    deadline = time.monotonic() + 60.0
    while len(list(folder.glob("*.met"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)


def call(value: Any) -> None:
    """Call the kernel in both processes at about the same time."""
    IndexDataCacheFile._load_index = read_slowly
    meet()
    doubled(value)


def different() -> list[Callable[[], None]]:
    """Return calls with different types."""
    return [partial(call, value) for value in VALUES]


def equal() -> list[Callable[[], None]]:
    """Return calls with the same type."""
    return [partial(call, 1.0)] * 4


def failing() -> list[Callable[[], None]]:
    """Return a part that fails, between others."""
    return [partial(call, 1.0), partial(int, "no number"), partial(call, 1.0)]


def endless() -> list[Callable[[], None]]:
    """Return a part that lasts longer than any test."""
    return [partial(time.sleep, 1000)]
