"""Mixing: Anderson acceleration of sweeps, every few of them (Pratapa, Suryanarayana & Pask 2016).

With Λ' the impulses after a window of sweeps from Λ, f = Λ' − Λ, and the differences ΔΛ', Δf between the last windows,
the next window begins at

    Λ' − Σ_j γ_j ΔΛ'_j,      γ = argmin ‖ f − Σ_j γ_j Δf_j ‖      in the norm of √α Λ,

γ from the normal equations (``anderson`` has the theory, and the general form). Within fixed states sweeps are a linear
map, which mixing solves as GMRES would; across a change of states it may lead astray. So a mixed start whose window
moves Λ clearly more than the one before it is taken back: the sweeps go on from where they were, and the differences
are forgotten. Where the residual makes no progress mixing becomes rarer, and is at last left out. What is seen is
always swept Λ, and satisfies the bounds of its laws.
"""

from typing import Protocol

import numpy as np

from ...problems.arrays import FloatArray
from .loop import Iterates

WINDOW = 3
"""Sweeps between two mixings, at first; where there is no progress windows become twice as long."""

LONGEST = 48
"""Longer windows are not mixed any more, for there may be progress without."""

RISE = 2.0
"""A mixed start is taken back where its window moves Λ more than this many times as far as the window before."""

SMALLEST_EIGENVALUE = 1e-14
"""Relative to the largest one of the normal equations; directions below it are left out."""


class MovableIterates(Iterates, Protocol):
    """Iterates that may be moved between two sweeps."""

    @property
    def padded(self) -> FloatArray:
        """Λ padded and flat, which sweeps change in place."""
        ...

    def note_jump(self) -> None:
        """Note that Λ has just been written to."""
        ...


class MixedIterates:
    """The iterates of sweeps with mixing; ``memory`` differences are kept, 0 gives the plain sweeps."""

    def __init__(self, iterates: MovableIterates, weights: FloatArray, memory: int) -> None:
        """Take iterates, √α of each lane as ``padded`` is arranged, and the number of differences."""
        self._iterates, self._padded, self._weights = iterates, iterates.padded, weights
        self._differences = Differences(memory, len(weights))
        self._begin, self._end = self._padded.copy(), self._padded.copy()  # of the window, and of the one before
        self._done, self._moved, self._is_mixed, self._window = 0, np.inf, False, WINDOW

    def reduce_acceleration(self) -> bool:
        """Mix half as often, at last not at all; return False if there is no mixing any more."""
        if self._window > LONGEST:
            return False
        self._window *= 2
        self._differences.forget()
        self._is_mixed = False
        return True

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps; mix before the first one of each window, so that Λ as it is seen has just been swept."""
        while count > 0:
            if self._done >= self._window:
                if self._window <= LONGEST:
                    self._mix()
                self._begin[:], self._done = self._padded, 0
            step = min(count, self._window - self._done)
            self._iterates.sweep(step)
            count, self._done = count - step, self._done + step

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()

    def _mix(self) -> None:
        """Begin the next window at mixed impulses, or take back what began the last one."""
        move = self._weights * (self._padded - self._begin)
        moved = float(np.linalg.norm(move))
        if self._is_mixed and not moved <= RISE * self._moved:
            self._padded[:] = self._end
            self._iterates.note_jump()
            self._differences.forget()
            self._moved, self._is_mixed = np.inf, False
            return
        step = self._differences.step(move, self._padded) if moved < np.inf else None
        self._end[:], self._moved = self._padded, moved
        self._is_mixed = step is not None
        if step is not None:
            self._padded -= step
            self._iterates.note_jump()


class Differences:
    """The differences between the last windows, at most ``memory`` of them, each of ``length`` numbers."""

    def __init__(self, memory: int, length: int) -> None:
        self._moves, self._ends = np.empty((memory, length)), np.empty((memory, length))
        self._last: tuple[FloatArray, FloatArray] | None = None
        self._count = 0

    def step(self, move: FloatArray, end: FloatArray) -> FloatArray | None:
        """Note a window, its weighted f and its Λ'; return Σ γ_j ΔΛ'_j, None where that is not known or not finite."""
        before, self._last = self._last, (move, end.copy())
        if before is None or len(self._moves) == 0:
            return None
        at = self._count % len(self._moves)
        self._moves[at], self._ends[at] = move - before[0], end - before[1]
        self._count += 1
        kept = min(self._count, len(self._moves))
        moves = self._moves[:kept]
        values, vectors = np.linalg.eigh(moves @ moves.T)
        is_large = values > SMALLEST_EIGENVALUE * values[-1]
        if not is_large.any():
            return None
        shares = vectors[:, is_large] @ ((vectors[:, is_large].T @ (moves @ move)) / values[is_large])
        step: FloatArray = shares @ self._ends[:kept]
        return step if np.isfinite(step).all() else None

    def forget(self) -> None:
        """Begin anew with the next window."""
        self._last, self._count = None, 0
