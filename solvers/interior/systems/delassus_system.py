"""The reduced Newton system over contacts, (Ĝ + D) dr = b, with Ĝ assembled.

If contacts over-determine the motion of bodies, Ĝ is rank-deficient, and D makes the sum regular. Errors along
self-stresses, which cause no velocity, do not affect the iterates. Each solution is refined with Ĝ and D.
"""

import numpy as np
import scipy.sparse as sp

from ....problems.arrays import FloatArray
from ....problems.contact.matrices.memory import require_memory
from ....problems.contact.problem import ContactProblem
from ..scaled_problem import ScaledProblem
from .block_lu import REMEDY, BlockLU
from .elimination import MAX_COLUMNS

REFINEMENTS = 2
"""Number of refinements of each solution."""


class DelassusSystem:
    """Ĝ of one problem in block rows, and the factors of Ĝ + D."""

    def __init__(self, problem: ContactProblem, scaled_problem: ScaledProblem) -> None:
        blocks, self._width, self._lanes = problem.delassus_blocks(), problem.layout.width, scaled_problem.lanes
        require_memory(2.0 * blocks.values.nbytes, "the system of interior points", REMEDY)
        starts, columns, values = _symmetric_pattern(blocks.starts, blocks.columns.astype(np.int64), blocks.values)
        row = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        left, right = (
            self._lanes.to_block(scaled_problem.velocity_scale),
            self._lanes.to_block(scaled_problem.impulse_scale),
        )
        self._values: FloatArray = left[row][:, :, None] * values * right[columns][:, None, :]
        self._diagonal = np.flatnonzero(row == columns)
        size = (len(starts) - 1) * self._width
        self._matrix = sp.bsr_array((self._values, columns, starts), shape=(size, size))
        self._summed = self._values.copy()
        # redundant joints, which D regularises little, need all rows of their front as pivot candidates
        max_columns = len(starts) if problem.layout.is_bilateral.any() else MAX_COLUMNS
        self._factors = BlockLU(starts, columns, self._width, max_columns=max_columns)
        self._coupled: FloatArray = np.zeros((0, self._width, self._width))

    @property
    def flops(self) -> float:
        """Multiplications and additions of one factorisation."""
        return self._factors.flops

    def times(self, r: FloatArray) -> FloatArray:
        """Return Ĝ r for r, both of shape (m, w): m cones with w lanes each."""
        return self._lanes.split_from_block(self._times(self._lanes.to_block(r)))

    def factorise(self, coupled: FloatArray) -> bool:
        """Factorise for D of shape (m, w, w); return False if the matrix is singular."""
        self._coupled = self._lanes.matrices_to_block(coupled)
        self._summed[self._diagonal] = self._values[self._diagonal] + self._coupled
        return bool(np.isfinite(self._coupled).all()) and self._factors.factorise(self._summed)

    def determinant_sign(self) -> float:
        """Return the sign of det (Ĝ + D) of the last factorisation, 1 or −1."""
        return self._factors.determinant_sign()

    def solve(self, right: FloatArray, refinements: int = REFINEMENTS) -> FloatArray:
        """Return dr for a right-hand side, both of shape (m, w)."""
        b = self._lanes.sum_to_block(right)
        dr, remainder = np.zeros_like(b), b
        for refinement in range(refinements + 1):
            dr += self._factors.solve(remainder.reshape(-1)).reshape(dr.shape)
            if refinement < refinements:
                remainder = b - self._times(dr) - (self._coupled @ dr[:, :, None])[:, :, 0]
        return self._lanes.from_block(dr)

    def _times(self, lanes: FloatArray) -> FloatArray:
        product: FloatArray = (self._matrix @ lanes.reshape(-1)).reshape(lanes.shape)
        return product


def _symmetric_pattern(
    starts: np.ndarray, columns: np.ndarray, values: FloatArray
) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """Return block rows with a symmetric pattern; missing blocks of an asymmetric matrix become stored zeros."""
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
