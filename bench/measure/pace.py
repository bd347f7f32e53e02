"""How fast a core works at this moment: what shares its hardware shows in a short piece of fixed work, a probe.

Where two hardware threads share a core, or two virtual machines do, most programs take up to twice as long while the
other one works, for stretches of less than 1 ms to seconds. The processor time that the system counts for a process
does not show that. A probe does what solvers do beside arithmetic: it makes objects, calls functions, sorts and
converts, all from a footprint of code as large as theirs.

The slowness of a moment is the time of a probe over that of probes on a free core. A solve that takes t between two
probes of slowness p, in a process whose probes have the mean slowness q, is taken to meet

    s = w p + (1 - w) q,    w = MOMENT / (MOMENT + t):

what surrounds a short solve is what it meets, and a long one meets free and shared moments as they come. Of its time t,
in which the processor worked for b, it would have taken t - b (1 - 1/s) on a free core.
"""

from functools import cache
from time import perf_counter

import numpy as np

from ...problems.arrays import FloatArray

PROBE_STEPS = 15
"""Steps of a probe, about 10 µs."""

MOMENT = 0.01
"""Time for which a core mostly stays free or shared [s]."""

SEARCH = 1.0
"""Time of the probes of which the fastest ones tell what a free core is [s]."""

FREE_SHARE = 0.01
"""Share of these probes that are taken to have met a free core."""


class _Thing:
    """What a probe makes."""

    def __init__(self, number: int, names: dict[str, int]) -> None:
        self.number, self.names = number, names


def probe_seconds() -> float:
    """Return the time of a probe [s]: of two, the second one, which finds what it needs in the caches."""
    _probe()
    return _probe()


@cache
def free_probe_seconds() -> float:
    """Return the time of a probe on a free core [s], as far as ``SEARCH`` of probes have met one, once."""
    end, found = perf_counter() + SEARCH, [probe_seconds()]
    while perf_counter() < end:
        found.append(probe_seconds())
    return float(np.quantile(found, FREE_SHARE))


def slowness(around: FloatArray, mean: float, seconds: FloatArray) -> FloatArray:
    """Return the slowness that solves met, shape (n,).

    Args:
        around: of the moments before and after each, shape (n,).
        mean: of all moments of its process.
        seconds: of each, as its clock counted them [s], shape (n,).
    """
    weight = MOMENT / (MOMENT + seconds)
    return weight * around + (1.0 - weight) * mean


def free_share(seconds: FloatArray, work: FloatArray, met: FloatArray) -> FloatArray:
    """Return the share of the seconds of solves that is left on a free core, shape (n,): only work becomes faster.

    Args:
        seconds: of each solve, shape (n,).
        work: processor seconds of each, shape (n,).
        met: slowness that each met, shape (n,).
    """
    worked = np.minimum(work / np.maximum(seconds, np.finfo(float).tiny), 1.0)
    share: FloatArray = 1.0 - worked * (1.0 - 1.0 / met)
    return share


def _probe() -> float:
    began = perf_counter()
    for number in range(PROBE_STEPS):
        thing = _Thing(number, {"number": number})
        values = [thing.number, thing.names]
        str(number)
        tuple(values)
        sorted((3, 1, 2))
        isinstance(thing, _Thing)
    return perf_counter() - began
