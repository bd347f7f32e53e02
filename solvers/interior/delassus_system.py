"""The reduced Newton system over contacts, (Ĝ + D) dr = b, with Ĝ assembled.

Where contacts over-determine the bodies Ĝ has no full rank; D keeps the sum regular, and what D leaves weak along
self-stress the iterates do not need. Each solution is refined against Ĝ and D themselves.
"""

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from .block_lu import BlockLU
from .scaled_problem import ScaledProblem

REFINEMENTS = 2
"""Refinements of each solution."""


class DelassusSystem:
    """Ĝ of one problem in block rows, and the factors of Ĝ + D."""

    def __init__(self, problem: ContactProblem, scaled: ScaledProblem) -> None:
        blocks, self._width = problem.delassus_blocks(), problem.layout.width
        starts, columns, values = _symmetric_pattern(blocks.starts, blocks.columns.astype(np.int64), blocks.values)
        row = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        left, right = scaled.velocity_scale[:, : self._width], scaled.impulse_scale[:, : self._width]
        self._values: FloatArray = left[row][:, :, None] * values * right[columns][:, None, :]
        self._diagonal = np.flatnonzero(row == columns)
        size = (len(starts) - 1) * self._width
        self._matrix = sp.bsr_array((self._values, columns, starts), shape=(size, size))
        self._summed = self._values.copy()
        self._factors = BlockLU(starts, columns, self._width)
        self._coupled: FloatArray = np.zeros((0, self._width, self._width))

    @property
    def flops(self) -> float:
        """Multiplications and additions of one factorisation."""
        return self._factors.flops

    def times(self, r: FloatArray) -> FloatArray:
        """Return Ĝ r, shape (n, 3)."""
        product = np.zeros((len(r), 3))
        lanes = np.ascontiguousarray(r[:, : self._width]).reshape(-1)
        product[:, : self._width] = (self._matrix @ lanes).reshape(-1, self._width)
        return product

    def factorise(self, coupled: FloatArray) -> bool:
        """Factorise Ĝ + D for D of shape (n, 3, 3); False if that is singular."""
        self._coupled = np.ascontiguousarray(coupled[:, : self._width, : self._width])
        self._summed[self._diagonal] = self._values[self._diagonal] + self._coupled
        return bool(np.isfinite(self._coupled).all()) and self._factors.factorise(self._summed)

    def solve(self, right: FloatArray, refinements: int = REFINEMENTS) -> FloatArray:
        """Return dr for a right side, both of shape (n, 3)."""
        width, found, left = self._width, np.zeros((len(right), 3)), right
        for refinement in range(refinements + 1):
            change = self._factors.solve(np.ascontiguousarray(left[:, :width]).reshape(-1))
            found[:, :width] += change.reshape(-1, width)
            if refinement < refinements:
                left = right - self.times(found)
                left[:, :width] -= (self._coupled @ found[:, :width, None])[:, :, 0]
        return found


def _symmetric_pattern(
    starts: np.ndarray, columns: np.ndarray, values: FloatArray
) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """Return block rows with zeros stored where only the transposed block is: public data need not be symmetric."""
    n, width = len(starts) - 1, values.shape[1]
    row = np.repeat(np.arange(n), np.diff(starts))
    key = row * n + columns
    missing = np.setdiff1d(columns * n + row, key)
    if not len(missing):
        return np.asarray(starts, dtype=np.int64), columns, values
    keys = np.concatenate([key, missing])
    order = np.argsort(keys, kind="stable")
    padded = np.concatenate([values, np.zeros((len(missing), width, width))])[order]
    keys = keys[order]
    return np.searchsorted(keys // n, np.arange(n + 1)).astype(np.int64), keys % n, padded
