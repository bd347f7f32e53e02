"""When a projected iteration stops, and why.

The judge's residual is measured every few sweeps. One that no longer falls is no end: the largest violation may lie
still for a million sweeps, while an impulse travels through a stack, and fall then. So a solve goes on to its limits
unless nothing can come of it: Λ no longer changes at all, or rounding is all that the residual is made of (STALLED);
iterate ν equals iterate ν−2 to rounding but not ν−1 (OSCILLATING, the usual failure of Jacobi sweeps, which stay
bounded); the residual explodes, or ceases to be a number (DIVERGED).
"""

import bisect
from dataclasses import dataclass, field
from operator import itemgetter

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Solution, Status, Stop
from .clock import Clock

LONGEST_INTERVAL = 10
"""Most sweeps between two looks at the residual; a look costs about one sweep."""

GROWTH_OF_DIVERGENCE = 1e8
"""A residual this many times the first one (or 1, if that is larger) counts as divergence."""

PLATEAU_SWEEPS = 2000
"""No iteration is said to lack progress before this many sweeps."""

PLATEAU_PROGRESS = 0.9
"""Progress: the last three quarters of all sweeps have brought the best residual below this fraction."""

MARK = 0.99
"""A residual below this fraction of the lowest one before is noted, together with the sweep."""

CLEARLY_BETTER = 0.5
"""A residual below this fraction of another is clearly better, even where rounding is all that both are made of."""

CYCLE_PATIENCE = 20
"""Looks without progress after which iterates are compared with each other. Two comparisons in a row have to agree: an
iteration may keep more than Λ and move that for a while, and a safeguard may break a cycle."""

ROUNDING = 16 * np.finfo(np.float64).eps
"""Impulses that differ by less are equal to rounding, each relative to its largest value in the iterates compared."""


def sweeps_to_next_look(iteration: int) -> int:
    """Return how many sweeps to do before the residual is looked at again: few at first, then ``LONGEST_INTERVAL``."""
    return min(LONGEST_INTERVAL, 1 + iteration // 2)


@dataclass
class Monitor:
    """Follows the residual of one solve and says when to stop.

    Attributes:
        stop: the limits.
        best_residual: the lowest finite residual seen.
        best_impulses: the iterate that has it, None before the first; not to be written to after ``look``.
        clock: the time that is left.
    """

    stop: Stop
    best_residual: float = np.inf
    best_impulses: FloatArray | None = None
    clock: Clock = field(init=False)
    _first: float = np.inf
    _iteration: int = 0
    _looks_without_progress: int = 0
    _repeats: tuple[Status, FloatArray] | None = None
    _marks: list[tuple[int, float]] = field(default_factory=list)
    _next_proof: int = 0

    def __post_init__(self) -> None:
        self.clock = Clock(self.stop.max_seconds)

    def look(self, iteration: int, residual: float, impulses: FloatArray) -> tuple[Status, str] | None:
        """Note the residual after ``iteration`` sweeps; return status and reason if the solve is over."""
        if not self._marks:
            self._first = max(residual, 1.0) if residual < np.inf else 1.0
        self._iteration = iteration
        self._looks_without_progress += 1
        if residual < self.best_residual:
            if residual < MARK * self.best_residual:
                self._looks_without_progress = 0
            self.best_residual, self.best_impulses = residual, impulses
        if not self._marks or self.best_residual < MARK * self._marks[-1][1]:
            self._marks.append((iteration, self.best_residual))
        if residual <= self.stop.tolerance:
            return Status.SOLVED, ""
        if not residual < GROWTH_OF_DIVERGENCE * self._first:
            return Status.DIVERGED, f"the residual grew to {residual:.1e} within {iteration} sweeps"
        limit = self.clock.limit_met(self.stop, iteration)
        return (limit, f"residual {self.best_residual:.1e} after {iteration} sweeps") if limit else None

    @property
    def lacks_progress(self) -> bool:
        """Whether the last three quarters of the sweeps have done little: other methods may do more, patience too."""
        if self._iteration < PLATEAU_SWEEPS:
            return False
        return self.best_residual > PLATEAU_PROGRESS * self._best_at(self._iteration // 4)

    @property
    def may_be_proven(self) -> bool:
        """Whether it is time to find out whether rounding is all that is left; after each failure twice as late."""
        return self._iteration >= self._next_proof

    def prove(self, iteration: int, residual: float) -> None:
        """Hold the best iterate to ``residual``, which another arithmetic finds for it, for a proof that begins."""
        self.best_residual, self._next_proof = residual, 2 * iteration

    @property
    def suspects_cycle(self) -> bool:
        """Whether it is time to compare iterates with each other."""
        return self._looks_without_progress >= CYCLE_PATIENCE

    def restart_progress(self) -> None:
        """Count looks without progress from here on, because the iteration has just been changed."""
        self._looks_without_progress = 0

    def cycle(self, newest: FloatArray, previous: FloatArray, before: FloatArray) -> tuple[Status, str] | None:
        """Compare three successive iterates Λ^ν, Λ^(ν−1), Λ^(ν−2); return how it ended if they have come to repeat."""
        self.restart_progress()
        earlier, self._repeats = self._repeats, None
        rounding = ROUNDING * np.abs([newest, previous, before]).max(axis=0)
        if np.array_equal(newest, previous) and np.array_equal(newest, before):
            self._repeats = Status.STALLED, newest
            if earlier is not None and np.array_equal(newest, earlier[1]):
                return Status.STALLED, f"the impulses no longer change at residual {self.best_residual:.1e}"
        elif (np.abs(newest - before) <= rounding).all() and (np.abs(newest - previous) > rounding).any():
            self._repeats = Status.OSCILLATING, newest
            if earlier is not None and earlier[0] is Status.OSCILLATING:
                return Status.OSCILLATING, f"a cycle of two iterates, best residual {self.best_residual:.1e}"
        return None

    def solution(self, ended: tuple[Status, str], iterations: int, n_rows: int) -> Solution:
        """Return the best finite iterate with the status the solve ended in."""
        impulses = np.zeros(n_rows) if self.best_impulses is None else self.best_impulses
        return Solution(impulses, ended[0], iterations, ended[1])

    def _best_at(self, iteration: int) -> float:
        """Return the best residual, to a hundredth, known after ``iteration`` sweeps."""
        later = bisect.bisect_right(self._marks, iteration, key=itemgetter(0))
        return self._marks[max(later - 1, 0)][1]
