"""The machine, the versions and the state of the source that a run was measured with, and how steady the machine is."""

import hashlib
import os
import platform
import subprocess
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import psutil
from threadpoolctl import threadpool_info

from ..store.records import Machine

FLOORS = ("problems", "solvers", "bench")
"""Folders of the package."""

PACKAGES = ("proxbench", "numpy", "scipy", "numba", "llvmlite", "clarabel", "cvxpy", "osqp", "pandas")


def describe_machine() -> dict[str, Any]:
    """Return processor, memory, system, libraries, versions, commit and load as plain values."""
    return {
        "processor": _processor(),
        "cores": psutil.cpu_count(logical=False) or os.cpu_count(),
        "logical_cores": os.cpu_count(),
        "memory_bytes": psutil.virtual_memory().total,
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {name: _version(name) for name in PACKAGES},
        "thread_pools": [
            {key: pool.get(key) for key in ("user_api", "internal_api", "version", "num_threads")}
            for pool in threadpool_info()
        ],
        "commit": _git("rev-parse", "HEAD"),
        "dirty": bool(_git("status", "--porcelain", "--", ":/", ":(exclude,top)results")),  # results are not code
        "source": _source(),
        "host": platform.node(),
        "load": list(os.getloadavg()),
    }


def this_machine() -> Machine:
    """Return the machine as it is stored."""
    return msgspec.convert(describe_machine(), Machine)


def calibration_seconds() -> float:
    """Return the time of a fixed workload [s], the least of five: dense products and a strided sum, single-threaded.

    Its spread over a run is the drift of the machine.
    """
    matrix = np.random.default_rng(0).normal(size=(120, 120))
    vector = np.arange(400_000, dtype=np.float64)
    times = []
    for _ in range(5):
        began = time.perf_counter()
        for _ in range(20):
            np.einsum("ij,jk->ik", matrix[:60, :60], matrix[:60, :60])
            float(vector[::7].sum())
        times.append(time.perf_counter() - began)
    return min(times)


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _source() -> str:
    """Return the SHA-256 of the names and contents of the source files of this package."""
    package, digest = Path(__file__).resolve().parents[2], hashlib.sha256()
    for file in sorted(path for floor in FLOORS for path in (package / floor).rglob("*.py")):
        digest.update(f"{file.relative_to(package)}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()


def _git(*words: str) -> str:
    """Return the answer of git about the folder of this source, or nothing where it is not a checkout."""
    try:
        done = subprocess.run(
            ["git", "-C", str(Path(__file__).resolve().parent), *words],
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()
