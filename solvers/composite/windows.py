"""Windows: how long sweeps that gain less than a digit may continue before interior points follow.

With m blocks (contacts and joints), the work s of a sweep and w of a step of the interior point method that would
follow, a window has

    n = min(400 + 3 m, 20 w / s)      sweeps, at least 400.

The first term was measured on piles of balls, where the cost of a factorisation grows faster than m. The second one
limits the work of a window to that of 20 steps. It decides where bodies form chains, whose factorisation is cheap, and
where sweeps are slow, as with joints. Work is counted in nominal seconds,

    s = 10 ns · k   for contacts alone,   50 ns · k   with joints or rolling friction,
    w = 0.3 ms + 5 µs · m + f / 15 GHz,

with k rows, blocks padded to equal size, and f operations of a factorisation. Counting the operations takes as long as
about 400 sweeps, so they are counted after the first 400 sweeps, if these have gained less than a digit and w could
decide with f = 0. No length depends on the clock.
"""

from collections.abc import Callable

import numpy as np

from ...problems.contact.problem import ContactProblem
from ..interior.runs import PreparedRuns
from ..newton.linearised import MAX_DENSE_ROWS
from .interior_newton import first_method
from .sequence import SolverSequence

WINDOW, WINDOW_PER_CONTACT = 400, 3
"""Sweeps in a window: a constant, and an addition for each block."""

SHORT_WINDOW = 90
"""Sweeps in the first window where Newton systems are dense or there are joints."""

MAX_STEPS = 20
"""Interior point steps whose work a window may take."""

SWEPT_ROW, SWEPT_ROW_OF_ANY_LAW = 1e-8, 5e-8
"""Nominal seconds to sweep a row of contacts alone, and one where there are joints or rolling friction."""

STEP, STEPPED_BLOCK, OPERATION = 3e-4, 5e-6, 1 / 15e9
"""Nominal seconds of an interior point step: constant, for each block, and for each operation of its factorisation."""


class Window:
    """Tells whether sweeps gain a digit per window of ``length`` sweeps, the first beginning at sweep ``begin``.

    ``longest``, if given, returns another limit of the length; it is called once, after ``WINDOW`` slow sweeps.
    """

    def __init__(self, length: int, begin: int = 0, longest: Callable[[], int] | None = None) -> None:
        self.length, self._begin, self._before, self._longest = length, begin, np.inf, longest

    def is_lost(self, iteration: int, residual: float) -> bool:
        """Whether the window that ends at this sweep, with this best residual, has gained less than a digit."""
        if self._before == np.inf:
            self._before = residual
        swept, is_slow = iteration - self._begin, residual > 0.1 * self._before
        if is_slow and self._longest is not None and WINDOW <= swept < self.length:
            self.length, self._longest = min(self.length, max(WINDOW, self._longest())), None
        if swept < self.length:
            return False
        self._before, self._begin = residual, iteration
        return is_slow


def window_lengths(problem: ContactProblem) -> list[int]:
    """Return the lengths of the windows, after each of which Newton steps are tried."""
    whole = WINDOW + WINDOW_PER_CONTACT * problem.n_contacts
    is_short = problem.n_rows <= MAX_DENSE_ROWS or problem.laws.is_bilateral.any()
    return [SHORT_WINDOW, whole] if is_short else [whole]


def longest_window(sequence: SolverSequence) -> int:
    """Return the sweeps that take as much work as ``MAX_STEPS`` interior point steps.

    The interior point method is prepared only if the result may be shorter than the window of ``window_lengths``.
    """
    problem = sequence.problem
    one_sweep = sweep_seconds(problem)
    lower_bound = int(MAX_STEPS * step_seconds(problem, 0.0) / one_sweep)
    if lower_bound >= window_lengths(problem)[-1]:
        return lower_bound
    prepared = sequence.prepare(first_method(problem))
    assert isinstance(prepared, PreparedRuns)
    return int(MAX_STEPS * step_seconds(problem, prepared.system.flops) / one_sweep)


def sweep_seconds(problem: ContactProblem) -> float:
    """Return the nominal seconds of a sweep."""
    layout = problem.layout
    return (SWEPT_ROW if layout.has_contacts_only else SWEPT_ROW_OF_ANY_LAW) * layout.n_blocks * layout.width


def step_seconds(problem: ContactProblem, operations: float) -> float:
    """Return the nominal seconds of an interior point step whose factorisation takes so many operations."""
    return STEP + STEPPED_BLOCK * problem.layout.n_blocks + OPERATION * operations
