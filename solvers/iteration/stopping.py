"""Stopping criteria of projected iterations.

The judge's residual is measured every few sweeps. A constant residual does not end a solve: it may fall after a million
sweeps, while an impulse travels through a stack. A solve therefore continues to its limits unless it cannot succeed.
This is the case if Λ no longer changes, or rounding errors explain the residual (STALLED); if iterate ν equals iterate
ν−2 up to rounding but differs from ν−1 (OSCILLATING, the usual failure of Jacobi sweeps); or if the residual grows
without bound or is not a number (DIVERGED).
"""

import bisect
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.compilation.notice import COMPILATION
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop
from ...problems.representation import counted

MAX_CHECK_INTERVAL = 10
"""Largest number of sweeps between two checks of the residual; a check takes about as long as one sweep."""

DIVERGENCE_GROWTH = 1e8
"""A residual this many times the first one (or 1, if that is larger) counts as divergence."""

MIN_PLATEAU_SWEEPS = 2000
"""Lack of progress is not diagnosed before this many sweeps."""

PLATEAU_PROGRESS = 0.9
"""Sweeps make progress if the last three quarters of them reduce the best residual to less than this fraction."""

RECORD_RATIO = 0.99
"""A residual below this fraction of the last recorded one is recorded together with its sweep."""

BETTER_RATIO = 0.5
"""A residual below this fraction of another is clearly better, even if both are rounding errors."""

CYCLE_PATIENCE = 20
"""Number of checks without progress before iterates are compared. Two consecutive comparisons must agree: an iteration
may have hidden state that is still changing, and a safeguard may break a cycle."""

ROUNDING = 16 * np.finfo(np.float64).eps
"""Impulses that differ by less, relative to the largest value of their row, are equal up to rounding."""


class Outcome(NamedTuple):
    """The status of a solve, and the reason in words."""

    status: Status
    reason: str


class Clock:
    """Clock of a solve, which stops during calls of an observer and while kernels compile.

    Args:
        seconds: time limit [s].
    """

    def __init__(self, seconds: float) -> None:
        self._limit, self._compilation_before = seconds, COMPILATION.seconds
        self._start = time.perf_counter()

    @property
    def elapsed(self) -> float:
        """Time used so far [s]."""
        return time.perf_counter() - self._start - (COMPILATION.seconds - self._compilation_before)

    @property
    def remaining(self) -> float:
        """Time left [s], negative after the deadline."""
        return self._limit - self.elapsed

    @property
    def has_expired(self) -> bool:
        """Whether the deadline has passed."""
        return self.remaining < 0.0

    def show(self, observe: Observer | None, iteration: int, impulses: FloatArray) -> None:
        """Pass Λ, shape (n_rows,), to the observer, if any; the caller must not write to it afterwards."""
        if observe is None:
            return
        start = time.perf_counter()
        view = impulses.view()
        view.setflags(write=False)
        observe(iteration, view)
        self._start += time.perf_counter() - start

    def reached_limit(self, stop: Stop, iterations: int) -> Status | None:
        """Return the limit that a solve has reached after ``iterations``, or None."""
        if iterations >= stop.max_iterations:
            return Status.ITERATION_LIMIT
        return Status.TIME_LIMIT if self.has_expired else None


def sweeps_to_next_check(iteration: int) -> int:
    """Return the number of sweeps before the next check: few at first, then ``MAX_CHECK_INTERVAL``."""
    return min(MAX_CHECK_INTERVAL, 1 + iteration // 2)


@dataclass
class Monitor:
    """Monitor of the residual of one solve, which decides when to stop.

    Attributes:
        stop: the limits.
        best_residual: the lowest finite residual so far.
        clock: the clock of the solve.
    """

    stop: Stop
    best_residual: float = np.inf
    _best_impulses: FloatArray | Callable[[], FloatArray] | None = None
    clock: Clock = field(init=False)
    _first: float = np.inf
    _iteration: int = 0
    _checks_without_progress: int = 0
    _last_repeat: tuple[Status, FloatArray] | None = None
    _history: list[tuple[int, float]] = field(default_factory=list)
    _next_rounding_test: int = 0

    def __post_init__(self) -> None:
        check_stop(self.stop)
        self.clock = Clock(self.stop.max_seconds)

    def sweeps_between_checks(self, iteration: int) -> tuple[int, ...]:
        """Return how many sweeps precede each of the next checks, up to the one that may find more than a residual.

        At the earlier checks, a residual that is above the tolerance and not too large is only recorded. The last check
        may find that the sweeps make no progress, or have reached a limit.
        """
        max_checks = max(CYCLE_PATIENCE - self._checks_without_progress, 1)
        return _sweeps_between_checks(iteration, max_checks, self.stop.max_iterations)

    @property
    def max_residual(self) -> float:
        """A residual that is not below this number ends the solve as divergent."""
        return DIVERGENCE_GROWTH * self._first

    @property
    def best_impulses(self) -> FloatArray | None:
        """The iterate with the lowest residual, shape (n_rows,), not to be modified; None before a finite residual."""
        if callable(self._best_impulses):
            self._best_impulses = self._best_impulses()
        return self._best_impulses

    def replace_best(self, residual: float, impulses: FloatArray) -> None:
        """Replace the best iterate and its residual."""
        self.best_residual, self._best_impulses = residual, impulses

    def record(self, iteration: int, residual: float, impulses: FloatArray | Callable[[], FloatArray]) -> None:
        """Record the residual after ``iteration`` sweeps; ``impulses`` may be a function that returns the iterate."""
        if not self._history:
            self._first = max(residual, 1.0) if residual < np.inf else 1.0
        self._iteration = iteration
        self._checks_without_progress += 1
        if residual < self.best_residual:
            if residual < RECORD_RATIO * self.best_residual:
                self._checks_without_progress = 0
            self.best_residual, self._best_impulses = residual, impulses
        if not self._history or self.best_residual < RECORD_RATIO * self._history[-1][1]:
            self._history.append((iteration, self.best_residual))

    def check_convergence(self, iteration: int, residual: float, impulses: FloatArray) -> Outcome | None:
        """Record the residual after ``iteration`` sweeps; return the outcome if the solve is over."""
        self.record(iteration, residual, impulses)
        if residual <= self.stop.tolerance:
            return Outcome(Status.SOLVED, "")
        if not residual < self.max_residual:
            return Outcome(Status.DIVERGED, _divergence_text(iteration, residual, impulses))
        limit = self.clock.reached_limit(self.stop, iteration)
        return Outcome(limit, f"residual {self.best_residual:.1e} after {iteration} sweeps") if limit else None

    @property
    def lacks_progress(self) -> bool:
        """Whether the last three quarters of the sweeps barely reduced the residual."""
        if self._iteration < MIN_PLATEAU_SWEEPS:
            return False
        return self.best_residual > PLATEAU_PROGRESS * self._best_at(self._iteration // 4)

    @property
    def may_test_rounding(self) -> bool:
        """Whether a test for the rounding limit is due: the next one is due when the number of sweeps has doubled."""
        return self._iteration >= self._next_rounding_test

    def begin_rounding_test(self, iteration: int, residual: float) -> None:
        """Replace the residual of the best iterate by ``residual``, its value in the judge's arithmetic."""
        self.best_residual, self._next_rounding_test = residual, 2 * iteration

    @property
    def suspects_cycle(self) -> bool:
        """Whether successive iterates should be compared."""
        return self._checks_without_progress >= CYCLE_PATIENCE

    def restart_progress(self) -> None:
        """Reset the count of checks without progress, because the iteration has changed."""
        self._checks_without_progress = 0

    def check_cycle(
        self, newest_impulses: FloatArray, previous_impulses: FloatArray, second_last_impulses: FloatArray
    ) -> Outcome | None:
        """Compare the successive iterates Λ^ν, Λ^(ν−1), Λ^(ν−2); return the outcome if they repeat."""
        self.restart_progress()
        earlier, self._last_repeat = self._last_repeat, None
        rounding = ROUNDING * np.abs([newest_impulses, previous_impulses, second_last_impulses]).max(axis=0)
        if np.array_equal(newest_impulses, previous_impulses) and np.array_equal(newest_impulses, second_last_impulses):
            self._last_repeat = Status.STALLED, newest_impulses
            if earlier is not None and np.array_equal(newest_impulses, earlier[1]):
                return Outcome(Status.STALLED, f"the impulses no longer change at residual {self.best_residual:.1e}")
        elif (np.abs(newest_impulses - second_last_impulses) <= rounding).all() and (
            np.abs(newest_impulses - previous_impulses) > rounding
        ).any():
            self._last_repeat = Status.OSCILLATING, newest_impulses
            if earlier is not None and earlier[0] is Status.OSCILLATING:
                reason = f"the iterates repeat in a cycle of two, best residual {self.best_residual:.1e}"
                return Outcome(Status.OSCILLATING, reason)
        return None

    def solution(self, outcome: Outcome, iterations: int, n_rows: int) -> Solution:
        """Return the best finite iterate with the outcome of the solve."""
        impulses = np.zeros(n_rows) if self.best_impulses is None else self.best_impulses
        return Solution(impulses, outcome.status, iterations, outcome.reason)

    def _best_at(self, iteration: int) -> float:
        """Return the best residual after ``iteration`` sweeps, to within one percent."""
        n_earlier = bisect.bisect_right(self._history, iteration, key=itemgetter(0))
        return self._history[max(n_earlier - 1, 0)][1]


@lru_cache
def _sweeps_between_checks(iteration: int, max_checks: int, max_iterations: int) -> tuple[int, ...]:
    counts: list[int] = []
    last = min(max_iterations, max(MIN_PLATEAU_SWEEPS, iteration + 1))
    while iteration < last and len(counts) < max_checks:
        counts.append(min(sweeps_to_next_check(iteration), max_iterations - iteration))
        iteration += counts[-1]
    return (*counts,) or (0,)


def _divergence_text(iteration: int, residual: float, impulses: FloatArray) -> str:
    """Return the reason for divergence after ``iteration`` sweeps."""
    sweeps = counted(iteration, "sweep")
    if not np.isfinite(impulses).all():
        return f"the impulses are not finite after {sweeps}"
    return f"the residual grew to {residual:.1e} within {sweeps}"
