"""The processor core on which solves are timed, and measurements of the load of the machine.

A run claims one core; another run on the same machine claims another one. While solves are timed, the process of the
case and this process are pinned to the core, so that the system moves other programs elsewhere. Three measurements
show whether other programs disturbed a round of solves:

* context switches and processor time of the solves (``Round`` in ``store/records.py``);
* a *probe*: before and after each round, this process, which runs no code of a plugin, times a fixed computation on
  the same core. The computation takes longer if another hardware thread shares the core, or if the clock rate drops;
* the load of the *other* cores, which are idle if only this run is active.

A disturbed round is excluded and measured again. Measured times are never corrected.

A solver with several threads is pinned to this core and to one more for each further thread. The further cores are not
claimed, so a run with several threads can disturb any other run on the machine. The load does not include other
programs on these further cores.
"""

import contextlib
import os
import socket
from collections.abc import Iterator
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from ..isolation.process_tree import descendants, threads
from .machine import busy_seconds

PROBE_OBJECTS = 1000
"""Number of objects that a probe creates and compares."""

PROBE_NUMBERS = 50_000
"""Number of values in the array of 400 kB that a probe sums."""

FIRST_PROBES = 40
"""Least number of probes before the first round, from which the reference is first estimated."""

CLAIM = "proxbench-core"
"""Prefix of the names of the sockets that claim cores."""

REFERENCE_QUANTILE = 0.25
"""Quantile of all probes that is the reference; it is unaffected if the core is shared for half of the time."""

MAX_PROBE_RATIO = 1.25
"""Ratio of a probe to the reference above which a core is not steady."""

MAX_PINNING_ATTEMPTS = 10
"""Largest number of attempts to pin all threads of a process, because unpinned threads may start others."""


@dataclass
class MeasuringCore:
    """One core, claimed for this process until ``release``.

    Attributes:
        number: number of the core; None if the system does not support affinity, or other runs have claimed every core.
        probes: wall times of all probes [s].
        allowed: numbers of the cores that this process may use.
        busy_cores: mean number of other cores that were busy while the calling thread was last pinned to this one.
    """

    number: int | None
    probes: list[float] = field(default_factory=list)
    allowed: frozenset[int] = frozenset()
    busy_cores: float = 0.0
    _claim: socket.socket | None = None
    _probe_array: np.ndarray[tuple[int], np.dtype[np.float64]] = field(default_factory=lambda: np.ones(PROBE_NUMBERS))

    @staticmethod
    def claim() -> "MeasuringCore":
        """Claim the highest-numbered core that this process may use and no other run has claimed."""
        allowed = frozenset(_allowed_cores())
        for number in sorted(allowed, reverse=True):
            claim = _claim_socket(number)
            if claim is not None:
                return MeasuringCore(number, allowed=allowed, _claim=claim)
        return MeasuringCore(None)

    def release(self) -> None:
        """Release the claim, so that another run can claim the core."""
        if self._claim is not None:
            self._claim.close()
            self._claim = None

    @contextlib.contextmanager
    def pinned(self, count: int = 1) -> Iterator[None]:
        """Pin the calling thread to the core, and measure the load of all except the ``count`` cores of solvers."""
        solver_cores = set[int]() if self.number is None else self.cores(count)
        before = _allowed_cores()
        if self.number is not None:
            os.sched_setaffinity(0, {self.number})
        try:
            while len(self.probes) < FIRST_PROBES:
                self.probe()
            busy, began = busy_seconds(solver_cores), perf_counter()
            yield
            self.busy_cores = max(busy_seconds(solver_cores) - busy, 0.0) / max(perf_counter() - began, 1e-3)
        finally:
            if self.number is not None:
                os.sched_setaffinity(0, before)

    def cores(self, count: int) -> set[int]:
        """Return at most ``count`` cores: this one, and the highest-numbered others that this process may use."""
        others = sorted(self.allowed - {self.number}, reverse=True)[: count - 1]
        return set(others) if self.number is None else {self.number, *others}

    def pin(self, process: int, count: int = 1) -> None:
        """Pin all threads of a process and its descendants to ``count`` cores; repeat while new ones start."""
        if self.number is None:
            return
        cores = self.cores(count)
        for _ in range(MAX_PINNING_ATTEMPTS):
            processes = (process, *descendants(process))
            for member in processes:
                for thread in threads(member):
                    with contextlib.suppress(OSError):  # the thread has ended
                        os.sched_setaffinity(thread, cores)
            if all(self.has_pinned(member, count) for member in processes):
                return

    def has_pinned(self, process: int, count: int = 1) -> bool:
        """Return whether all threads of a process are still pinned to ``count`` cores; True without a claimed core."""
        if self.number is None:
            return True
        cores = self.cores(count)
        try:
            return all(os.sched_getaffinity(thread) == cores for thread in threads(process))
        except OSError:
            return True

    def probe(self) -> float:
        """Run a fixed computation twice; return the wall time of the second run, with warm caches [s]."""
        self._run_probe()
        self.probes.append(self._run_probe())
        return self.probes[-1]

    @property
    def reference(self) -> float:
        """Wall time of a probe on a steady core, estimated from all probes [s]."""
        return float(np.quantile(self.probes, REFERENCE_QUANTILE))

    def is_steady(self, *probes: float) -> bool:
        """Return whether wall times of probes [s] are close to the reference; always True without a claimed core."""
        return self.number is None or max(probes) <= MAX_PROBE_RATIO * self.reference

    def _run_probe(self) -> float:
        """Run the fixed computation; return its wall time [s]."""
        began = perf_counter()
        sorted(map(str, range(PROBE_OBJECTS)))
        (1.5 * self._probe_array).sum()
        return perf_counter() - began


def _allowed_cores() -> set[int]:
    """Return the cores that the calling thread may use; an empty set if the system does not support affinity."""
    return set(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else set()


def _claim_socket(number: int) -> socket.socket | None:
    """Return a socket that claims a core until it is closed or this process ends; None if another run has claimed it.

    Its abstract name leaves no file behind.
    """
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        claim.bind(f"\0{CLAIM}-{number}")
    except OSError:
        claim.close()
        return None
    return claim
