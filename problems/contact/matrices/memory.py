"""Checks that the available memory suffices for large arrays.

Without these checks, the system may kill the process, because it grants more memory than it has.
"""

import contextlib
import math
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from ...arrays import FloatArray
from ...errors import InsufficientMemoryError

SMALL_BYTES = 2**26
"""Size below which arrays are allocated without a check, because a check takes 0.1 ms [bytes]."""

_GROUPS = Path("/sys/fs/cgroup")

_VERSIONS = (
    (r"^0::/(.*)$", "", "memory.max", "memory.current"),
    (r"^\d+:(?:.*,)?memory(?:,.*)?:/(.*)$", "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
)
"""For versions 2 and 1 of control groups: pattern of the line that names a process's group, folder, and two files."""

_DROPPABLE = ("active_file", "inactive_file", "slab_reclaimable")
"""Entries of ``memory.stat`` for caches, which the system frees on demand."""


def require_memory(needed: float, purpose: str, remedy: str) -> None:
    """Raise ``InsufficientMemoryError`` if more bytes are needed than are available.

    Args:
        needed: memory that is needed in addition to the memory of this process [bytes].
        purpose: what the memory is needed for.
        remedy: what to do instead, as an imperative.
    """
    if needed < SMALL_BYTES:
        return
    available = available_bytes()
    if needed > available:
        raise InsufficientMemoryError(
            f"at least {_gigabytes(needed)} of memory is needed for {purpose}, but only {_gigabytes(available)} is "
            f"available; {remedy}."
        )


@contextlib.contextmanager
def named_allocation(purpose: str, remedy: str) -> Iterator[None]:
    """Raise ``InsufficientMemoryError`` if an allocation within the block fails.

    Args:
        purpose: what the memory is needed for.
        remedy: what to do instead, as an imperative.
    """
    try:
        yield
    except InsufficientMemoryError:
        raise
    except MemoryError as error:
        raise InsufficientMemoryError(
            f"{_gigabytes(available_bytes())} of available memory does not suffice for {purpose}; {remedy}."
        ) from error


def available_bytes() -> float:
    """Return the memory that this process can still use without swapping [bytes].

    The machine, control groups (containers) and the limit of the address space restrict it.
    """
    return max(min(_machine_bytes(), _group_bytes(), _address_bytes()), 0.0)


def to_dense(matrix: sp.csr_array, remedy: str) -> FloatArray:
    """Return G as a dense array [1/kg], shape (n_rows, n_rows).

    Args:
        matrix: G, sparse.
        remedy: what to do if memory is insufficient, as an imperative.

    Raises:
        InsufficientMemoryError: if the available memory does not suffice.
    """
    n_rows = matrix.shape[0]
    require_memory(8.0 * n_rows * n_rows, f"a dense G of {n_rows:,} rows", remedy)
    return np.asarray(matrix.toarray(), dtype=np.float64)


def _gigabytes(n_bytes: float) -> str:
    size = n_bytes / 1e9
    return f"{size:,.0f} GB" if size >= 10.0 else f"{size:.2g} GB"


def _machine_bytes() -> float:
    """Return the available memory of the machine, or its total memory if the system reports only that."""
    with contextlib.suppress(OSError):
        match = re.search(r"^MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text(), re.MULTILINE)
        if match:
            return 1024.0 * int(match[1])
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (OSError, ValueError, AttributeError):
        return math.inf


def _group_bytes() -> float:
    """Return the memory available in the tightest control group of this process; caches count as available."""
    try:
        groups = Path("/proc/self/cgroup").read_text()
    except OSError:
        return math.inf
    available = math.inf
    for pattern, folder, limit, usage in _VERSIONS:
        root, match = _GROUPS / folder, re.search(pattern, groups, re.MULTILINE)
        group = root / (match[1] if match else "")
        while group.is_relative_to(root):
            with contextlib.suppress(OSError, ValueError):  # no such group, or no limit
                used_bytes = int((group / usage).read_text()) - _droppable_bytes(group)
                available = min(available, float(int((group / limit).read_text()) - used_bytes))
            group = group.parent
    return available


def _droppable_bytes(group: Path) -> int:
    """Return the cache memory of a control group, which the system frees on demand."""
    droppable_sizes = re.findall(
        rf"^(?:{'|'.join(_DROPPABLE)}) (\d+)$", (group / "memory.stat").read_text(), re.MULTILINE
    )
    return sum(map(int, droppable_sizes))


def _address_bytes() -> float:
    """Return the memory available under the address space limit (``ulimit -v``), which measurements set."""
    try:
        import resource  # systems other than Unix have no such limit

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return math.inf if limit == resource.RLIM_INFINITY else float(limit - pages * resource.getpagesize())
    except (ImportError, OSError):
        return math.inf
