"""When a projected iteration stops, and why.

The judge's residual is measured every few sweeps. An iteration that no longer lowers it either repeats itself
(OSCILLATING: iterate ν equals iterate ν−2 but not ν−1, the usual failure of Jacobi sweeps, which stay bounded) or
creeps (STALLED); one whose residual explodes, or ceases to be a number, has DIVERGED.
"""

from dataclasses import dataclass, field

import numpy as np

from ...problems.laws import FloatArray
from ..clock import Clock
from ..interface import Solution, Status, Stop

LONGEST_INTERVAL = 10
"""Most sweeps between two looks at the residual; a look costs about one sweep."""

GROWTH_OF_DIVERGENCE = 1e8
"""A residual this many times the first one (or 1, if that is larger) counts as divergence."""

STALL_SWEEPS = 2000
"""No iteration is called stalled before this many sweeps: plateaus of hundreds of sweeps end by themselves."""

STALL_PROGRESS = 0.9
"""Stalled: the last three quarters of all sweeps have not brought the best residual below this fraction."""

CYCLE_PATIENCE = 20
"""Looks without progress after which the iterates are compared with each other."""

CYCLE_RATIO = 1e-6
"""A cycle: ‖Λ^ν − Λ^(ν−2)‖ is below this fraction of ‖Λ^ν − Λ^(ν−1)‖."""


def sweeps_to_next_look(iteration: int) -> int:
    """Return how many sweeps to do before the residual is looked at again: few at first, then ``LONGEST_INTERVAL``."""
    return min(LONGEST_INTERVAL, 1 + iteration // 2)


@dataclass
class Monitor:
    """Follows the residual of one solve and says when to stop.

    Attributes:
        stop: the limits.
        best_residual: the lowest finite residual seen.
        best_impulses: the iterate that has it, None before the first; nobody may write to it after ``look``.
        clock: the time that is left.
    """

    stop: Stop
    best_residual: float = np.inf
    best_impulses: FloatArray | None = None
    clock: Clock = field(init=False)
    _first: float = np.inf
    _looks_without_progress: int = 0
    _history: list[tuple[int, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.clock = Clock(self.stop.max_seconds)

    def look(self, iteration: int, residual: float, impulses: FloatArray) -> tuple[Status, str] | None:
        """Note the residual after ``iteration`` sweeps; return status and reason if the solve is over."""
        if not self._history:
            self._first = max(residual, 1.0) if residual < np.inf else 1.0
        if residual < self.best_residual:
            progress = residual < 0.99 * self.best_residual
            self.best_residual, self.best_impulses = residual, impulses
            self._looks_without_progress = 0 if progress else self._looks_without_progress + 1
        else:
            self._looks_without_progress += 1
        self._history.append((iteration, self.best_residual))
        if residual <= self.stop.tolerance:
            return Status.SOLVED, ""
        if not residual < GROWTH_OF_DIVERGENCE * self._first:
            return Status.DIVERGED, f"the residual grew to {residual:.1e} within {iteration} sweeps"
        if iteration >= self.stop.max_iterations:
            return Status.ITERATION_LIMIT, f"residual {self.best_residual:.1e} after {iteration} sweeps"
        if self.clock.is_up:
            return Status.TIME_LIMIT, f"residual {self.best_residual:.1e} after {iteration} sweeps"
        if iteration >= STALL_SWEEPS and self.best_residual > STALL_PROGRESS * self._best_at(iteration // 4):
            return Status.STALLED, f"the residual stays at {self.best_residual:.1e} since sweep {iteration // 4}"
        return None

    @property
    def suspects_cycle(self) -> bool:
        """Whether it is time to compare iterates with each other."""
        return self._looks_without_progress >= CYCLE_PATIENCE

    def be_patient(self) -> None:
        """Count looks without progress from here on, because the iteration has just been changed."""
        self._looks_without_progress = 0

    def cycle(self, newest: FloatArray, previous: FloatArray, before: FloatArray) -> tuple[Status, str] | None:
        """Judge three successive iterates Λ^ν, Λ^(ν−1), Λ^(ν−2): a cycle of two, no change at all, or nothing."""
        self.be_patient()
        step = float(np.abs(newest - previous).max(initial=0.0))
        return_step = float(np.abs(newest - before).max(initial=0.0))
        if step == 0.0:
            return Status.STALLED, f"the iterates no longer change at residual {self.best_residual:.1e}"
        if return_step <= CYCLE_RATIO * step:
            return Status.OSCILLATING, f"a cycle of two iterates, best residual {self.best_residual:.1e}"
        return None

    def solution(self, ended: tuple[Status, str], iterations: int, n_rows: int) -> Solution:
        """Return the best finite iterate with the status the solve ended in."""
        impulses = np.zeros(n_rows) if self.best_impulses is None else self.best_impulses
        return Solution(impulses, ended[0], iterations, ended[1])

    def _best_at(self, iteration: int) -> float:
        """Best residual known after ``iteration`` sweeps."""
        low, high = 0, len(self._history)
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self._history[middle][0] <= iteration else (low, middle)
        return self._history[low][1]
