"""Iterations that a solver reports, compared with the iterates that it shows to an observer."""

from typing import Any

from ...store.records import Point


def stored_contradiction(point: Point) -> tuple[int, int] | None:
    """Return the observed and the claimed iterations of a stored point; None if they agree."""
    measured = point.measured
    if measured is None or measured.claimed_iterations is None:
        return None
    return measured.iterations, measured.claimed_iterations


def observed_contradiction(answer: dict[str, Any]) -> tuple[int, int] | None:
    """Return the number of observer calls and the claimed iterations; None if equal or invalid, or without calls."""
    calls, claimed = answer.get("calls"), answer.get("claimed")
    if type(calls) is not int or type(claimed) is not int or min(calls, claimed) < 0 or calls in (0, claimed):
        return None
    return calls, claimed
