"""The linear systems of Newton steps, solved only where that ends in time.

Each step solves J δ = right (``linearised``), in impulses scaled by √α, so that neither the units nor the mass ratios
of contacts decide over pivots:

    (D J D + damping · I) y = D right,      δ = D y,      D = diag(1/√α).

A factorisation cannot be interrupted, and on twenty thousand contacts packed in space one takes a minute. Before each
the time it will take is predicted from those already measured, of z entries in t seconds:

    t' = SLACK · t · max(1, z'/z)³.

Exponents of 1.2 (flow) to 4.6 (the last part of a dense packing) were measured, the larger ones over less than a
doubling. If a system is larger than what has been measured, and might not end in time, leading parts of it are
factorised first, each of twice the rows of the one before, until the prediction is either short or surely too long.
Rows are ordered by reverse Cuthill–McKee, so that a part hangs together as the whole does. Neither the parts nor their
solutions enter the iterates.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import SuperLU, splu

from ...problems.arrays import FloatArray
from ..iteration.clock import Clock
from .linearised import Linearised
from .work import Work

PIVOT_THRESHOLD = 0.1
"""A diagonal pivot is taken unless it is below this fraction of its column: that keeps the factors sparse."""

SLACK = 2.0
"""What a prediction is multiplied with."""

EXPONENT = 3.0
"""Growth of the time with the entries: 1.5 for a dense matrix and for grids in the plane, 2 and more in space."""

FIRST_PART = 500
"""Rows of the first part that is factorised to learn the time."""

SMALL, SMALL_SECONDS = 10_000, 5e-3
"""Entries of a system before anything was measured, and the seconds that these surely do not exceed by much."""


class LinearSolver:
    """Solves the systems of the Newton steps of one solve, and adds each step to the work.

    Attributes:
        lacks_time: whether a system was left unsolved because that might not have ended in time.
    """

    def __init__(self, clock: Clock, work: Work) -> None:
        self._clock, self._work, self.lacks_time = clock, work, False
        self._rows, self._entries, self._seconds = FIRST_PART // 2, SMALL, SMALL_SECONDS

    def solve(self, system: Linearised, scale: FloatArray, damping: float) -> FloatArray | None:
        """Return δ [N s] over the active rows, or None where there is none or it would come too late.

        ``scale`` is 1/√α of these rows, shape (n_active,); ``damping`` weighs δ relative to α.
        """
        if isinstance(system.matrix, np.ndarray):
            return self._solved_densely(system.matrix, system.right, scale, damping)
        scaling = sp.diags_array(scale)
        matrix = sp.csr_array(scaling @ system.matrix @ scaling + damping * sp.eye_array(len(scale)))
        self.lacks_time = not self._ends_in_time(matrix)
        if self.lacks_time:
            return None
        began = self._clock.used
        factors = factorised(matrix)
        if factors is None:
            return None
        step = np.asarray(scale * factors.solve(scale * system.right))
        self._note(matrix, self._clock.used - began)
        self._work.count_step(len(scale), factors.nnz)
        return step

    def _solved_densely(
        self, matrix: FloatArray, right: FloatArray, scale: FloatArray, damping: float
    ) -> FloatArray | None:
        """Solve a small system; it takes no time worth predicting."""
        scaled = scale[:, np.newaxis] * matrix * scale
        scaled[np.diag_indices(len(scale))] += damping
        self._work.count_dense_step(len(scale))
        try:
            step: FloatArray = scale * np.linalg.solve(scaled, scale * right)
        except np.linalg.LinAlgError:
            return None
        return step

    def _ends_in_time(self, matrix: sp.csr_array) -> bool:
        """Whether a factorisation ends before the deadline, as far as can be known; learn more where it is worth it."""
        order = None
        while self._predicted(matrix.nnz) > self._clock.left:
            rows = 2 * self._rows
            if rows >= matrix.shape[0]:
                return False
            order = reverse_cuthill_mckee(sp.csr_matrix(matrix), symmetric_mode=True) if order is None else order
            part = sp.csr_array(matrix[order[:rows]][:, order[:rows]])
            if self._predicted(part.nnz) > self._clock.left:
                return False
            began = self._clock.used
            if factorised(part) is None:
                return False
            self._note(part, self._clock.used - began)
        return True

    def _predicted(self, entries: int) -> float:
        """Return the seconds that a system of so many entries may take."""
        return float(SLACK * self._seconds * max(1.0, entries / self._entries) ** EXPONENT)

    def _note(self, matrix: sp.csr_array, seconds: float) -> None:
        """Keep a measured time, unless a larger system is known that took longer; small ones all count as SMALL."""
        entries = max(matrix.nnz, SMALL)
        if entries >= self._entries or seconds >= self._seconds:
            self._entries, self._seconds = entries, seconds
        self._rows = max(self._rows, matrix.shape[0])


def factorised(matrix: sp.csr_array) -> SuperLU | None:
    """Return the triangular factors of a square matrix, or None if it is exactly singular."""
    try:
        return splu(
            sp.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=PIVOT_THRESHOLD,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None
