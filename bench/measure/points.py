"""Combine the measurements of a point from several passes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace

from ...problems.arrays import FloatArray
from ..store.fields import Quartiles
from ..store.impulses import number_of, worst
from ..store.outcome import Outcome
from ..store.records import MAX_ANSWERS, Measured, Point, Round

_RANKS, _OTHER_RANK = {Outcome.SOLVED: 0, Outcome.RELAXED: 1, Outcome.WRONG: 3}, 2
"""Ranks of outcomes from good to bad, and the rank of all other outcomes."""


def keep_finest_impulses(points: Sequence[Point]) -> list[Point]:
    """Return the points of a case, of which only the finest measured point keeps its impulses."""
    finest = max((level for level, point in enumerate(points) if point.measured is not None), default=-1)
    return [
        point
        if level == finest or point.measured is None or not point.measured.impulses
        else replace(point, measured=replace(point.measured, impulses=[]))
        for level, point in enumerate(points)
    ]


def joined(before: Point, now: Point) -> Point:
    """Return a point with the rounds of two passes, the worse outcome with its reason, and the worse answer.

    If the rounds of only one pass reached the time limit under load (``is_late_under_load``), the other one determines
    outcome and answer, and the times are those of both.
    """
    if before.measured is None or now.measured is None:
        return now if now.measured is not None else before
    if before.is_late_under_load is not now.is_late_under_load:
        decisive, measured = (now, now.measured) if before.is_late_under_load else (before, before.measured)
        rounds = [*before.rounds, *now.rounds]
        return replace(decisive, measured=replace(measured, **times_from_rounds(rounds), rounds=rounds))
    rank_before, rank_now = (_RANKS.get(point.outcome, _OTHER_RANK) for point in (before, now))
    worse = before if rank_before >= rank_now else now
    return replace(worse, measured=_joined(before.measured, now.measured))


def _joined(before: Measured, now: Measured) -> Measured:
    """Return the measurements of two passes together, with the worse answer."""
    rounds = [*before.rounds, *now.rounds]
    worse = before if number_of(before.residual) >= number_of(now.residual) else now
    hashes = list(dict.fromkeys([*before.hashes, *now.hashes]))[:MAX_ANSWERS]
    errors = [measured.impulse_error for measured in (before, now) if measured.impulse_error is not None]
    return replace(
        worse,
        observed=before.observed or now.observed,
        model_residual=max(before.model_residual, now.model_residual, key=number_of),
        **times_from_rounds(rounds),
        rounds=rounds,
        first_seconds=[*before.first_seconds, *now.first_seconds],
        first_repeated_seconds=[*before.first_repeated_seconds, *now.first_repeated_seconds],
        copy_seconds=[*before.copy_seconds, *now.copy_seconds],
        copy_repeated_seconds=[*before.copy_repeated_seconds, *now.copy_repeated_seconds],
        answers=len(hashes),
        hashes=hashes,
        impulses=worst([*before.impulses, *now.impulses]) if before.impulses else [],
        impulse_error=max(errors, default=None),
    )


def times_from_rounds(rounds: Sequence[Round]) -> dict[str, Any]:
    """Return the fields of a point that follow from its rounds; times use excluded rounds only if all are excluded."""
    used_rounds = [timed for timed in rounds if not timed.excluded] or rounds
    columns = {
        "prepare_seconds": [timed.prepare_seconds for timed in used_rounds],
        "solve_seconds": [timed.solve_seconds for timed in used_rounds],
        "total_seconds": [timed.total_seconds.median for timed in used_rounds],
        "processor_seconds": [timed.processor_seconds / timed.repeats for timed in used_rounds],
    }
    return {
        **{name: quartiles(np.array(values)) for name, values in columns.items()},
        "repeats": sum(timed.repeats for timed in rounds),
        "is_excluded": all(timed.excluded for timed in rounds),
    }


def quartiles(values: FloatArray) -> Quartiles:
    """Return the minimum, first quartile, median and third quartile of times [s], shape (n,)."""
    low, first, median, third = map(float, np.quantile(values, (0.0, 0.25, 0.5, 0.75)))
    return Quartiles(min=low, q1=first, median=median, q3=third)
