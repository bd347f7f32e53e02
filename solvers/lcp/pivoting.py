"""Lemke's complementary pivoting with the lexicographic rule (Cottle, Pang & Stone 1992, algorithms 4.4.5 and 4.9.8).

    w = M z + q + d z₀,      w, z, z₀ ≥ 0,      d = (1, …, 1)

The method begins with a z₀ so large that w ≥ 0. At each pivot, the complement of the variable that left last enters the
basis, until z₀ leaves it. The leaving variable is the lexicographic minimum of the rows [β, B⁻¹] over the entering
column, with the basis B and β = B⁻¹ q, so that degenerate problems cannot cycle. The tableau contains the columns of
the nonbasic variables; the columns of B⁻¹ are those of w, which are either stored or unit vectors.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit

from ...problems.arrays import FloatArray

SMALLEST_PIVOTS = (1e-8, 1e-11, 1e-14)
"""Fractions of the largest entry of the entering column below which its entries count as zero.

The first value keeps rounding errors out of the tableau. The other values are tried if the pivoting ends on a ray,
because large mass ratios can make a valid pivot small.
"""

RAY_ROUNDING = 1e-12
"""Mᵀ y of a ray y ≥ 0 is zero up to rounding if it is below this fraction of the largest entry of M."""

FALL_ROUNDING = 1e-6
"""qᵀy must be below zero by this fraction of the largest entry of q. If a feasible z ≥ 0 existed nevertheless, its
entries would be a million times as large as M and q suggest."""

TIE = 1e-13
"""Ratios are tied if they exceed the smallest ratio by at most this, relative to the larger of that ratio and 1."""


class Ending(IntEnum):
    """State of the pivoting; the values are those that the kernel returns."""

    UNFINISHED = 0
    SOLUTION = 1
    RAY = 2


@dataclass(eq=False)
class Tableau:
    """The state of the pivoting on one linear complementarity problem of size n.

    Variables are numbered: w from 0, z from n, and z₀ is 2n.

    Attributes:
        matrix: M, dense, shape (n, n).
        vector: q, shape (n,).
        smallest: size of the smallest pivot relative to its column, one of ``SMALLEST_PIVOTS``.
        ending: state of the pivoting.
        pivots: number of pivots.
    """

    matrix: FloatArray
    vector: FloatArray
    smallest: float = SMALLEST_PIVOTS[0]
    ending: Ending = Ending.UNFINISHED
    pivots: int = 0

    def __post_init__(self) -> None:
        n = len(self.vector)
        self._rows: FloatArray = np.ascontiguousarray(np.column_stack([-self.matrix, -np.ones(n)]))
        largest = float(np.abs(self.vector).max(initial=0.0))
        self._values = np.ldexp(self.vector, -int(np.frexp(largest)[1]))  # scaled exactly, for the test of ties
        self._basic = np.arange(n)
        self._nonbasic = np.arange(n, 2 * n + 1)
        self._entering = 2 * n
        if n == 0 or self.vector.min() >= 0.0:
            self.ending = Ending.SOLUTION

    def advance(self, count: int) -> None:
        """Do at most ``count`` pivots."""
        if self.ending is not Ending.UNFINISHED:
            return
        state = (self._rows, self._values, self._basic, self._nonbasic)
        ending, n_pivots, entering = _pivot(count, *state, self._entering, self.smallest)
        self.ending, self._entering = Ending(ending), entering
        self.pivots += n_pivots

    def solution(self) -> FloatArray:
        """Return z of the current basis, recomputed from M and q to remove the rounding errors of the pivots."""
        n = len(self.vector)
        unknowns = np.zeros(n)
        closed = np.sort(self._basic[(self._basic >= n) & (self._basic < 2 * n)]) - n
        if len(closed) == 0:
            return unknowns
        block, right = self.matrix[np.ix_(closed, closed)], -self.vector[closed]
        try:
            basic_unknowns = np.linalg.solve(block, right)
            basic_unknowns += np.linalg.solve(block, right - block @ basic_unknowns)
        except np.linalg.LinAlgError:
            basic_unknowns = np.linalg.lstsq(block, right, rcond=None)[0]
        if not np.isfinite(basic_unknowns).all():
            basic_unknowns = np.linalg.lstsq(block, right, rcond=None)[0]
        unknowns[closed] = np.maximum(basic_unknowns, 0.0)
        return unknowns

    def proves_infeasibility(self) -> bool:
        """Whether the final ray gives a y ≥ 0 with Mᵀ y ≤ 0 and qᵀ y < 0 that rounding errors do not explain.

        Then yᵀ(M z + q) < 0 for every z ≥ 0, so that no z satisfies M z + q ≥ 0.
        """
        n, column = len(self.vector), int(np.flatnonzero(self._nonbasic == self._entering)[0])
        direction = np.zeros(n)
        is_unknown = (self._basic >= n) & (self._basic < 2 * n)
        direction[self._basic[is_unknown] - n] = -self._rows[is_unknown, column]
        if n <= self._entering < 2 * n:
            direction[self._entering - n] = 1.0
        direction = np.maximum(direction, 0.0)
        largest = float(direction.max(initial=0.0))
        if not 0.0 < largest < np.inf:
            return False
        direction /= largest
        growth = float((direction @ self.matrix).max(initial=0.0))
        fall, size = float(self.vector @ direction), float(np.abs(self.vector).max())
        return growth <= RAY_ROUNDING * float(np.abs(self.matrix).max()) and fall < -FALL_ROUNDING * size


@njit(cache=True)
def _pivot(count, rows, values, basic, nonbasic, entering, smallest):  # type: ignore[no-untyped-def]
    """Do at most ``count`` pivots in place; return the state, the number of pivots, and the next entering variable."""
    n = len(values)
    position = np.empty(2 * n + 1, dtype=np.int64)  # row of a basic variable, −1 − column of a nonbasic one
    for i in range(n):
        position[basic[i]] = i
    for j in range(n + 1):
        position[nonbasic[j]] = -1 - j
    tied = np.empty(n, dtype=np.int64)
    filled = np.empty(n + 1, dtype=np.int64)
    for n_pivots in range(count):
        column = -1 - position[entering]
        if entering == 2 * n and n_pivots == 0 and basic.max() < n:
            row = n - 1 - np.argmin(values[::-1])  # the last of equal entries, the lexicographic minimum of [q, I]
        else:
            row = _leaving_row(rows, values, basic, position, column, tied, smallest)
        if row < 0:
            return 2, n_pivots, entering
        leaving = basic[row]
        _exchange(rows, values, row, column, filled)
        basic[row], nonbasic[column] = entering, leaving
        position[entering], position[leaving] = row, -1 - column
        if leaving == 2 * n:
            return 1, n_pivots + 1, entering
        entering = leaving + n if leaving < n else leaving - n
    return 0, count, entering


@njit(cache=True)
def _leaving_row(rows, values, basic, position, column, tied, smallest):  # type: ignore[no-untyped-def]
    """Return the row of the lexicographic minimum of [β, B⁻¹]/column over positive entries, −1 if there is none.

    The row of z₀ wins every tie in β, because it gives the solution.
    """
    n = len(values)
    largest = 0.0
    for i in range(n):
        largest = max(largest, abs(rows[i, column]))
    threshold = smallest * largest
    min_ratio = np.inf
    for i in range(n):
        if rows[i, column] > threshold:
            min_ratio = min(min_ratio, max(values[i], 0.0) / rows[i, column])
    if min_ratio == np.inf:
        return -1
    limit = min_ratio + TIE * max(1.0, min_ratio)
    count = 0
    for i in range(n):
        if rows[i, column] > threshold and max(values[i], 0.0) / rows[i, column] <= limit:
            if basic[i] == 2 * n:
                return i
            tied[count] = i
            count += 1
    for j in range(n):
        if count == 1:
            break
        lowest = np.inf
        for t in range(count):
            lowest = min(lowest, _inverse_entry(rows, position, tied[t], j) / rows[tied[t], column])
        n_kept = 0
        for t in range(count):
            ratio = _inverse_entry(rows, position, tied[t], j) / rows[tied[t], column]
            if ratio <= lowest + TIE * max(1.0, abs(lowest)):
                tied[n_kept] = tied[t]
                n_kept += 1
        count = n_kept
    return tied[0]


@njit(cache=True)
def _inverse_entry(rows, position, row, j):  # type: ignore[no-untyped-def]
    """Return entry (row, j) of B⁻¹, from the column of w_j, or from the unit matrix if w_j is basic."""
    if position[j] >= 0:
        return 1.0 if position[j] == row else 0.0
    return rows[row, -1 - position[j]]


@njit(cache=True)
def _exchange(rows, values, row, column, filled):  # type: ignore[no-untyped-def]
    """Exchange the basic variable of ``row`` and the nonbasic one of ``column``; zeros are skipped."""
    n, width = rows.shape
    inverse = 1.0 / rows[row, column]
    count = 0
    for j in range(width):
        if j != column and rows[row, j] != 0.0:
            rows[row, j] *= inverse
            filled[count] = j
            count += 1
    rows[row, column] = inverse
    values[row] *= inverse
    is_full = 4 * count > width
    for i in range(n):
        factor = rows[i, column]
        if i == row or factor == 0.0:
            continue
        if is_full:
            for j in range(width):
                rows[i, j] -= factor * rows[row, j]
        else:
            for f in range(count):
                rows[i, filled[f]] -= factor * rows[row, filled[f]]
        rows[i, column] = -factor * inverse
        values[i] -= factor * values[row]
