"""Notes about points: short sentences that tables print with the numbers."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.representation import counted
from .impulses import number_of
from .outcome import ROUNDING, Outcome
from .records import MAX_ANSWERS, CaseRecord, Measured, Point

EXPLAINED_RATIO = 1.25
"""Largest ratio of two times of the same work that the speed of a core explains, if the core counts as steady."""

ALLOWANCE_SECONDS = 2e-5
"""Additional time that a first solve may take [s], for branches and memory pages not used before."""

MIN_NOTED = 3
"""Least number of undisturbed first solves, or of undisturbed copies, for a note."""

LOCAL_RATIO = 100.0
"""Ratio of the local to the judged residual above which fast contacts hide the violations of other contacts."""


def hides_contacts(judged: FloatArray | float, local: FloatArray | float) -> NDArray[np.bool_]:
    """Return whether fast contacts hide the violations of other contacts: local residuals far exceed judged ones."""
    return np.greater(local, np.maximum(ROUNDING, np.multiply(LOCAL_RATIO, judged)))


def is_explained(repeated: float, first: float) -> bool:
    """Return whether the machine explains the time of a first solve [s], given that of repeated ones [s]."""
    return first <= EXPLAINED_RATIO * repeated + ALLOWANCE_SECONDS


def notes_of(case: CaseRecord, point: Point) -> str:
    """Return the notes about a point, separated by semicolons; empty if there are none."""
    return "" if point.measured is None else "; ".join(_notes(case, point, point.measured))


def _notes(case: CaseRecord, point: Point, measured: Measured) -> Iterator[str]:
    """Yield the notes about a measured point."""
    if measured.is_excluded and Outcome.TIME_LIMIT in (point.outcome, point.status):
        yield "the time limit was reached while other programs used the core"
    if any(timed.uncounted_seconds for timed in measured.rounds):
        yield "times are those of one call of the library, without preparation"
    judged, local = number_of(measured.residual), number_of(measured.verdict.get("local_residual", 0.0))
    if hides_contacts(judged, local):
        size = f"{local / judged:.2g} times the judged one" if judged > 0.0 else f"{local:.2g}, the judged one 0"
        yield f"the local residual is {size}"
    if measured.observed is not None:
        iterates, iterations = measured.observed.observed_iterates, measured.observed.observed_iterations
        yield f"it reports {counted(iterations, 'iteration')} of a solve that shows {counted(iterates, 'iterate')}"
    elif measured.claimed_iterations is not None:
        yield f"it reports {counted(measured.claimed_iterations, 'iteration')}, which an observed solve contradicts"
    if measured.answers > 1 and not case.is_randomised:
        prefix = "at least " if measured.answers == MAX_ANSWERS else ""
        yield f"{prefix}{measured.answers} different answers in {measured.repeats} solves"
    for name, seconds, repeated_seconds in (
        ("first solves", measured.first_seconds, measured.first_repeated_seconds),
        ("copies of the problem", measured.copy_seconds, measured.copy_repeated_seconds),
    ):
        if (ratio := _least_ratio(measured, seconds, repeated_seconds)) is not None:
            yield f"{name} take at least {ratio:.2g} times as long as repeated ones"


def _least_ratio(measured: Measured, seconds: list[float], repeated_seconds: list[float]) -> float | None:
    """Return the ratio of the fastest of several first solves to the slowest repeated solve.

    Excluded rounds count as repeated solves, because they show how slow the machine was at times. Return None if there
    are too few first solves, or if the machine explains the ratio.
    """
    if min(len(seconds), len(repeated_seconds)) < MIN_NOTED:
        return None
    excluded = [timed.total_seconds.median for timed in measured.rounds if timed.excluded]
    fastest, repeated = min(seconds), max(measured.total_seconds.median, *repeated_seconds, *excluded)
    return None if is_explained(repeated, fastest) else fastest / repeated
