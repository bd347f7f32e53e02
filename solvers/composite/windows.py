"""Windows: limits on the number of sweeps without a tenfold reduction of the residual before other methods run.

A window begins with the first sweep and after each digit (factor of 10) of the residual. With m blocks (contacts and
joints), the work s of a sweep, and the work w of an interior point step, its length is

    n = min(400 + 3 m, 20 w / s)      sweeps, and at least 400.

The first term was measured on piles of balls, where the cost of a factorisation grows faster than m. The second term
limits the work of a window to that of 20 steps. It is the smaller term if bodies form chains, whose factorisation is
cheap, and if sweeps are slow, as with joints. Both s and w are counted (``work``), and no length depends on the clock.
Counting the operations of a factorisation takes as long as about 400 sweeps. The operations are therefore counted only
after 400 sweeps that gained less than a digit, and only if the second term could be the smaller one. Where
Newton steps are cheap or transmit impulses along joints, a short window comes first (``robust``).
"""

from collections.abc import Callable

import numpy as np

from ...problems.contact.problem import ContactProblem
from ..newton.linearised import MAX_DENSE_ROWS
from .interior_newton import count_operations
from .sequence import SolverSequence
from .work import MAX_STEPS, step_seconds, sweep_seconds

WINDOW, WINDOW_PER_CONTACT = 400, 3
"""Number of sweeps in a window: a constant, and an addition for each block."""

SHORT_WINDOW = 90
"""Number of sweeps in each of the first windows if Newton systems are dense or there are joints."""


class Window:
    """A check whether sweeps gain a digit within ``length`` sweeps, counted from ``begin`` and from each digit.

    ``longest``, if given, returns a second limit on the length. It is called once, after ``WINDOW`` slow sweeps.
    """

    def __init__(self, length: int, begin: int = 0, longest: Callable[[], int] | None = None) -> None:
        self.length, self._begin, self._begin_residual, self._longest = length, begin, np.inf, longest

    def is_slow(self, iteration: int, residual: float) -> bool:
        """Whether a whole window up to ``iteration`` has gained less than a digit of ``residual``, the best so far."""
        if residual <= 0.1 * self._begin_residual:
            self._begin_residual, self._begin = residual, iteration
            return False
        n_sweeps = iteration - self._begin
        if self._longest is not None and WINDOW <= n_sweeps < self.length:
            self.length, self._longest = min(self.length, max(WINDOW, self._longest())), None
        return n_sweeps >= self.length


def window_lengths(problem: ContactProblem) -> list[int]:
    """Return the lengths of successive windows; Newton steps are tried after slow sweeps of each length."""
    full_length = WINDOW + WINDOW_PER_CONTACT * problem.n_contacts
    begins_short = problem.n_rows <= MAX_DENSE_ROWS or problem.laws.is_bilateral.any()
    return [SHORT_WINDOW, full_length] if begins_short else [full_length]


def longest_window(sequence: SolverSequence) -> int:
    """Return the number of sweeps that take as much work as ``MAX_STEPS`` interior point steps.

    The interior point method is prepared only if the result may be shorter than the window of ``window_lengths``.
    """
    problem = sequence.problem
    seconds_per_sweep = sweep_seconds(problem)
    lower_bound = int(MAX_STEPS * step_seconds(problem, 0.0) / seconds_per_sweep)
    if lower_bound >= window_lengths(problem)[-1]:
        return lower_bound
    return int(MAX_STEPS * step_seconds(problem, count_operations(sequence)) / seconds_per_sweep)
