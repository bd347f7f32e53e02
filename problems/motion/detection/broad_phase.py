"""Detection of overlapping balls or bounding spheres by a cell list, in time and memory proportional to their number.

Cells are as wide as the largest ball. Balls are sorted by the number of their cell. Neighbours along the first axis
have consecutive numbers, so the search visits a few ranges of cells per ball. The starts of these ranges only
move forward.
"""

import numpy as np
from numba import njit, uint64

from ...arrays import FloatArray, IntArray

USUAL_PAIRS = 8
"""Initial capacity in pairs per ball; equal balls that do not interpenetrate have at most 6."""

MIN_SKIN, MAX_SKIN = 0.025, 0.75
"""Bounds of the skin of a ball, relative to the smallest radius."""

MIN_QUERIES, MAX_QUERIES = 3.0, 15.0
"""Bounds of the number of queries for which a search should remain valid. A step makes one query for contacts, one for
overlaps, and one after each pass of the projection. More queries require wider skins, which add pairs that each query
must visit."""

SKIN_SHARE = 0.998
"""Share of its skin by which a ball may move; less than 1, so that no pair is missed because of rounding."""

SPEED_MARGIN = 1.1
"""Factor by which a ball may become faster between two searches without leaving its skin."""


class NearPairs:
    """Pairs of balls that may overlap; the search is repeated when balls have moved far enough to form new pairs.

    Each ball has a skin. Pairs are near if their gap is less than the sum of both skins, so a search remains valid
    until a ball moves farther than its own skin. Skins are proportional to the speeds of their balls since the last
    search, within bounds, so that a few fast balls add few pairs to those of many slow ones. Skins should suffice for
    as many queries as the upper bound allows for the fastest ball, between ``MIN_QUERIES`` and ``MAX_QUERIES``.
    """

    def __init__(self, radii: FloatArray) -> None:
        self._radii = radii
        smallest = float(radii.min(initial=np.inf))
        self._bounds = MIN_SKIN * smallest, MAX_SKIN * smallest
        self._skins, self._queries = np.full(len(radii), self._bounds[0]), 0
        self._last_search: tuple[FloatArray, IntArray] | None = None

    def at(self, centres: FloatArray) -> IntArray:
        """Return the pairs of near balls: all that overlap, and some that do not.

        Args:
            centres: x [m], shape (n, 2) or (n, 3).

        Returns:
            Pairs i < j, sorted by i, then j, shape (n_pairs, 2).
        """
        self._queries += 1
        if self._last_search is not None:
            if _are_within(self._skins, self._last_search[0], centres):
                return self._last_search[1]
            self._skins = _skins(self._last_search[0], centres, self._queries, *self._bounds)
        self._queries = 0
        self._last_search = centres.copy(), overlapping_pairs(centres, self._radii + self._skins)
        return self._last_search[1]


def overlapping_pairs(centres: FloatArray, radii: FloatArray) -> IntArray:
    """Return all pairs i < j with ‖x_i − x_j‖ < r_i + r_j, sorted by i, then j.

    Balls at positions that are not finite belong to no pair.

    Args:
        centres: x [m], shape (n, 2) or (n, 3).
        radii: r [m], shape (n,).

    Returns:
        Pairs, shape (n_pairs, 2).
    """
    n = len(centres)
    if n < 2:
        return np.zeros((0, 2), dtype=np.int64)
    width = WIDTH_MARGIN * 2.0 * radii.max()
    number, extent_x, extent_y, n_cells = _cell_numbers(centres, width)
    if n_cells == np.inf:
        finite = np.flatnonzero(np.isfinite(centres).all(axis=1))
        if len(finite) < n:
            found: IntArray = finite[overlapping_pairs(centres[finite], radii[finite])]
            return found
        number, extent_x, extent_y = _occupied_cell_numbers(centres, width)
    order = _counting_sort(number, n_cells) if n_cells <= CELLS_PER_BALL * n else np.argsort(number, kind="stable")
    buffer = np.empty((USUAL_PAIRS * n, 2), dtype=np.int64)
    arguments = centres, radii, order, number, extent_x, extent_y
    count = _write_pairs(*arguments, buffer)
    if count > len(buffer):
        buffer = np.empty((count, 2), dtype=np.int64)
        _write_pairs(*arguments, buffer)
    pairs: IntArray = _sorted_pairs(buffer[:count], n)
    return pairs


def near_bodies(centres: FloatArray, radii: FloatArray, n_moving: int, margin: float, excluded: IntArray) -> IntArray:
    """Return the pairs of bodies whose bounding spheres are closer than ``margin``, sorted by i, then j.

    Args:
        centres: x of all bodies [m], those of fixed ones last, shape (n, 3).
        radii: radii of the bounding spheres [m], infinite for half-spaces, shape (n,).
        n_moving: number of moving bodies; pairs of two fixed ones are not returned.
        margin: distance between bounding spheres [m].
        excluded: i · n + j of the pairs to omit, ascending, shape (n_excluded,).

    Returns:
        Pairs i < j, shape (n_pairs, 2).
    """
    moving = overlapping_pairs(centres[:n_moving], radii[:n_moving] + 0.5 * margin)
    pairs: IntArray = _with_fixed(moving, centres, radii, n_moving, margin, excluded)
    return pairs


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


@njit(cache=True)
def _are_within(skins, centres, moved_centres):  # type: ignore[no-untyped-def]
    """Return whether all balls are within their skins of ``centres``; False if a coordinate is NaN."""
    n, dim = centres.shape
    for i in range(n):
        squared = 0.0
        for axis in range(dim):
            squared += (centres[i, axis] - moved_centres[i, axis]) ** 2
        if not squared <= (SKIN_SHARE * skins[i]) ** 2:
            return False
    return True


@njit(cache=True)
def _skins(centres, moved_centres, queries, smallest, largest):  # type: ignore[no-untyped-def]
    """Return the skins for balls that moved from ``centres`` to ``moved_centres`` within a number of queries."""
    n, dim = centres.shape
    skins, farthest = np.empty(n), 0.0
    for i in range(n):
        squared = 0.0
        for axis in range(dim):
            squared += (centres[i, axis] - moved_centres[i, axis]) ** 2
        skins[i] = SPEED_MARGIN * np.sqrt(squared) / queries  # for one query
        farthest = max(farthest, skins[i])
    n_queries = MIN_QUERIES
    if MIN_QUERIES * farthest < largest:
        n_queries = MAX_QUERIES if MAX_QUERIES * farthest < largest else largest / farthest
    for i in range(n):
        skin = n_queries * skins[i]
        skins[i] = smallest if not skin > smallest else min(skin, largest)
    return skins


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
        lowest, highest = np.inf, -np.inf
        if axis < dim:
            for i in range(n):
                lowest, highest = min(lowest, centres[i, axis]), max(highest, centres[i, axis])
            n_along = np.floor((highest - lowest) / width) + 3.0
            n_cells *= n_along
            if not (n_cells < MAX_CELLS and n_along < MAX_EXTENT):
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


@njit(cache=True)
def _write_pairs(centres, radii, order, number, extent_x, extent_y, pairs):  # type: ignore[no-untyped-def]
    """Write the overlapping pairs i < j, unsorted, up to the capacity; return their total number.

    Each ball is tested against the rest of its own row of cells and the four adjacent rows of higher numbers,
    so that each pair is tested once. Balls are visited by ascending cell number, so both ends of a range of balls only
    move forward. Unsigned indices need no test for negative ones.
    """
    n, dim, one = uint64(len(centres)), centres.shape[1], uint64(1)
    balls, cells = np.zeros((n, 4)), np.empty(n, dtype=np.int64)  # in the order of cells, for local memory access
    for a in range(n):
        ball = uint64(order[a])
        cells[a] = number[ball]
        for axis in range(dim):
            balls[a, axis] = centres[ball, axis]
        balls[a, 3] = radii[ball]
    count, capacity = uint64(0), uint64(len(pairs))
    for row in (0, extent_x, extent_x * (extent_y - 1), extent_x * extent_y, extent_x * (extent_y + 1)):
        begin, end = uint64(0), uint64(0)
        for a in range(n):
            lowest = cells[a] + row - 1
            begin = max(begin, a + one)
            while begin < n and cells[begin] < lowest:
                begin += one
            end = max(begin, end)
            while end < n and cells[end] <= lowest + 2:
                end += one
            i, x, y, z, r = order[a], balls[a, 0], balls[a, 1], balls[a, 2], balls[a, 3]
            for b in range(begin, end):
                dx, dy, dz, reach = x - balls[b, 0], y - balls[b, 1], z - balls[b, 2], r + balls[b, 3]
                if dx * dx + dy * dy + dz * dz < reach * reach:
                    if count < capacity:
                        j = order[b]
                        pairs[count, 0], pairs[count, 1] = min(i, j), max(i, j)
                    count += one
    return count


@njit(cache=True)
def _sorted_pairs(pairs, n):  # type: ignore[no-untyped-def]
    """Return pairs sorted by i (counting sort), then by j (insertion sort, because few pairs share a ball)."""
    begin = np.zeros(n + 1, dtype=np.int64)
    for k in range(len(pairs)):
        begin[pairs[k, 0] + 1] += 1
    for i in range(n):
        begin[i + 1] += begin[i]
    ends, sorted_pairs = begin[:-1].copy(), np.empty_like(pairs)
    for k in range(len(pairs)):
        i, j = pairs[k]
        slot = ends[i]
        ends[i] += 1
        while slot > begin[i] and sorted_pairs[slot - 1, 1] > j:
            sorted_pairs[slot, 0], sorted_pairs[slot, 1] = i, sorted_pairs[slot - 1, 1]
            slot -= 1
        sorted_pairs[slot, 0], sorted_pairs[slot, 1] = i, j
    return sorted_pairs


@njit(cache=True)
def _with_fixed(moving, centres, radii, n_moving, margin, excluded):  # type: ignore[no-untyped-def]
    """Return the sorted pairs of moving bodies with each other and with fixed ones, without the excluded pairs."""
    n = len(centres)
    pairs = np.empty((len(moving) + n_moving * (n - n_moving), 2), dtype=np.int64)
    count, begin, next_excluded = 0, 0, 0
    for i in range(n_moving):
        end = begin
        while end < len(moving) and moving[end, 0] == i:
            end += 1
        for k in range(end - begin + n - n_moving):
            if k < end - begin:
                j = moving[begin + k, 1]
            else:
                j, squared = n_moving + k - (end - begin), 0.0
                for axis in range(3):
                    squared += (centres[i, axis] - centres[j, axis]) ** 2
                if not np.sqrt(squared) < radii[i] + radii[j] + margin:
                    continue
            while next_excluded < len(excluded) and excluded[next_excluded] < i * n + j:
                next_excluded += 1
            if next_excluded < len(excluded) and excluded[next_excluded] == i * n + j:
                continue
            pairs[count, 0], pairs[count, 1] = i, j
            count += 1
        begin = end
    return pairs[:count]
