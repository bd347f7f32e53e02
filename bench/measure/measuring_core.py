"""The processor core on which solves are timed, and the evidence of what else works on the machine.

A run claims one core. While solves are timed, the process of the case and this process are pinned to it, so that the
system moves other programs elsewhere, and another run on the same machine claims another core. Three readings tell
whether a round of solves had the core to itself:

* the solves themselves count context switches and processor seconds (``Round`` in ``store/records.py``);
* a *probe*, a fixed piece of work, is timed on the same core by this process, which runs no code of a plugin, before
  and after each round: it is slower where another hardware thread shares the core, or where the clock rate drops;
* the system counts how busy the *other* cores are, which are idle while this run alone works.

A reading can exclude a round, which is then measured again. None of them ever changes a time.
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
"""Objects in the part of a probe that makes and compares them."""

PROBE_NUMBERS = 50_000
"""Numbers in the part of a probe that streams over an array of 400 kB."""

FIRST_PROBES = 40
"""Probes that give the reference before the first round."""

CLAIM = "proxbench-core"
"""What names of claims begin with."""

REFERENCE_SHARE = 0.25
"""Quantile of all probes so far that is the reference: a core that is shared for half of the time still has it."""

MAX_PROBE_RATIO = 1.25
"""Ratio of a probe to the reference above which a core is not steady."""

MAX_PINNING = 10
"""Times that the threads of a process are pinned: one that is not pinned yet may start others."""


@dataclass
class MeasuringCore:
    """One core, claimed for this process until ``release``.

    Attributes:
        number: number of the core; None where the system offers no affinity, or where other runs claim every core.
        probes: seconds of all probes so far [s].
        busy_cores: how many other cores were busy on average while this one was last occupied.
    """

    number: int | None
    probes: list[float] = field(default_factory=list)
    busy_cores: float = 0.0
    _claim: socket.socket | None = None
    _numbers: np.ndarray[tuple[int], np.dtype[np.float64]] = field(default_factory=lambda: np.ones(PROBE_NUMBERS))

    @property
    def is_pinned(self) -> bool:
        """Whether processes are pinned to it."""
        return self.number is not None

    @staticmethod
    def claim() -> "MeasuringCore":
        """Return the highest core that this process may use and that no other run has claimed."""
        for number in sorted(_allowed_cores(), reverse=True):
            claim = _claim(number)
            if claim is not None:
                return MeasuringCore(number, _claim=claim)
        return MeasuringCore(None)

    def release(self) -> None:
        """Let another run claim the core."""
        if self._claim is not None:
            self._claim.close()
            self._claim = None

    @contextlib.contextmanager
    def occupied(self) -> Iterator[None]:
        """Pin the calling thread to the core, and count how busy the other cores are meanwhile."""
        before = _allowed_cores()
        if self.number is not None:
            os.sched_setaffinity(0, {self.number})
        try:
            while len(self.probes) < FIRST_PROBES:
                self.probe()
            busy, began = busy_seconds(self.number), perf_counter()
            yield
            self.busy_cores = max(busy_seconds(self.number) - busy, 0.0) / max(perf_counter() - began, 1e-3)
        finally:
            if self.number is not None:
                os.sched_setaffinity(0, before)

    def pin(self, process: int) -> None:
        """Pin all threads of a process and its descendants to the core; again, as long as others started meanwhile."""
        if self.number is None:
            return
        for _ in range(MAX_PINNING):
            for thread in [thread for one in (process, *descendants(process)) for thread in threads(one)]:
                with contextlib.suppress(OSError):  # a thread that has ended
                    os.sched_setaffinity(thread, {self.number})
            if self.holds(process):
                return

    def holds(self, process: int) -> bool:
        """Return whether all threads of a process are still pinned to the core."""
        if self.number is None:
            return True
        try:
            return all(os.sched_getaffinity(thread) == {self.number} for thread in threads(process))
        except OSError:
            return True

    def probe(self) -> float:
        """Return the seconds that a fixed piece of work takes now [s]; of two in a row the second, with warm caches."""
        self._work()
        self.probes.append(self._work())
        return self.probes[-1]

    @property
    def reference(self) -> float:
        """Seconds of a probe on a steady core, as far as this process has met one [s]."""
        return float(np.quantile(self.probes, REFERENCE_SHARE))

    def is_steady(self, *probes: float) -> bool:
        """Return whether probes [s] took about as long as the reference; always True without a claimed core."""
        return self.number is None or max(probes) <= MAX_PROBE_RATIO * self.reference

    def _work(self) -> float:
        began = perf_counter()
        sorted(map(str, range(PROBE_OBJECTS)))
        float((1.5 * self._numbers).sum())
        return perf_counter() - began


def _allowed_cores() -> set[int]:
    """Return the cores that the calling thread may use; none where the system does not say."""
    return set(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else set()


def _claim(number: int) -> socket.socket | None:
    """Return what holds the claim to a core until it is closed or this process ends; None if another run has it.

    It is a socket with a name that exists in memory alone, so that no file is left behind.
    """
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        claim.bind(f"\0{CLAIM}-{number}")
    except OSError:
        claim.close()
        return None
    return claim
