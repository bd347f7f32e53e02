"""Sweeps with a safeguard: contacts that oscillate take smaller steps (``iteration.safeguard``)."""

from typing import Protocol

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from ..iteration.loop import Iterates
from ..iteration.safeguard import OscillationGuard


class ScalableIterates(Iterates, Protocol):
    """Iterates whose steps can be scaled contact by contact.

    Attributes:
        layout: the padded blocks.
        padded: Λ padded and flat, which sweeps change in place.
        step_sizes: 1/α times a factor for the N lane and the T lanes of each block [kg], shape (n_blocks, 2).
    """

    layout: BlockLayout
    padded: FloatArray
    step_sizes: FloatArray

    def scale_steps(self, fraction: FloatArray) -> None:
        """Let the step of each block be this fraction of what it was at first, shape (n_blocks,)."""
        ...


class SafeguardedIterates:
    """Iterates whose steps are cut where contacts oscillate.

    Args:
        iterates: what is swept.
    """

    def __init__(self, iterates: ScalableIterates) -> None:
        self._iterates = iterates
        self._guard = OscillationGuard(iterates.step_sizes, iterates.padded)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, with smaller steps where contacts oscillate."""
        self._guard.sweep(count, self._iterates.sweep, self._iterates.scale_steps)

    def move_to(self, impulses: FloatArray) -> None:
        """Go on from ``impulses``, shape (n_rows,), with the step sizes as they have become."""
        self._iterates.padded[:] = self._iterates.layout.pad(impulses).reshape(-1)
        self._guard.restart()

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()
