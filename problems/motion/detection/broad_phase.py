"""Which pairs of balls overlap: a cell list that costs time and memory proportional to the number of balls.

Cells are as wide as the largest ball. Balls are sorted by the number of their cell; because neighbours along the first
axis have consecutive numbers, each ball needs a few ranges of cells, whose beginnings only move forward.
"""

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray

USUAL_PAIRS = 8
"""Pairs per ball for which there is room at first; equal balls that do not interpenetrate have at most 6."""

SKIN = 0.05
"""Gap over the smallest radius below which pairs count as near: all passes of a projection, and many steps of a pile at
rest, share one search. A larger skin holds more pairs, all of which are looked at every time."""


class NearPairs:
    """Pairs of balls that may overlap, found again when a ball has moved so far that another one may have come near."""

    def __init__(self, radii: FloatArray) -> None:
        self._radii = radii
        self._skin = SKIN * float(radii.min(initial=np.inf))
        self._found: tuple[FloatArray, IntArray] | None = None

    def at(self, centres: FloatArray) -> IntArray:
        """Return all pairs i < j that overlap at ``centres`` and some that do not, sorted by i, then j."""
        found = self._found
        if found is None or not _all_near(found[0], centres, 0.499 * self._skin):
            found = self._found = centres.copy(), overlapping_pairs(centres, self._radii + 0.5 * self._skin)
        return found[1]


def overlapping_pairs(centres: FloatArray, radii: FloatArray) -> IntArray:
    """Return all pairs i < j with ‖x_i − x_j‖ < r_i + r_j, sorted by i, then j.

    Args:
        centres: x [m], shape (n, 2) or (n, 3).
        radii: r [m], shape (n,).

    Returns:
        Pairs, shape (n_pairs, 2).
    """
    n = len(centres)
    if n < 2:
        return np.zeros((0, 2), dtype=np.int64)
    number, extent_x, extent_y = _cell_numbers(centres, 2.0 * radii.max())
    order = np.argsort(number, kind="stable")
    x, y = centres[order, 0], centres[order, 1]  # in the order of cells, so that reading is local
    z, r = centres[order, 2] if centres.shape[1] == 3 else np.zeros(n), radii[order]
    keys = np.empty(USUAL_PAIRS * n, dtype=np.int64)
    count = _pairs(x, y, z, r, order, number[order], extent_x, extent_y, keys)
    if count > len(keys):
        keys = np.empty(count, dtype=np.int64)
        _pairs(x, y, z, r, order, number[order], extent_x, extent_y, keys)
    keys = keys[:count]
    keys.sort()
    return _pairs_of(keys, n)  # type: ignore[no-any-return]


@njit(cache=True)
def _all_near(centres, others, distance):  # type: ignore[no-untyped-def]
    """Return whether no centre is farther than ``distance`` from its other one; NaN is."""
    n, dim = centres.shape
    for i in range(n):
        squared = 0.0
        for axis in range(dim):
            squared += (centres[i, axis] - others[i, axis]) ** 2
        if not squared <= distance**2:
            return False
    return True


@njit(cache=True)
def _cell_numbers(centres, width):  # type: ignore[no-untyped-def]
    """Return the number of each ball's cell, and how many cells there are along the first two axes, margins counted."""
    n, dim = centres.shape
    cells = np.ones((n, 3), dtype=np.int64)
    extent = np.zeros(3, dtype=np.int64)
    for axis in range(3):
        lowest = np.inf
        if axis < dim:
            for i in range(n):
                lowest = min(lowest, centres[i, axis])
        for i in range(n):
            if axis < dim:
                cells[i, axis] = int(np.floor((centres[i, axis] - lowest) / width)) + 1
            extent[axis] = max(extent[axis], cells[i, axis] + 2)
    number = np.empty(n, dtype=np.int64)
    for i in range(n):
        number[i] = cells[i, 0] + extent[0] * (cells[i, 1] + extent[1] * cells[i, 2])
    return number, extent[0], extent[1]


@njit(cache=True)
def _pairs_of(keys, n):  # type: ignore[no-untyped-def]
    """Return the pairs i, j of keys i · n + j, shape (n_pairs, 2)."""
    pairs = np.empty((len(keys), 2), dtype=np.int64)
    for k in range(len(keys)):
        pairs[k, 0] = keys[k] // n
        pairs[k, 1] = keys[k] - n * pairs[k, 0]
    return pairs


@njit(cache=True)
def _pairs(x, y, z, r, order, number, extent_x, extent_y, keys):  # type: ignore[no-untyped-def]
    """Write i · n + j of every overlapping pair i < j, unsorted, as far as there is room; return how many there are.

    Each ball looks at the rest of its own row of cells and at the four rows that come later: a pair is seen once. Balls
    are visited by rising cell number, so where a row begins only moves forward.
    """
    n, room = len(x), len(keys)
    count = 0
    for row in (0, extent_x, extent_x * (extent_y - 1), extent_x * extent_y, extent_x * (extent_y + 1)):
        begin = 0
        for a in range(n):
            lowest = number[a] + row - 1
            begin = max(begin, a + 1)
            while begin < n and number[begin] < lowest:
                begin += 1
            x_a, y_a, z_a, r_a, i = x[a], y[a], z[a], r[a], order[a]
            for b in range(begin, n):
                if number[b] > lowest + 2:
                    break
                dx, dy, dz, reach = x_a - x[b], y_a - y[b], z_a - z[b], r_a + r[b]
                if dx * dx + dy * dy + dz * dz < reach * reach:
                    if count < room:
                        j = order[b]
                        keys[count] = i * n + j if i < j else j * n + i
                    count += 1
    return count
