"""Solution of the linear systems of Newton steps, if the deadline permits.

Each step solves J δ = right (``linearised``) in impulses scaled by √α, so that pivots depend neither on units nor on
mass ratios:

    (D J D + damping · I) y = D right,      δ = D y,      D = diag(1/√α).

A factorisation cannot be interrupted, and on twenty thousand densely packed contacts it takes a minute. Its time is
therefore predicted from that of an earlier one. If a matrix with z entries took t seconds, one with z' entries is
expected to take at most

    t' = SLACK · t · max(1, z'/z)³.

Measured exponents range from 1.2 (flow) to 4.6 (the last part of a dense packing). The larger exponents hold only while
z grows by less than a factor of two. If a system is larger than all measured ones and may miss the deadline, leading
parts of it are factorised first. Their number of rows doubles until the prediction is either short enough or certainly
too long. Rows are in reverse Cuthill–McKee order, so that a part has the connectivity of the whole. The parts do not
affect the iterates.
"""

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ..iteration.stopping import Clock
from .linearised import LinearSystem
from .work import Work

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

PIVOT_THRESHOLD = 0.1
"""Diagonal pivots keep the factors sparse; they are used unless below this fraction of their column's largest entry."""

SLACK = 2.0
"""Safety factor of a prediction."""

EXPONENT = 3.0
"""Exponent of the predicted time in the number of entries. In theory, it is 1.5 for dense matrices and planar grids,
and 2 or more for spatial grids."""

FIRST_PART_ROWS = 500
"""Number of rows of the first part that is factorised to measure the time."""

SMALL_ENTRIES, SMALL_SECONDS = 10_000, 5e-3
"""Number of entries and time [s] of a small system, assumed before the first measurement."""


class LinearSolver:
    """Solver of the linear systems of one solve, which counts their work.

    Attributes:
        lacks_time: whether a system was skipped because it might have missed the deadline.
    """

    def __init__(self, clock: Clock, work: Work) -> None:
        self._clock, self._work, self.lacks_time = clock, work, False
        self._rows, self._entries, self._seconds = FIRST_PART_ROWS // 2, SMALL_ENTRIES, SMALL_SECONDS

    def solve(self, system: LinearSystem, scale: FloatArray, damping: float) -> FloatArray | None:
        """Return δ [N s], shape (n_active,), or None if the system is singular or might miss the deadline.

        ``scale`` is 1/√α of these rows, shape (n_active,); ``damping`` is the weight of δ relative to α.
        """
        if isinstance(system.matrix, np.ndarray):
            return self._solve_densely(system.matrix, system.right, scale, damping)
        scaling = sp.diags_array(scale)
        matrix = sp.csr_array(scaling @ system.matrix @ scaling + damping * sp.eye_array(len(scale)))
        self.lacks_time = not self._meets_deadline(matrix)
        if self.lacks_time:
            return None
        start = self._clock.elapsed
        factors = factorise(matrix)
        if factors is None:
            return None
        step = np.asarray(scale * factors.solve(scale * system.right))
        self._record(matrix, self._clock.elapsed - start)
        self._work.count_step(len(scale), factors.nnz)
        return step

    def _solve_densely(
        self, matrix: FloatArray, right: FloatArray, scale: FloatArray, damping: float
    ) -> FloatArray | None:
        """Solve a small system, whose time needs no prediction."""
        scaled = scale[:, np.newaxis] * matrix * scale
        scaled[np.diag_indices(len(scale))] += damping
        self._work.count_dense_step(len(scale))
        try:
            step: FloatArray = scale * np.linalg.solve(scaled, scale * right)
        except np.linalg.LinAlgError:
            return None
        return step

    def _meets_deadline(self, matrix: sp.csr_array) -> bool:
        """Whether a factorisation is expected to meet the deadline; if that is uncertain, factorise parts first."""
        from scipy.sparse.csgraph import reverse_cuthill_mckee  # imported here because the import takes 0.1 s

        order = None
        while self._predict(matrix.nnz) > self._clock.remaining:
            rows = 2 * self._rows
            if rows >= matrix.shape[0]:
                return False
            order = reverse_cuthill_mckee(sp.csr_matrix(matrix), symmetric_mode=True) if order is None else order
            leading_block = sp.csr_array(matrix[order[:rows]][:, order[:rows]])
            if self._predict(leading_block.nnz) > self._clock.remaining:
                return False
            start = self._clock.elapsed
            if factorise(leading_block) is None:
                return False
            self._record(leading_block, self._clock.elapsed - start)
        return True

    def _predict(self, entries: int) -> float:
        """Return the predicted seconds of a system with ``entries`` entries."""
        return float(SLACK * self._seconds * max(1.0, entries / self._entries) ** EXPONENT)

    def _record(self, matrix: sp.csr_array, seconds: float) -> None:
        """Record a measured time, unless a larger system has taken longer."""
        entries = max(matrix.nnz, SMALL_ENTRIES)
        if entries >= self._entries or seconds >= self._seconds:
            self._entries, self._seconds = entries, seconds
        self._rows = max(self._rows, matrix.shape[0])


def factorise(matrix: sp.csr_array) -> "SuperLU | None":
    """Return the triangular factors of a square matrix, or None if it is exactly singular."""
    from scipy.sparse.linalg import splu  # imported here because the import takes 0.1 s

    try:
        return splu(
            sp.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=PIVOT_THRESHOLD,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None
