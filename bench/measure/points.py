"""Points of a ladder that are measured in several passes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace

from ...problems.arrays import FloatArray
from ..store.impulses import number_of, worst
from ..store.outcome import Outcome
from ..store.records import MOST_ANSWERS, Measured, Point, Quartiles, Round

_RANKS = {Outcome.SOLVED: 0, Outcome.RELAXED: 1, Outcome.WRONG: 3}
"""Outcomes from good to bad; the others stand between being relaxed and being wrong."""


def with_impulses_at_the_finest(points: Sequence[Point]) -> list[Point]:
    """Return the points of a case, of which only the finest measured one keeps its impulses."""
    finest = max((level for level, point in enumerate(points) if point.measured is not None), default=-1)
    return [
        point
        if level == finest or point.measured is None or not point.measured.impulses
        else replace(point, measured=replace(point.measured, impulses=[]))
        for level, point in enumerate(points)
    ]


def marked(rounds: Sequence[Round]) -> list[Round]:
    """Return rounds with the disturbed ones marked as marred.

    A solver all of whose rounds waited does so by itself, and none of them is marred.
    """
    are_own_waits = all(one.is_disturbed for one in rounds)
    return [replace(one, is_marred=one.is_disturbed and not are_own_waits) for one in rounds]


def marked_together(points: Sequence[Point]) -> list[Point]:
    """Return the points of a case with their disturbed rounds marked, also where all rounds of a point are.

    A solver waits by itself if all rounds of all its points on a problem waited, and else other programs were at work.
    """
    if all(one.is_disturbed for point in points for one in point.rounds):
        return list(points)
    return [
        replace(point, measured=replace(point.measured, rounds=[_marked(one) for one in point.rounds]))
        if point.measured is not None and any(one.is_disturbed is not one.is_marred for one in point.rounds)
        else point
        for point in points
    ]


def _marked(one: Round) -> Round:
    return replace(one, is_marred=one.is_disturbed)


def joined(before: Point, now: Point) -> Point:
    """Return a point of the rounds of both; the worse outcome with its reason counts, and the worse answer.

    A limit of time that was reached while other programs disturbed is forgotten once a round was not disturbed.
    """
    if before.measured is None or now.measured is None:
        return now if now.measured is not None else before
    if before.is_marred is not now.is_marred:
        kept, measured = (now, now.measured) if before.is_marred else (before, before.measured)
        rounds = marked([*before.rounds, *now.rounds])
        return replace(kept, measured=replace(measured, **times_of(rounds), rounds=rounds))
    worse = before if _rank(before) >= _rank(now) else now
    return replace(worse, measured=_joined(before.measured, now.measured))


def _rank(point: Point) -> int:
    return _RANKS.get(point.outcome, 2)


def _joined(before: Measured, now: Measured) -> Measured:
    rounds = marked([*before.rounds, *now.rounds])
    worse = before if number_of(before.residual) >= number_of(now.residual) else now
    hashes = list(dict.fromkeys([*before.hashes, *now.hashes]))[:MOST_ANSWERS]
    errors = [one.impulse_error for one in (before, now) if one.impulse_error is not None]
    return replace(
        worse,
        iterations=before.iterations,
        claimed_iterations=before.claimed_iterations,
        model_residual=max(before.model_residual, now.model_residual, key=number_of),
        **times_of(rounds),
        rounds=rounds,
        first_seconds=before.first_seconds if now.first_seconds is None else now.first_seconds,
        answers=len(hashes),
        hashes=hashes,
        impulses=worst([*before.impulses, *now.impulses]) if before.impulses else [],
        impulse_error=max(errors, default=None),
    )


def times_of(rounds: Sequence[Round]) -> dict[str, Any]:
    """Return times and repeats of a point from its rounds; marred ones count only where there are no others."""
    counted = [one for one in rounds if not one.is_marred] or rounds
    names = ("prepare_seconds", "solve_seconds", "total_seconds")
    times = {name: quartiles(np.array([getattr(one, name) for one in counted])) for name in names}
    return {**times, "repeats": sum(one.repeats for one in rounds)}


def quartiles(values: FloatArray) -> Quartiles:
    """Return least, quartiles and median of times [s]."""
    low, first, median, third = map(float, np.quantile(values, (0.0, 0.25, 0.5, 0.75)))
    return Quartiles(min=low, q1=first, median=median, q3=third)
