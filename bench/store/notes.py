"""Notes about points: short sentences that tables print beside the numbers."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from .impulses import number_of
from .outcome import ROUNDING, Outcome
from .records import MAX_ANSWERS, CaseRecord, Measured, Point

SHARE = 0.05
"""Relative slowdown of first solves that repetition explains."""

ALLOWANCE_SECONDS = 2e-5
"""Further time that a first solve may take [s], for branches and memory pages not used before."""

COPY_RATIO = 1.25
"""Ratio of the least time on copies of a problem to the time on the problem that their differences explain."""

LOCAL_RATIO = 100.0
"""Ratio of the local to the judged residual from which fast contacts hide the violations of the others."""


def hides_contacts(judged: FloatArray | float, local: FloatArray | float) -> NDArray[np.bool_]:
    """Return whether fast contacts hide the violations of others: the local residuals far exceed the judged ones."""
    return np.greater(local, np.maximum(ROUNDING, np.multiply(LOCAL_RATIO, judged)))


def is_explained_by_repetition(repeated: float, first: float) -> bool:
    """Return whether repetition alone explains the time of a first solve [s], given that of repeated ones [s]."""
    return first <= (1.0 + SHARE) * repeated + ALLOWANCE_SECONDS


def notes_of(case: CaseRecord, point: Point) -> str:
    """Return the notes about a point, separated by semicolons; empty if there are none."""
    return "" if point.measured is None else "; ".join(_notes(case, point, point.measured))


def _notes(case: CaseRecord, point: Point, measured: Measured) -> Iterator[str]:
    if measured.is_excluded and Outcome.TIME_LIMIT in (point.outcome, point.status):
        yield "the time limit was reached while other programs used the core"
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
