"""Cells in which balls are sorted for the search for overlapping pairs.

Cells are as wide as the largest ball that is searched in them, so that such balls are in the same cell or in
neighbouring ones if they overlap. The cells along the first axis have consecutive numbers.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray

MAX_CELLS = 2.0**62
"""Exclusive bound of the number of cells, which 64-bit integers can number; extents of 1e6 diameters have 1e18."""

MAX_EXTENT = 2.0**26
"""Exclusive bound of the number of cells along an axis, for which coordinates relative to the lowest one are exact
enough."""

WIDTH_MARGIN = 1.0 + 2.0**-20
"""Ratio of the width of a cell to the largest diameter. It exceeds the rounding errors of ``MAX_EXTENT`` cells, so that
two balls that overlap are in neighbouring cells."""

CELLS_PER_BALL = 64
"""Largest number of cells per ball for which balls are sorted by counting; scattered balls occupy more cells."""


class Cells(NamedTuple):
    """Balls sorted by the number of their cell.

    Attributes:
        order: balls by ascending cell number, shape (n,).
        number: number of each ball's cell, shape (n,).
        extent_x: number of cells along the first axis.
        extent_y: number of cells along the second axis.
    """

    order: IntArray
    number: IntArray
    extent_x: int
    extent_y: int


def sort_into_cells(centres: FloatArray, radius: float) -> Cells | None:
    """Return balls sorted into cells for balls of a largest radius, or None if a centre is not finite."""
    n, width = len(centres), WIDTH_MARGIN * 2.0 * radius
    number, extent_x, extent_y, n_cells = _cell_numbers(centres, width)
    if n_cells == np.inf:
        if not np.isfinite(centres).all():
            return None
        number, extent_x, extent_y = _occupied_cell_numbers(centres, width)
    order = _counting_sort(number, n_cells) if n_cells <= CELLS_PER_BALL * n else np.argsort(number, kind="stable")
    return Cells(order, number, extent_x, extent_y)


def _occupied_cell_numbers(centres: FloatArray, width: float) -> tuple[IntArray, int, int]:
    """Return what ``_cell_numbers`` does, for finite centres between which the cells are too many to be numbered.

    Along each axis, any number of consecutive empty cells counts as one. The neighbours of a cell remain the same.
    After a gap of more than ``width``, cells begin at the next ball, so that the rounding of large coordinates does
    not separate neighbours. If the cells are still too many, pairs of consecutive ones are merged.
    """
    cells = np.zeros((len(centres), 3), dtype=np.int64)
    for axis, coordinates in enumerate(centres.T):
        order = np.argsort(coordinates)
        ordered = coordinates[order]
        with np.errstate(over="ignore"):
            is_first = np.append(True, np.diff(ordered) > width)
        firsts = ordered[is_first][np.cumsum(is_first) - 1]
        steps = np.diff(np.floor((ordered - firsts) / width), prepend=0.0)
        cells[order, axis] = np.cumsum(np.where(is_first, 2.0, np.fmin(steps, 2.0)).astype(np.int64))
    while np.prod(cells.max(axis=0) + 4.0) >= MAX_CELLS:
        cells //= 2
    cells += 1
    extent = cells.max(axis=0) + 2
    return cells[:, 0] + extent[0] * (cells[:, 1] + extent[1] * cells[:, 2]), int(extent[0]), int(extent[1])


@njit(cache=True)
def _cell_numbers(centres, width):  # type: ignore[no-untyped-def]
    """Return the number of each ball's cell, and the numbers of cells along the first two axes and in total.

    The numbers of cells include a margin of one empty cell on each side. The total is infinite if a centre is not
    finite, or if the cells are too many to be numbered, in total or along an axis.
    """
    n, dim = centres.shape
    cells = np.ones((n, 3), dtype=np.int64)
    extent, n_cells = np.zeros(3, dtype=np.int64), 1.0
    for axis in range(3):
        lowest, highest, nan = np.inf, -np.inf, 0.0
        if axis < dim:
            for i in range(n):
                lowest, highest = min(lowest, centres[i, axis]), max(highest, centres[i, axis])
                nan += 0.0 * centres[i, axis]  # NaN for a coordinate that is not finite
            n_along = np.floor((highest - lowest) / width) + 3.0
            n_cells *= n_along
            if nan != 0.0 or not (n_cells < MAX_CELLS and n_along < MAX_EXTENT):
                return np.empty(n, dtype=np.int64), 0, 0, np.inf
        for i in range(n):
            if axis < dim:
                cells[i, axis] = int(np.floor((centres[i, axis] - lowest) / width)) + 1
            extent[axis] = max(extent[axis], cells[i, axis] + 2)
    number, n_cells = np.empty(n, dtype=np.int64), float(extent[0]) * float(extent[1]) * float(extent[2])
    for i in range(n):
        number[i] = cells[i, 0] + extent[0] * (cells[i, 1] + extent[1] * cells[i, 2])
        n_cells = n_cells if 0 <= number[i] < n_cells else np.inf
    return number, extent[0], extent[1], n_cells


@njit(cache=True)
def _counting_sort(number, n_cells):  # type: ignore[no-untyped-def]
    """Return the balls sorted by the number of their cell, stably."""
    begin = np.zeros(int(n_cells) + 1, dtype=np.int32)
    for i in range(len(number)):
        begin[number[i] + 1] += 1
    for cell in range(len(begin) - 1):
        begin[cell + 1] += begin[cell]
    order = np.empty(len(number), dtype=np.int64)
    for i in range(len(number)):
        order[begin[number[i]]] = i
        begin[number[i]] += 1
    return order
