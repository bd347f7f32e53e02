"""Triangular factors of a sparse matrix of blocks with a symmetric pattern, again and again for other numbers.

A front of a supernode with pivot columns 1 and rows below 2 is eliminated densely,

    ( F₁₁ F₁₂ )      kept: F₁₁⁻¹, F₂₁, X = F₁₁⁻¹ F₁₂,      passed to the parent: F₂₂ − F₂₁ X.
    ( F₂₁ F₂₂ )

Rows are exchanged inside F₁₁ alone. That is enough for Ĝ + D, whose symmetric part is positive definite or nearly so;
what rounding it costs, refinement mends. Dense products are those of BLAS, which is why 734 contacts take half the time
of a factorisation column by column.
"""

import numpy as np
from numba import njit

from ...problems.arrays import FloatArray, IntArray
from .elimination import elimination


class BlockLU:
    """Factors of matrices of square blocks with one pattern.

    Attributes:
        flops: multiplications and additions of one factorisation.
    """

    def __init__(self, starts: IntArray, columns: IntArray, width: int) -> None:
        """Order a pattern in compressed block rows, symmetric, its diagonal stored, of blocks (width, width)."""
        found = elimination(starts, columns)
        self._width, self._order = width, found.order
        self._fronts = (
            found.nodes,
            found.row_starts,
            found.row_places,
            found.child_starts,
            found.children,
            found.entry_starts,
            found.entries,
            found.entry_places,
            found.factor_starts,
        )
        self._triangles = found.nodes, found.row_starts, found.rows, found.factor_starts
        self._stack = np.empty(found.stack_size * width * width)
        self._factors = np.empty(int(found.factor_starts[-1]) * width * width)
        self.flops = 2.0 * found.multiplications * width**3

    def factorise(self, blocks: FloatArray) -> bool:
        """Factorise the matrix with the stored blocks, shape (n_stored, width, width); False if it is singular."""
        try:
            _factorise(self._width, *self._fronts, self._stack, blocks, self._factors)
        except np.linalg.LinAlgError:
            return False
        return True

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution for a right side, shape (n · width,)."""
        solution: FloatArray = _solve(self._width, *self._triangles, self._factors, self._order, right)
        return solution


@njit(cache=True)
def _add_block(front, i, j, block):  # type: ignore[no-untyped-def]
    for k in range(block.shape[0]):
        for m in range(block.shape[1]):
            front[i + k, j + m] += block[k, m]


@njit(cache=True)
def _add(f11, f12, f21, f22, i, j, block):  # type: ignore[no-untyped-def]
    """Add a block to the quarter of the front that (i, j) lies in."""
    pivots = f11.shape[0]
    if i < pivots:
        if j < pivots:
            _add_block(f11, i, j, block)
        else:
            _add_block(f12, i, j - pivots, block)
    elif j < pivots:
        _add_block(f21, i - pivots, j, block)
    else:
        _add_block(f22, i - pivots, j - pivots, block)


@njit(cache=True)
def _factorise(  # type: ignore[no-untyped-def]
    b,
    nodes,
    row_starts,
    row_places,
    child_starts,
    children,
    entry_starts,
    entries,
    entry_places,
    factor_starts,
    stack,
    blocks,
    factors,
):
    top = 0
    for s in range(len(nodes) - 1):
        p, q = b * (nodes[s + 1] - nodes[s]), b * (row_starts[s + 1] - row_starts[s])
        f11, f12, f21, f22 = np.zeros((p, p)), np.zeros((p, q)), np.zeros((q, p)), np.zeros((q, q))
        for e in range(entry_starts[s], entry_starts[s + 1]):
            _add(f11, f12, f21, f22, b * entry_places[0, e], b * entry_places[1, e], blocks[entries[e]])
        for c in range(child_starts[s + 1] - 1, child_starts[s] - 1, -1):
            first, n_rows = row_starts[children[c]], row_starts[children[c] + 1] - row_starts[children[c]]
            size = b * n_rows
            top -= size * size
            update = stack[top : top + size * size].reshape(size, size)
            for x in range(n_rows):
                for y in range(n_rows):
                    block = update[b * x : b * x + b, b * y : b * y + b]
                    _add(f11, f12, f21, f22, b * row_places[first + x], b * row_places[first + y], block)
        inverse = np.ascontiguousarray(np.linalg.inv(f11))
        at = b * b * factor_starts[s]
        factors[at : at + p * p] = inverse.reshape(-1)
        if q > 0:
            across = np.dot(inverse, f12)
            at += p * p
            factors[at : at + p * q] = f21.reshape(-1)
            factors[at + p * q : at + 2 * p * q] = across.reshape(-1)
            f22 -= np.dot(f21, across)
            stack[top : top + q * q] = f22.reshape(-1)
            top += q * q


@njit(cache=True)
def _solve(b, nodes, row_starts, rows, factor_starts, factors, order, right):  # type: ignore[no-untyped-def]
    n_nodes, n = len(nodes) - 1, len(order)
    x, below = np.empty(n * b), np.empty(n * b)
    for k in range(n):
        for m in range(b):
            x[b * k + m] = right[b * order[k] + m]
    for s in range(n_nodes):
        begin, p, n_rows = b * nodes[s], b * (nodes[s + 1] - nodes[s]), row_starts[s + 1] - row_starts[s]
        at = b * b * factor_starts[s]
        head = np.dot(factors[at : at + p * p].reshape(p, p), x[begin : begin + p])
        x[begin : begin + p] = head
        if n_rows > 0:
            q = b * n_rows
            change = np.dot(factors[at + p * p : at + p * p + p * q].reshape(q, p), head)
            for k in range(n_rows):
                for m in range(b):
                    x[b * rows[row_starts[s] + k] + m] -= change[b * k + m]
    for s in range(n_nodes - 1, -1, -1):
        begin, p, n_rows = b * nodes[s], b * (nodes[s + 1] - nodes[s]), row_starts[s + 1] - row_starts[s]
        q = b * n_rows
        if q == 0:
            continue
        at = b * b * factor_starts[s] + p * p + p * q
        for k in range(n_rows):
            for m in range(b):
                below[b * k + m] = x[b * rows[row_starts[s] + k] + m]
        x[begin : begin + p] -= np.dot(factors[at : at + p * q].reshape(p, q), below[:q])
    solution = np.empty(n * b)
    for k in range(n):
        for m in range(b):
            solution[b * order[k] + m] = x[b * k + m]
    return solution
