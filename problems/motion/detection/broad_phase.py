"""Detection of overlapping balls or bounding spheres by a cell list, in time and memory proportional to their number.

Cells are as wide as the largest ball that is searched in them. Balls are sorted by the number of their cell. Neighbours
along the first axis have consecutive numbers, so the search visits a few ranges of cells per ball. The starts of these
ranges only move forward. If few balls are much larger than the others, the others are searched in narrower cells, and
the large ones in wide cells.
"""

import numpy as np
from numba import njit, uint64

from ...arrays import FloatArray, IntArray
from .cells import Cells, sort_into_cells

USUAL_PAIRS = 8
"""Initial capacity in pairs per ball; equal balls that do not interpenetrate have at most 6."""

MIN_SKIN, MAX_SKIN = 0.025, 0.75
"""Bounds of the skin of a ball, relative to the smallest radius."""

MAX_SKIN_OF_FEW, FEW = 2.0, 0.15
"""Upper bound of the skin in place of ``MAX_SKIN``, if the share of balls whose skins exceed ``MAX_SKIN`` is at most
``FEW``: a few wide skins add few pairs."""

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
        self._bounds = MIN_SKIN * smallest, MAX_SKIN * smallest, MAX_SKIN_OF_FEW * smallest
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
    largest, largest_of_small = _limits_of_radii(radii)
    cells = sort_into_cells(centres, largest_of_small)
    if cells is None:
        finite = np.flatnonzero(np.isfinite(centres).all(axis=1))
        found: IntArray = finite[overlapping_pairs(centres[finite], radii[finite])]
        return found
    wide_cells = None if largest_of_small == largest else sort_into_cells(centres, largest)
    buffer = np.empty((USUAL_PAIRS * n + 1, 2), dtype=np.int64)
    count = _write_all_pairs(centres, radii, largest_of_small, cells, wide_cells, buffer)
    if count >= len(buffer):
        buffer = np.empty((count + 1, 2), dtype=np.int64)
        _write_all_pairs(centres, radii, largest_of_small, cells, wide_cells, buffer)
    pairs: IntArray = _sorted_pairs(buffer[:count], n)
    return pairs


def _limits_of_radii(radii: FloatArray) -> tuple[float, float]:
    """Return the largest radius, and a limit of the radii of small balls, which is less if large balls are few."""
    largest, limit, n_large = _count_large(radii)
    if not limit < largest:
        return largest, largest
    is_worthwhile = (limit / largest) ** 3 + 2.0 * n_large / len(radii) < MAX_SHARE_OF_TESTS
    return largest, limit if is_worthwhile else largest


def _write_all_pairs(
    centres: FloatArray,
    radii: FloatArray,
    largest_of_small: float,
    cells: Cells,
    wide_cells: Cells | None,
    pairs: IntArray,
) -> int:
    """Write the overlapping pairs i < j, unsorted, into all rows but the last; return their total number."""
    count: int = _write_pairs(centres, radii, largest_of_small, *cells, pairs)
    if wide_cells is not None:
        count = _add_pairs_of_large_balls(centres, radii, largest_of_small, *wide_cells, count, pairs)
    return count


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


LARGE_RATIO = 1.15
"""Ratio of the radius of a large ball to the mean radius."""

MAX_SHARE_OF_TESTS = 0.6
"""Largest estimated share of the tests of pairs in wide cells for which small and large balls are searched separately.
In space, a small ball is tested in a volume that is smaller by the cube of the ratio of the widths. A large one is
tested in all neighbouring cells instead of half of them."""


@njit(cache=True)
def _count_large(radii):  # type: ignore[no-untyped-def]
    """Return the largest radius, the limit of the radii of small balls, and the number of large balls."""
    largest, total, n_large = 0.0, 0.0, 0
    for k in range(len(radii)):
        largest, total = max(largest, radii[k]), total + radii[k]
    limit = LARGE_RATIO * total / len(radii)
    for k in range(len(radii)):
        n_large += radii[k] > limit
    return largest, limit, n_large


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
def _skins(centres, moved_centres, queries, smallest, largest, largest_of_few):  # type: ignore[no-untyped-def]
    """Return the skins for balls that moved from ``centres`` to ``moved_centres`` within a number of queries."""
    n, dim = centres.shape
    skins, farthest = np.empty(n), 0.0
    for i in range(n):
        squared = 0.0
        for axis in range(dim):
            squared += (centres[i, axis] - moved_centres[i, axis]) ** 2
        skins[i] = SPEED_MARGIN * np.sqrt(squared) / queries  # for one query
        farthest = max(farthest, skins[i])
    n_queries, n_wide = _queries_for(farthest, largest_of_few), 0
    for i in range(n):
        n_wide += n_queries * skins[i] > largest
    bound = largest_of_few
    if n_wide > FEW * n:
        bound, n_queries = largest, _queries_for(farthest, largest)
    for i in range(n):
        skin = n_queries * skins[i]
        skins[i] = smallest if not skin > smallest else min(skin, bound)
    return skins


@njit(cache=True)
def _queries_for(farthest, largest):  # type: ignore[no-untyped-def]
    """Return for how many queries skins suffice if the fastest ball moves by ``farthest`` in each, within bounds."""
    if not MIN_QUERIES * farthest < largest:
        return MIN_QUERIES
    return MAX_QUERIES if MAX_QUERIES * farthest < largest else largest / farthest


@njit(cache=True)
def _in_order_of_cells(centres, radii, limit, order, number):  # type: ignore[no-untyped-def]
    """Return x and r, cells and numbers of the balls with r ≤ ``limit``, in the order of cells, for local access."""
    n, dim, count = uint64(len(order)), centres.shape[1], uint64(0)
    balls, cells, numbers = np.zeros((n, 4)), np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    for a in range(n):
        ball = uint64(order[a])
        if radii[ball] <= limit:
            cells[count], numbers[count] = number[ball], ball
            for axis in range(dim):
                balls[count, axis] = centres[ball, axis]
            balls[count, 3] = radii[ball]
            count += uint64(1)
    return balls[:count], cells[:count], numbers[:count]


@njit(cache=True)
def _write_pairs(centres, radii, largest, order, number, extent_x, extent_y, pairs):  # type: ignore[no-untyped-def]
    """Write the overlapping pairs i < j of balls up to the largest radius; see ``_write_all_pairs``.

    Each ball is tested against the rest of its own row of cells and the four adjacent rows of higher numbers,
    so that each pair is tested once. Balls are visited by ascending cell number, so both ends of a range of balls only
    move forward. Unsigned indices need no test for negative ones.
    """
    balls, cells, numbers = _in_order_of_cells(centres, radii, largest, order, number)
    n, one, count = uint64(len(cells)), uint64(1), uint64(0)
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
            i, x, y, z, r = numbers[a], balls[a, 0], balls[a, 1], balls[a, 2], balls[a, 3]
            for b in range(begin, end):
                _write_pair(i, numbers[b], count, pairs)
                count += uint64(_overlaps(x, y, z, r, balls, b))
    return count


@njit(cache=True, inline="always")
def _overlaps(x, y, z, r, balls, b):  # type: ignore[no-untyped-def]
    """Return whether a ball with centre (x, y, z) and radius r overlaps ball ``b`` of ``_in_order_of_cells``."""
    dx, dy, dz, reach = x - balls[b, 0], y - balls[b, 1], z - balls[b, 2], r + balls[b, 3]
    return dx * dx + dy * dy + dz * dz < reach * reach


@njit(cache=True, inline="always")
def _write_pair(i, j, count, pairs):  # type: ignore[no-untyped-def]
    """Write a pair after ``count`` others, or into the last row if there is no space for it.

    The next pair replaces it unless the balls overlap: a branch would often be mispredicted.
    """
    row = min(count, uint64(len(pairs)) - uint64(1))
    pairs[row, 0], pairs[row, 1] = min(i, j), max(i, j)


@njit(cache=True)
def _add_pairs_of_large_balls(centres, radii, limit, order, number, extent_x, extent_y, count, pairs):  # type: ignore[no-untyped-def]
    """Add the overlapping pairs of balls with r > ``limit`` to ``count`` pairs; see ``_write_all_pairs``.

    A large ball is tested against its own row of cells and the eight adjacent ones.
    """
    balls, cells, numbers = _in_order_of_cells(centres, radii, np.inf, order, number)
    n, one, count = uint64(len(cells)), uint64(1), uint64(count)
    for layer in (-extent_x * extent_y, 0, extent_x * extent_y):
        for row in (layer - extent_x, layer, layer + extent_x):
            begin, end = uint64(0), uint64(0)
            for a in range(n):
                if balls[a, 3] <= limit:
                    continue
                lowest = cells[a] + row - 1
                while begin < n and cells[begin] < lowest:
                    begin += one
                end = max(begin, end)
                while end < n and cells[end] <= lowest + 2:
                    end += one
                i, x, y, z, r = numbers[a], balls[a, 0], balls[a, 1], balls[a, 2], balls[a, 3]
                for b in range(begin, end):
                    is_first = balls[b, 3] <= limit or b > a  # a pair of large balls is found from both sides
                    _write_pair(i, numbers[b], count, pairs)
                    count += uint64(is_first and _overlaps(x, y, z, r, balls, b))
    return count


@njit(cache=True)
def _sorted_pairs(pairs, n):  # type: ignore[no-untyped-def]
    """Return pairs of ``n`` balls sorted by i, then j, in linear time."""
    return _sorted_by(_sorted_by(pairs, 1, n), 0, n)


@njit(cache=True)
def _sorted_by(pairs, column, n):  # type: ignore[no-untyped-def]
    """Return pairs sorted by a column; equal numbers stay in order (counting sort)."""
    begin, column, one = np.zeros(n + 1, dtype=np.uint64), uint64(column), uint64(1)
    for k in range(uint64(len(pairs))):
        begin[uint64(pairs[k, column]) + one] += one
    for i in range(uint64(n)):
        begin[i + one] += begin[i]
    ordered = np.empty_like(pairs)
    for k in range(uint64(len(pairs))):
        number = uint64(pairs[k, column])
        slot = begin[number]
        ordered[slot, 0], ordered[slot, 1] = pairs[k, 0], pairs[k, 1]
        begin[number] = slot + one
    return ordered


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
