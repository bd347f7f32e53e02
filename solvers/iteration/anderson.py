"""Anderson acceleration of a fixed-point iteration x ↦ g(x) (Anderson 1965; Walker & Ni 2011).

With f_k = g(x_k) − x_k and the last m differences,

    x_{k+1} = g(x_k) − Σ_j γ_j (g(x_{j+1}) − g(x_j)),      γ = argmin ‖ f_k − Σ_j γ_j (f_{j+1} − f_j) ‖₂.

For a linear g and m as large as the dimension this is GMRES, and ends after that many steps.
"""

import numpy as np

from ...problems.arrays import FloatArray

SMALLEST_SINGULAR_VALUE = 1e-10
"""Relative to the largest one; directions below it are left out of the least-squares problem."""


class Anderson:
    """The last pairs of an iteration, with at most ``memory`` differences; 0 gives the plain iteration."""

    def __init__(self, memory: int) -> None:
        self.memory = memory
        self._images: list[FloatArray] = []
        self._changes: list[FloatArray] = []

    def next(self, point: FloatArray, image: FloatArray) -> FloatArray:
        """Return the next x from the present x and g(x)."""
        self._images = [*self._images, image][-self.memory - 1 :]
        self._changes = [*self._changes, image - point][-self.memory - 1 :]
        if len(self._images) < 2:
            return image
        change_differences = np.diff(np.array(self._changes), axis=0).T
        image_differences = np.diff(np.array(self._images), axis=0).T
        shares = np.linalg.lstsq(change_differences, self._changes[-1], rcond=SMALLEST_SINGULAR_VALUE)[0]
        mixed: FloatArray = image - image_differences @ shares
        return mixed

    def forget(self) -> None:
        """Start anew from the next pair."""
        self._images.clear()
        self._changes.clear()
