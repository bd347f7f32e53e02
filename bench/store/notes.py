"""What a reader must know about the numbers of a point beside them, in short sentences."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from .impulses import number_of
from .outcome import ROUNDING
from .records import MAX_ANSWERS, CaseRecord, Measured, Point

SHARE = 0.05
"""Part by which first solves may be slower than repeated ones."""

ALLOWANCE_SECONDS = 2e-5
"""What a first solve may take beyond that [s]: branches and pages that only repetition makes familiar."""

COPY_RATIO = 1.25
"""Ratio of the least time on copies to the time on the problem that their differences explain."""

LOCAL_RATIO = 100.0
"""Ratio of the local to the judged residual from which on the fastest contacts hide what the others still lack."""


def hides_contacts(judged: FloatArray | float, local: FloatArray | float) -> NDArray[np.bool_]:
    """Return whether local residuals exceed judged ones so far that fast contacts hide the others."""
    return np.greater(local, np.maximum(ROUNDING, np.multiply(LOCAL_RATIO, judged)))


def is_explained_by_repetition(repeated: float, first: float) -> bool:
    """Return whether a first solve [s] is as slow against repeated ones [s] as repetition alone makes it."""
    return first <= (1.0 + SHARE) * repeated + ALLOWANCE_SECONDS


def notes_of(case: CaseRecord, point: Point) -> str:
    """Return notes about a point, separated by semicolons; empty if there are none."""
    return "" if point.measured is None else "; ".join(_notes(case, point.measured))


def _notes(case: CaseRecord, measured: Measured) -> Iterator[str]:
    judged, local = number_of(measured.residual), number_of(measured.verdict.get("local_residual", 0.0))
    if hides_contacts(judged, local):
        times = f"{local / judged:.2g} times the judged one" if judged > 0.0 else f"{local:.2g}, the judged one 0"
        yield f"the local residual is {times}"
    if measured.answers > 1 and not case.is_randomised:
        least = "at least " if measured.answers == MAX_ANSWERS else ""
        yield f"{least}{measured.answers} different answers in {measured.repeats} solves"
    seconds = measured.total_seconds.median
    if measured.first_seconds and not measured.is_excluded:
        first = float(np.median(measured.first_seconds))
        if not is_explained_by_repetition(seconds, first):
            yield f"first solves take {first / seconds:.2f} times as long"
    if measured.copy_seconds and not measured.is_excluded:
        copy = min(measured.copy_seconds)
        if copy > COPY_RATIO * seconds + ALLOWANCE_SECONDS:
            yield f"copies of the problem take {copy / seconds:.2g} times as long"
