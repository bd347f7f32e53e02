"""Adaptive relaxation: ω from the measured convergence rate of sweeps.

Successive over-relaxation of a consistently ordered linear system converges at a rate λ that depends on ω and on the
rate μ² of plain Gauss–Seidel sweeps, and is fastest at one ω* (Young 1954; Hageman & Young, Applied Iterative Methods,
1981):

    (λ + ω − 1)² = λ ω² μ²,      ω* = 2 / (1 + √(1 − μ²)).

Once contact states are settled, sweeps are nearly such an iteration. λ is measured from the changes of Λ over a window
of sweeps, in the norm of √α Λ. It determines μ, and ω moves half of the way to ω*, because λ is an estimate and states
may still change. Where the changes grow, ω moves half of the way back to 1; where λ < ω − 1, which only an ω above ω*
allows, ω decreases slightly. The first window has ω = 1, so easy problems are swept plainly.
"""

from typing import Protocol

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from .loop import Iterates, WrappedIterates

WINDOW = 10
"""Sweeps between two choices of ω; the changes of its first and last sweep are compared."""

MAX_RELAXATION = 1.9
"""Largest ω; without progress the excess over 1 is halved."""

MIN_EXCESS = 0.05
"""A bound of ω that exceeds 1 by at most this much becomes 1."""

STEP_TO_BEST = 0.5
"""Share of the way to the new value that ω moves."""

DECREASE = 0.05
"""How much ω is lowered where it exceeds the best value."""


class ScalableIterates(Iterates, Protocol):
    """Iterates whose steps can be scaled block by block.

    Attributes:
        layout: the padded blocks.
        padded: Λ padded and flat, which sweeps change in place.
        step_sizes: initial r of the lanes of each block [kg], as in ``sweeps.step_size``.
    """

    layout: BlockLayout
    padded: FloatArray
    step_sizes: FloatArray

    def scale_steps(self, fraction: FloatArray) -> None:
        """Set the step of each block to this fraction of its initial step, shape (n_blocks,)."""
        ...


class AdaptiveRelaxation(WrappedIterates[ScalableIterates]):
    """Iterates whose relaxation starts at ω = 1 and adapts.

    Attributes:
        layout, padded, step_sizes: see ``ScalableIterates``; the step sizes are those of ω = 1.
        relaxation: the present ω.
    """

    def __init__(self, iterates: ScalableIterates, weights: FloatArray) -> None:
        """Take iterates with ω = 1 and √α of each lane of ``padded``."""
        self._iterates, self._weights = iterates, weights
        self.layout, self.padded, self.step_sizes = iterates.layout, iterates.padded, iterates.step_sizes
        self.relaxation, self._max_relaxation = 1.0, MAX_RELAXATION
        self._fraction = np.ones(self.layout.n_blocks)
        self._before, self._done, self._first_change = np.empty_like(self.padded), 0, 0.0

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, and choose a new ω after each window."""
        while count > 0:
            is_measured = self._done in (0, WINDOW - 1)
            if is_measured:
                self._before[:] = self.padded
            step = 1 if is_measured else min(count, WINDOW - 1 - self._done)
            self._iterates.sweep(step)
            count, self._done = count - step, self._done + step
            if self._done == 1:
                self._first_change = self._change()
            elif self._done == WINDOW:
                self._done = 0
                relaxation = next_relaxation(self.relaxation, self._first_change, self._change())
                self._relax(min(relaxation, self._max_relaxation))

    def reduce_acceleration(self) -> bool:
        """Halve the excess of the largest ω over 1; return False if it is 1 already."""
        if self._max_relaxation == 1.0:
            return False
        excess = self._max_relaxation - 1.0
        self._max_relaxation = 1.0 + 0.5 * excess if self._max_relaxation > 1.0 + 2.0 * MIN_EXCESS else 1.0
        self._relax(min(self.relaxation, self._max_relaxation))
        return True

    def scale_steps(self, fraction: FloatArray) -> None:
        """Set the step of each block to ω times this fraction of its initial step, shape (n_blocks,)."""
        self._fraction = fraction.copy()
        self._iterates.scale_steps(self.relaxation * self._fraction)

    def _change(self) -> float:
        return float(np.linalg.norm(self._weights * (self.padded - self._before)))

    def _relax(self, relaxation: float) -> None:
        if relaxation != self.relaxation:
            self.relaxation = relaxation
            self.scale_steps(self._fraction)


def next_relaxation(relaxation: float, first: float, last: float) -> float:
    """Return the next ω, where ``first`` and ``last`` are the norms of the first and last change of a window."""
    if not (0.0 < first < np.inf and 0.0 < last < np.inf):
        return relaxation
    rate = (last / first) ** (1.0 / (WINDOW - 1))
    if rate >= 1.0:
        return 1.0 + STEP_TO_BEST * (relaxation - 1.0)
    if rate <= relaxation - 1.0:
        return max(1.0, relaxation - DECREASE)
    squared = min((rate + relaxation - 1.0) ** 2 / (rate * relaxation**2), 1.0)
    best = min(2.0 / (1.0 + np.sqrt(1.0 - squared)), MAX_RELAXATION)
    return float(relaxation + STEP_TO_BEST * (best - relaxation))
