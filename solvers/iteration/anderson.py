"""Anderson acceleration of a fixed-point iteration x ↦ g(x) (Anderson 1965; Walker & Ni 2011).

With f_k = g(x_k) − x_k and the last m differences,

    x_{k+1} = g(x_k) − Σ_j γ_j (g(x_{j+1}) − g(x_j)),      γ = argmin ‖ f_k − Σ_j γ_j (f_{j+1} − f_j) ‖₂.

For a linear g of dimension n and m ≥ n, this is GMRES, which ends after n steps.

``AndersonSweeps`` accelerates sweeps, once per window of several sweeps (Pratapa, Suryanarayana & Pask 2016): g maps Λ
to the impulses Λ' after the window, the norm is that of √α Λ, and γ solves the normal equations. While contact states
do not change, g is an affine map, whose fixed point the acceleration finds as GMRES does. When states change, the
acceleration may fail. An extrapolation is therefore undone if its window moves Λ much farther than the previous window:
the sweeps continue from the Λ before the extrapolation, and the differences are dropped. If the residual makes no
progress, windows become longer, and finally extrapolation stops. Observers receive Λ after a sweep, which satisfies the
bounds of its laws.
"""

from typing import Protocol

import numpy as np

from ...problems.arrays import FloatArray
from .loop import Iterates, WrappedIterates

MIN_SINGULAR_VALUE = 1e-10
"""Smallest singular value relative to the largest; smaller ones are omitted from the least-squares problem."""

FIRST_WINDOW = 3
"""Number of sweeps in the first window; it doubles if the residual makes no progress."""

MAX_WINDOW = 48
"""Largest number of sweeps in a window that begins with an extrapolation; sweeps of longer windows are plain."""

MAX_GROWTH = 2.0
"""An extrapolation is undone if its window moves Λ more than this many times as far as the previous window."""

MIN_EIGENVALUE = 1e-14
"""Smallest eigenvalue of the normal equations relative to the largest; smaller ones are omitted."""


class Anderson:
    """Anderson acceleration with at most ``memory`` differences of pairs (x, g(x)); 0 gives the plain iteration."""

    def __init__(self, memory: int) -> None:
        self.memory = memory
        self._images: list[FloatArray] = []
        self._changes: list[FloatArray] = []

    def next(self, point: FloatArray, image: FloatArray) -> FloatArray:
        """Return the next x from the current x and g(x)."""
        self._images = [*self._images, image][-self.memory - 1 :]
        self._changes = [*self._changes, image - point][-self.memory - 1 :]
        if len(self._images) < 2:
            return image
        change_differences = np.diff(np.array(self._changes), axis=0).T
        image_differences = np.diff(np.array(self._images), axis=0).T
        weights = np.linalg.lstsq(change_differences, self._changes[-1], rcond=MIN_SINGULAR_VALUE)[0]
        next_point: FloatArray = image - image_differences @ weights
        return next_point

    def restart(self) -> None:
        """Drop all pairs."""
        self._images.clear()
        self._changes.clear()


class MovableIterates(Iterates, Protocol):
    """Iterates that can be moved between two sweeps."""

    @property
    def padded(self) -> FloatArray:
        """Λ padded and flat, which sweeps change in place."""
        ...

    def note_jump(self) -> None:
        """Update the state that depends on Λ, which has just been overwritten."""
        ...


class AndersonSweeps(WrappedIterates[MovableIterates]):
    """Sweeps with an Anderson acceleration that stores ``memory`` differences; 0 gives plain sweeps."""

    def __init__(self, iterates: MovableIterates, weights: FloatArray, memory: int) -> None:
        """Wrap ``iterates``; ``weights`` is √α of each lane of ``padded``, and ``memory`` the number of differences."""
        self._iterates, self._padded, self._weights = iterates, iterates.padded, weights
        self._differences = WindowDifferences(memory, len(weights))
        self._begin = self._padded.copy()  # Λ at the beginning of this window
        self._end = self._padded.copy()  # Λ at the end of the previous window
        self._n_swept, self._distance, self._is_extrapolated, self._window = 0, np.inf, False, FIRST_WINDOW

    def reduce_acceleration(self) -> bool:
        """Double the windows; return False if they are too long for any extrapolation."""
        if self._window > MAX_WINDOW:
            return False
        self._window *= 2
        self._differences.restart()
        self._is_extrapolated = False
        return True

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps; extrapolate only before the first sweep of a window, so that Λ results from a sweep."""
        while count > 0:
            if self._n_swept >= self._window:
                if self._window <= MAX_WINDOW:
                    self._extrapolate()
                self._begin[:], self._n_swept = self._padded, 0
            step = min(count, self._window - self._n_swept)
            self._iterates.sweep(step)
            count, self._n_swept = count - step, self._n_swept + step

    def _extrapolate(self) -> None:
        """Start the next window from extrapolated impulses, or undo the last extrapolation."""
        move = self._weights * (self._padded - self._begin)
        distance = float(np.linalg.norm(move))
        if self._is_extrapolated and not distance <= MAX_GROWTH * self._distance:
            self._padded[:] = self._end
            self._iterates.note_jump()
            self._differences.restart()
            self._distance, self._is_extrapolated = np.inf, False
            return
        step = self._differences.step(move, self._padded) if distance < np.inf else None
        self._end[:], self._distance = self._padded, distance
        self._is_extrapolated = step is not None
        if step is not None:
            self._padded -= step
            self._iterates.note_jump()


class WindowDifferences:
    """The differences between the last windows, at most ``memory`` vectors of ``length`` entries."""

    def __init__(self, memory: int, length: int) -> None:
        self._moves, self._ends = np.empty((memory, length)), np.empty((memory, length))
        self._last: tuple[FloatArray, FloatArray] | None = None
        self._count = 0

    def step(self, move: FloatArray, end: FloatArray) -> FloatArray | None:
        """Record a window, and return Σ γ_j ΔΛ'_j, shape (length,).

        The result is None if there are no differences yet, all of them vanish, or the sum is not finite.

        Args:
            move: the weighted change √α (Λ' − Λ) of the window, shape (length,).
            end: Λ' after the window, shape (length,).
        """
        previous_step, self._last = self._last, (move, end.copy())
        if previous_step is None or len(self._moves) == 0:
            return None
        slot = self._count % len(self._moves)
        self._moves[slot], self._ends[slot] = move - previous_step[0], end - previous_step[1]
        self._count += 1
        n_kept = min(self._count, len(self._moves))
        moves = self._moves[:n_kept]
        values, vectors = np.linalg.eigh(moves @ moves.T)
        is_large = values > MIN_EIGENVALUE * values[-1]
        if not is_large.any():
            return None
        weights = vectors[:, is_large] @ ((vectors[:, is_large].T @ (moves @ move)) / values[is_large])
        step: FloatArray = weights @ self._ends[:n_kept]
        return step if np.isfinite(step).all() else None

    def restart(self) -> None:
        """Drop all windows."""
        self._last, self._count = None, 0
