"""Which pairs of balls overlap: a cell list that costs time and memory proportional to the number of balls.

Cells are as wide as the largest ball. Balls are sorted by the number of their cell; because neighbours along the first
axis have consecutive numbers, each ball asks for a few ranges of cells, whose beginnings only move forward.
"""

import numpy as np
from numba import njit

from .laws import FloatArray, IntArray


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
    cells = np.floor((centres - centres.min(axis=0)) / (2.0 * radii.max())).astype(np.int64) + 1
    if cells.shape[1] == 2:
        cells = np.column_stack([cells, np.ones(n, dtype=np.int64)])
    extent = cells.max(axis=0) + 2
    number = cells[:, 0] + extent[0] * (cells[:, 1] + extent[1] * cells[:, 2])
    order = np.argsort(number, kind="stable")
    keys = _pairs(centres, radii, order, number[order], extent[0], extent[1])
    keys.sort()
    return np.column_stack([keys // n, keys % n])


@njit(cache=True)
def _pairs(centres, radii, order, number, extent_x, extent_y):  # type: ignore[no-untyped-def]
    """Return i · n + j of every overlapping pair i < j, unsorted.

    Each ball looks at the rest of its own row of cells and at the four rows that come later: a pair is seen once. Balls
    are visited by rising cell number, so where a row begins only moves forward.
    """
    n, dim = centres.shape
    found = np.empty(8 * n, dtype=np.int64)
    count = 0
    rows = (0, extent_x, extent_x * (extent_y - 1), extent_x * extent_y, extent_x * (extent_y + 1))
    begins = np.zeros(len(rows), dtype=np.int64)
    for position in range(n):
        i = order[position]
        for row in range(len(rows)):
            lowest = number[position] + rows[row] - 1
            begin = max(begins[row], position + 1)
            while begin < n and number[begin] < lowest:
                begin += 1
            begins[row] = begin
            for other in range(begin, n):
                if number[other] > lowest + 2:
                    break
                j = order[other]
                distance = 0.0
                for axis in range(dim):
                    distance += (centres[i, axis] - centres[j, axis]) ** 2
                if distance < (radii[i] + radii[j]) ** 2:
                    if count == len(found):
                        larger = np.empty(2 * count, dtype=np.int64)
                        larger[:count] = found
                        found = larger
                    found[count] = min(i, j) * n + max(i, j)
                    count += 1
    return found[:count]
