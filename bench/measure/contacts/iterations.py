"""Iterations that a solver reports, compared with the iterates that it shows to an observer."""

from typing import Any

from ...store.records import Measured, ObservedSolve


def contradicting_solve(answer: dict[str, Any]) -> ObservedSolve | None:
    """Return the counts of an observed solve; None if they are equal or invalid, or if it shows no iterates."""
    calls, claimed = answer.get("calls"), answer.get("claimed")
    if type(calls) is not int or type(claimed) is not int or min(calls, claimed) < 0 or calls in (0, claimed):
        return None
    return ObservedSolve(observed_iterates=calls, observed_iterations=claimed)


def is_contradicted(measured: Measured | None) -> bool:
    """Return whether stored measurements say that the solver shows another number of iterates than it reports."""
    return measured is not None and (measured.observed is not None or measured.claimed_iterations is not None)


def iteration_fields(reported: int, observed: ObservedSolve | None) -> dict[str, Any]:
    """Return the fields of a point about iterations; both counts are whole, never scaled.

    A solver that shows more iterates than it reports iterations makes more iterations, so the iterates count. A solver
    that shows fewer may leave some out, so the iterations that it reports count.

    Args:
        reported: iterations of a timed solve as the solver reports them.
        observed: an observed solve to the same tolerance that contradicts itself; None without contradiction.
    """
    shows_more = observed is not None and observed.observed_iterates > max(observed.observed_iterations, reported)
    if observed is None or not shows_more:
        return {"iterations": reported, "claimed_iterations": None, "observed": observed}
    return {"iterations": observed.observed_iterates, "claimed_iterations": reported, "observed": observed}
