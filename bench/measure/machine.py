"""Describe the machine, the versions and the source of a run."""

import contextlib
import hashlib
import os
import platform
import subprocess
from collections.abc import Set
from importlib import metadata
from pathlib import Path

import msgspec
import psutil
from threadpoolctl import threadpool_info

from ..store.records import Machine, ThreadPool

PACKAGES = (
    *("proxbench", "numpy", "scipy", "numba", "llvmlite", "clarabel", "cvxpy", "osqp", "pandas"),
    *("mujoco", "pin", "proxsuite", "scs", "newton", "warp-lang", "coal"),
)
"""Packages whose versions are stored, if they are installed."""

SETTINGS = ("NUMBA_DISABLE_JIT", "NUMBA_OPT", "PYTHONDEVMODE", "PYTHONMALLOC", "PYTHONTRACEMALLOC", "LD_PRELOAD")
"""Environment variables that change the times of solvers by different factors."""


def this_machine() -> Machine:
    """Return the record of this machine."""
    return Machine(
        processor=_processor(),
        cores=psutil.cpu_count(logical=False) or os.cpu_count() or 1,
        logical_cores=os.cpu_count() or 1,
        memory_bytes=psutil.virtual_memory().total,
        system=f"{platform.system()} {platform.release()} {platform.machine()}",
        python=platform.python_version(),
        versions={name: version for name in PACKAGES if (version := _version(name))},
        settings={name: os.environ[name] for name in SETTINGS if os.environ.get(name)},
        thread_pools=[msgspec.convert(pool, ThreadPool) for pool in threadpool_info()],
        commit=_git("rev-parse", "HEAD"),
        dirty=bool(_git("status", "--porcelain", "--", ":/", ":(exclude,top)results")),  # results are not code
        source=_source_digest(),
        host=platform.node(),
    )


def busy_seconds(except_cores: Set[int]) -> float:
    """Return the busy time of all cores but ``except_cores`` since the system started [s].

    The result is 0 if ``except_cores`` is empty, because a process that is not pinned may run on any core.
    """
    if not except_cores:
        return 0.0
    times_of_others = [
        times for number, times in enumerate(psutil.cpu_times(percpu=True)) if number not in except_cores
    ]
    # user to steal; guest times, which follow on Linux, are part of the user times
    return float(sum(sum(times[:8]) - times.idle - getattr(times, "iowait", 0.0) for times in times_of_others))


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _processor() -> str:
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return platform.processor() or platform.machine()


def _source_digest() -> str:
    """Return the SHA-256 of the names and contents of the source files of this package."""
    package, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    for file in sorted(path for part in ("problems", "solvers", "bench") for path in (package / part).rglob("*.py")):
        digest.update(f"{file.relative_to(package)}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()


def _git(*arguments: str) -> str:
    """Return the output of a git command in the folder of this source; empty outside a checkout."""
    try:
        process = subprocess.run(
            ["git", "--no-optional-locks", "-C", str(Path(__file__).resolve().parent), *arguments],
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return process.stdout.strip()
