"""Inverses, signs of determinants and products of small square blocks, one per contact.

For blocks of a few lanes, these loops are faster than calls of LAPACK per block, and than NumPy for all blocks at once.
"""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def _reduce(work):  # type: ignore[no-untyped-def]
    """Reduce (A I), shape (w, 2w), to (I A⁻¹); return the sign of det A, 0 if a pivot is zero or not finite."""
    width, sign = work.shape[0], 1.0
    for column in range(width):
        pivot_row = column
        for row in range(column + 1, width):
            if abs(work[row, column]) > abs(work[pivot_row, column]):
                pivot_row = row
        pivot = work[pivot_row, column]
        if not 0.0 < abs(pivot) < np.inf:
            return 0.0
        if (pivot_row != column) != (pivot < 0.0):
            sign = -sign
        for k in range(2 * width):
            work[pivot_row, k], work[column, k] = work[column, k], work[pivot_row, k] / pivot
        for row in range(width):
            factor = work[row, column]
            if row != column and factor != 0.0:
                for k in range(2 * width):
                    work[row, k] -= factor * work[column, k]
    return sign


@njit(cache=True, error_model="numpy")
def invert(blocks, inverses):  # type: ignore[no-untyped-def]
    """Write the inverses of blocks, shape (n, w, w); return the sign of the product of their determinants.

    The method is Gauss–Jordan elimination with partial pivoting. Return 0 at the first singular or non-finite block.
    """
    width, product = blocks.shape[1], 1.0
    work = np.empty((width, 2 * width))
    for i in range(blocks.shape[0]):
        for row in range(width):
            for column in range(width):
                work[row, column] = blocks[i, row, column]
                work[row, width + column] = 1.0 if row == column else 0.0
        sign = _reduce(work)
        if sign == 0.0 or not np.isfinite(work).all():
            return 0.0
        inverses[i] = work[:, width:]
        product *= sign
    return product


@njit(cache=True)
def times(blocks, lanes):  # type: ignore[no-untyped-def]
    """Return the product of each block, shape (n, w, w), with its lanes, shape (n, w)."""
    products = np.zeros_like(lanes)
    for i in range(lanes.shape[0]):
        for row in range(lanes.shape[1]):
            for column in range(lanes.shape[1]):
                products[i, row] += blocks[i, row, column] * lanes[i, column]
    return products
