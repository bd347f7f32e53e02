"""A kernel cache that several processes fill at the same time."""

import fcntl
import hashlib
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache

MAX_WAIT_SECONDS = 60.0
"""Longest time to wait until another process has compiled a kernel [s]; a kernel takes at most 20 s."""

POLL_SECONDS = 0.01
"""Interval at which a waiting process tries to lock the file again [s]."""


def share_cache(folder: Path) -> Callable[[], None]:
    """Let this process share numba's cache with other processes that pass the same folder.

    Before a process compiles a kernel for a combination of types, it locks a file in ``folder``. Other processes wait,
    and then load the kernel instead of compiling it again. Only one process at a time adds to an index: numba rewrites
    the whole index of a function for each new combination of types, so if two processes
    added entries at once, an entry would be lost, or both would name the same file.

    Args:
        folder: an existing folder for the lock files.

    Returns:
        A function that releases the locks of kernels whose compilation has failed.
    """
    claims: dict[Path, int] = {}
    caches: Any = FunctionCache
    load, save = caches.load_overload, caches.save_overload

    def load_or_claim(cache: Any, types: Any, context: Any) -> Any:
        claim = folder / _lock_name(cache, types)
        loaded = load(cache, types, context)
        if loaded is not None or claim in claims:
            return loaded
        descriptor = os.open(claim, os.O_CREAT | os.O_RDWR)
        if not _lock_in_time(descriptor):
            os.close(descriptor)
            return None
        loaded = load(cache, types, context)
        if loaded is None:
            claims[claim] = descriptor
        else:
            os.close(descriptor)
        return loaded

    def save_and_release(cache: Any, types: Any, data: Any) -> None:
        with _locked(folder / _lock_name(cache, "index")):
            save(cache, types, data)
        if descriptor := claims.pop(folder / _lock_name(cache, types), None):
            os.close(descriptor)

    def release() -> None:
        while claims:
            os.close(claims.popitem()[1])

    caches.load_overload, caches.save_overload = load_or_claim, save_and_release
    return release


def _lock_name(cache: Any, types: Any) -> str:
    """Return the name of the lock file of a kernel, or of the index of its function."""
    return hashlib.sha256(f"{cache._cache_file._index_path} {types}".encode()).hexdigest()


def _lock_in_time(descriptor: int) -> bool:
    """Lock a file; return False if another process holds the lock for ``MAX_WAIT_SECONDS``."""
    deadline = time.monotonic() + MAX_WAIT_SECONDS
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > deadline:
                return False
            time.sleep(POLL_SECONDS)
        else:
            return True


@contextmanager
def _locked(file: Path) -> Iterator[None]:
    """Hold the lock of a file, which is created if missing."""
    descriptor = os.open(file, os.O_CREAT | os.O_RDWR)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
