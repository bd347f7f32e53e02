"""Relaxation that adapts: ω from the rate at which sweeps converge.

Successive over-relaxation of a linear system in consistent order converges at a rate λ that ω and the rate μ² of plain
Gauss–Seidel sweeps decide, and is fastest at one ω (Young 1954; Hageman & Young, Applied Iterative Methods, 1981):

    (λ + ω − 1)² = λ ω² μ²,      ω* = 2 / (1 + √(1 − μ²)).

Once contacts have found their states, sweeps are nearly such an iteration. So λ is measured on the changes of Λ over a
window of sweeps, in the norm of √α Λ; μ follows from it, and ω goes half of the way to ω*, because λ is an estimate,
and states may still change. Where the changes grow, ω goes half of the way back to 1; where they shrink faster than any
ω above the best lets them, λ < ω − 1, a little. The first window has ω = 1: easy problems are swept plainly.
"""

from typing import Protocol

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from .loop import Iterates

WINDOW = 10
"""Sweeps from one choice of ω to the next; the changes of its first and last sweep are compared."""

LARGEST = 1.9
"""ω goes no higher; where there is no progress it goes half as far above 1."""

LEAST = 0.05
"""An ω that may go this far above 1 and no further is 1."""

TOWARDS = 0.5
"""How far ω goes towards the value that it should have."""

BACK = 0.05
"""How much ω is lowered where it is above the best one."""


class ScalableIterates(Iterates, Protocol):
    """Iterates whose steps may be scaled block by block.

    Attributes:
        layout: the padded blocks.
        padded: Λ padded and flat, which sweeps change in place.
        step_sizes: r of the lanes of each block that the iterates began with [kg], as in ``sweeps.step_size``.
    """

    layout: BlockLayout
    padded: FloatArray
    step_sizes: FloatArray

    def scale_steps(self, fraction: FloatArray) -> None:
        """Let the step of each block be this fraction of what it was at first, shape (n_blocks,)."""
        ...


class AdaptiveRelaxation:
    """Iterates, begun with ω = 1, whose relaxation adapts; ``relaxation`` is the present ω.

    Attributes:
        layout: see ``ScalableIterates``; so for the next two.
        padded: Λ.
        step_sizes: r for ω = 1.
        relaxation: ω.
    """

    def __init__(self, iterates: ScalableIterates, weights: FloatArray) -> None:
        """Take iterates and √α of each lane, as ``padded`` is arranged."""
        self._iterates, self._weights = iterates, weights
        self.layout, self.padded, self.step_sizes = iterates.layout, iterates.padded, iterates.step_sizes
        self.relaxation, self._largest = 1.0, LARGEST
        self._fraction = np.ones(self.layout.n_blocks)
        self._before, self._done, self._first_change = np.empty_like(self.padded), 0, 0.0

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, and choose ω anew after each window."""
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
                relaxation = chosen(self.relaxation, self._first_change, self._change())
                self._relax(min(relaxation, self._largest))

    def reduce_acceleration(self) -> bool:
        """Let ω go half as far above 1, at last not at all; return False if it is 1 already."""
        if self._largest == 1.0:
            return False
        self._largest = 1.0 + 0.5 * (self._largest - 1.0) if self._largest > 1.0 + 2.0 * LEAST else 1.0
        self._relax(min(self.relaxation, self._largest))
        return True

    def scale_steps(self, fraction: FloatArray) -> None:
        """Let the step of each block be ω times this fraction of what it was at first, shape (n_blocks,)."""
        self._fraction = fraction.copy()
        self._iterates.scale_steps(self.relaxation * self._fraction)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()

    def _change(self) -> float:
        return float(np.linalg.norm(self._weights * (self.padded - self._before)))

    def _relax(self, relaxation: float) -> None:
        if relaxation != self.relaxation:
            self.relaxation = relaxation
            self.scale_steps(self._fraction)


def chosen(relaxation: float, first: float, last: float) -> float:
    """Return the next ω after a window whose first and last sweep changed Λ by so much, in norm."""
    if not (0.0 < first < np.inf and 0.0 < last < np.inf):
        return relaxation
    rate = (last / first) ** (1.0 / (WINDOW - 1))
    if rate >= 1.0:
        return 1.0 + TOWARDS * (relaxation - 1.0)
    if rate <= relaxation - 1.0:
        return max(1.0, relaxation - BACK)
    squared = min((rate + relaxation - 1.0) ** 2 / (rate * relaxation**2), 1.0)
    best = min(2.0 / (1.0 + np.sqrt(1.0 - squared)), LARGEST)
    return float(relaxation + TOWARDS * (best - relaxation))
