"""The elimination order of a sparse block matrix and its fill, computed once per pattern.

Columns are ordered by multiple minimum degree (Liu 1985) on the graph of the blocks, and then reordered so that each
subtree of the elimination tree is contiguous (Liu 1990). Neighbouring columns of nearly the same structure become one
supernode, which is eliminated as a dense matrix. The multifrontal method (Duff & Reid 1983) visits supernodes in this
order. The front of a supernode gathers entries of the matrix and the updates that its children have put on a stack.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numba import njit

from ....problems.arrays import IntArray
from ....problems.compilation.kernel_arrays import copy_entries

MAX_ZERO_SHARE = 0.2
"""Largest share of zeros in a supernode after it has merged with its neighbour."""

MAX_COLUMNS = 40
"""Largest number of block columns of a supernode.

For a larger one, inverting the dense matrix takes longer than passing its updates to a parent.
"""


@dataclass(frozen=True, eq=False)
class Elimination:
    """The elimination of a block matrix with a symmetric pattern; all counts are in blocks.

    Attributes:
        order: block row at each position of the elimination order, shape (n,).
        node_starts: first position of each supernode, shape (n_nodes + 1,).
        row_starts: first index in ``rows`` of the rows below each supernode, shape (n_nodes + 1,).
        rows: positions of the rows below the supernodes.
        row_positions: position of each of these rows in the front of the parent.
        child_starts: first index in ``children`` of the children of each supernode, shape (n_nodes + 1,).
        children: the children of all supernodes, in the order of their parents.
        entry_starts: first index in ``entries`` of the entries of each front, shape (n_nodes + 1,).
        entries: indices of the stored blocks of the matrix, grouped by supernode.
        entry_positions: row and column of each entry in its front, shape (2, n_entries).
        factor_starts: index at which the factors of each supernode begin in the array of factors, shape
            (n_nodes + 1,).
        stack_size: largest size of the stack of updates.
    """

    order: IntArray
    node_starts: IntArray
    row_starts: IntArray
    rows: IntArray
    row_positions: IntArray
    child_starts: IntArray
    children: IntArray
    entry_starts: IntArray
    entries: IntArray
    entry_positions: IntArray
    factor_starts: IntArray
    stack_size: int

    @cached_property
    def multiplications(self) -> float:
        """Multiplications of blocks in one factorisation."""
        pivots, below = np.diff(self.node_starts).astype(float), np.diff(self.row_starts).astype(float)
        return float((pivots**3 + 2.0 * pivots**2 * below + pivots * below**2).sum())


def find_elimination(starts: IntArray, columns: IntArray, max_columns: int = MAX_COLUMNS) -> Elimination:
    """Return the elimination of a matrix in block rows, with a symmetric pattern that includes the diagonal.

    Args:
        starts: first stored block of each block row, shape (n + 1,).
        columns: block column of each stored block.
        max_columns: largest number of columns of a supernode.
    """
    starts, columns = np.asarray(starts, dtype=np.int64), np.asarray(columns, dtype=np.int64)
    order = _minimum_degree(starts, columns)
    order = order[_postorder(_tree(starts, columns, np.argsort(order), order))]
    position = np.argsort(order)
    parent = _tree(starts, columns, position, order)
    column_starts, column_rows = _structures(starts, columns, position, order, parent)
    node_starts = _supernodes(column_starts, parent, MAX_ZERO_SHARE, max_columns)
    row_starts, rows, node_of, child_starts, children = _fronts(column_starts, column_rows, node_starts, parent)
    entry_starts, entries, row_of = _entries(starts, columns, position, node_of, len(node_starts) - 1)
    row_positions, entry_positions, factor_starts, stack_size = _find_local_positions(
        node_starts, row_starts, rows, child_starts, children, entry_starts, entries, row_of, position[columns]
    )
    return Elimination(
        order,
        node_starts,
        row_starts,
        rows,
        row_positions,
        child_starts,
        children,
        entry_starts,
        entries,
        entry_positions,
        factor_starts,
        stack_size,
    )


def _minimum_degree(starts: IntArray, columns: IntArray) -> IntArray:
    """Return the order with little fill that SuperLU finds for a diagonally dominant matrix with the pattern."""
    from scipy.sparse.linalg import splu  # imported here because the import takes 0.1 s

    n = len(starts) - 1
    if n < 3:
        return np.arange(n)
    pattern = sp.csr_array((np.ones(len(columns)), columns, starts), shape=(n, n))
    dominant = sp.csc_matrix(pattern + 2.0 * np.diff(starts).max() * sp.eye_array(n))
    factors = splu(
        dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
    )
    order: IntArray = np.argsort(factors.perm_c).astype(np.int64)
    return order


@njit(cache=True)
def _tree(starts, columns, position, order):  # type: ignore[no-untyped-def]
    """Return the parent of each position in the elimination tree, −1 for a root (Liu 1986)."""
    n = len(order)
    parent = np.full(n, -1, dtype=np.int64)
    ancestor = np.full(n, -1, dtype=np.int64)
    for k in range(n):
        for p in range(starts[order[k]], starts[order[k] + 1]):
            i = position[columns[p]]
            while i != -1 and i < k:
                old_ancestor = ancestor[i]
                ancestor[i] = k
                if old_ancestor == -1:
                    parent[i] = k
                i = old_ancestor
    return parent


@njit(cache=True)
def _postorder(parent):  # type: ignore[no-untyped-def]
    """Return the positions in an order in which each subtree is contiguous, its root last."""
    n = len(parent)
    first, sibling = np.full(n, -1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    for j in range(n - 1, -1, -1):
        if parent[j] >= 0:
            sibling[j] = first[parent[j]]
            first[parent[j]] = j
    post, stack, n_done = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), 0
    for root in range(n):
        if parent[root] >= 0:
            continue
        stack[0], top = root, 0
        while top >= 0:
            j = stack[top]
            child = first[j]
            if child == -1:
                post[n_done] = j
                n_done += 1
                top -= 1
            else:
                first[j] = sibling[child]
                top += 1
                stack[top] = child
    return post


@njit(cache=True)
def _structures(starts, columns, position, order, parent):  # type: ignore[no-untyped-def]
    """Return the rows below the diagonal of each column of the factor, sorted, in compressed columns."""
    n = len(order)
    column_starts, n_used = np.zeros(n + 1, dtype=np.int64), 0
    rows = np.empty(16 * n + 16, dtype=np.int64)
    mark = np.full(n, -1, dtype=np.int64)
    first, sibling = np.full(n, -1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    for j in range(n):
        begin = n_used
        if n_used + n > len(rows):
            longer = np.empty(2 * len(rows) + n, dtype=np.int64)
            copy_entries(rows[:n_used], longer[:n_used])
            rows = longer
        for p in range(starts[order[j]], starts[order[j] + 1]):
            i = position[columns[p]]
            if i > j and mark[i] != j:
                mark[i] = j
                rows[n_used] = i
                n_used += 1
        child = first[j]
        while child != -1:
            for p in range(column_starts[child], column_starts[child + 1]):
                i = rows[p]
                if i > j and mark[i] != j:
                    mark[i] = j
                    rows[n_used] = i
                    n_used += 1
            child = sibling[child]
        copy_entries(np.sort(rows[begin:n_used]), rows[begin:n_used])
        column_starts[j + 1] = n_used
        if parent[j] >= 0:
            sibling[j] = first[parent[j]]
            first[parent[j]] = j
    return column_starts, rows[:n_used]


@njit(cache=True)
def _supernodes(column_starts, parent, max_zero_share, max_columns):  # type: ignore[no-untyped-def]
    """Return the first position of each supernode; a column joins the one before it if that adds few zeros."""
    n = len(parent)
    node_starts, count, zeros = np.empty(n + 1, dtype=np.int64), 0, 0.0
    for j in range(n):
        if j > 0 and parent[j - 1] == j and j - node_starts[count - 1] < max_columns:
            width, below = j - node_starts[count - 1], column_starts[j + 1] - column_starts[j]
            added_zeros = width * (below + 1 - (column_starts[j] - column_starts[j - 1]))
            if zeros + added_zeros <= max_zero_share * (width + 1) * (below + 1 + 0.5 * width):
                zeros += added_zeros
                continue
        node_starts[count] = j
        count += 1
        zeros = 0.0
    node_starts[count] = n
    return node_starts[: count + 1]


@njit(cache=True)
def _fronts(column_starts, column_rows, node_starts, parent):  # type: ignore[no-untyped-def]
    """Return the rows below each supernode, the supernode of each position, and the children of each supernode."""
    n_nodes = len(node_starts) - 1
    node_of = np.empty(len(parent), dtype=np.int64)
    row_starts, child_starts = np.zeros(n_nodes + 1, dtype=np.int64), np.zeros(n_nodes + 1, dtype=np.int64)
    for s in range(n_nodes):
        node_of[node_starts[s] : node_starts[s + 1]] = s
        last = node_starts[s + 1] - 1
        row_starts[s + 1] = row_starts[s] + column_starts[last + 1] - column_starts[last]
    rows = np.empty(row_starts[n_nodes], dtype=np.int64)
    parent_node = np.full(n_nodes, -1, dtype=np.int64)
    for s in range(n_nodes):
        last = node_starts[s + 1] - 1
        copy_entries(
            column_rows[column_starts[last] : column_starts[last + 1]], rows[row_starts[s] : row_starts[s + 1]]
        )
        if parent[last] >= 0:
            parent_node[s] = node_of[parent[last]]
            child_starts[parent_node[s] + 1] += 1
    for s in range(n_nodes):
        child_starts[s + 1] += child_starts[s]
    children, next_index = np.empty(child_starts[n_nodes], dtype=np.int64), child_starts[:-1].copy()
    for s in range(n_nodes):
        if parent_node[s] >= 0:
            children[next_index[parent_node[s]]] = s
            next_index[parent_node[s]] += 1
    return row_starts, rows, node_of, child_starts, children


@njit(cache=True)
def _entries(starts, columns, position, node_of, n_nodes):  # type: ignore[no-untyped-def]
    """Return the stored blocks grouped by the supernode of their front, and the position of each block's row."""
    row_of = np.empty(len(columns), dtype=np.int64)
    entry_starts = np.zeros(n_nodes + 1, dtype=np.int64)
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            row_of[p] = position[i]
            entry_starts[node_of[min(position[i], position[columns[p]])] + 1] += 1
    for s in range(n_nodes):
        entry_starts[s + 1] += entry_starts[s]
    entries, next_index = np.empty(len(columns), dtype=np.int64), entry_starts[:-1].copy()
    for p in range(len(columns)):
        s = node_of[min(row_of[p], position[columns[p]])]
        entries[next_index[s]] = p
        next_index[s] += 1
    return entry_starts, entries, row_of


@njit(cache=True)
def _find_local_positions(  # type: ignore[no-untyped-def]
    node_starts, row_starts, rows, child_starts, children, entry_starts, entries, row_of, column_of
):
    """Return the positions of rows in parent fronts and of entries in fronts, and the sizes of factors and stack."""
    n_nodes = len(node_starts) - 1
    local_positions = np.full(node_starts[n_nodes], -1, dtype=np.int64)
    row_positions, entry_positions = np.zeros(len(rows), dtype=np.int64), np.empty((2, len(entries)), dtype=np.int64)
    factor_starts, stack, max_stack = np.zeros(n_nodes + 1, dtype=np.int64), 0, 0
    for s in range(n_nodes):
        width, below = node_starts[s + 1] - node_starts[s], row_starts[s + 1] - row_starts[s]
        for k in range(width):
            local_positions[node_starts[s] + k] = k
        for k in range(below):
            local_positions[rows[row_starts[s] + k]] = width + k
        for e in range(entry_starts[s], entry_starts[s + 1]):
            entry_positions[0, e] = local_positions[row_of[entries[e]]]
            entry_positions[1, e] = local_positions[column_of[entries[e]]]
        for c in range(child_starts[s], child_starts[s + 1]):
            child = children[c]
            for k in range(row_starts[child], row_starts[child + 1]):
                row_positions[k] = local_positions[rows[k]]
            stack -= (row_starts[child + 1] - row_starts[child]) ** 2
        stack += below**2
        max_stack = max(max_stack, stack)
        factor_starts[s + 1] = factor_starts[s] + width * width + 2 * width * below
    return row_positions, entry_positions, factor_starts, max_stack
