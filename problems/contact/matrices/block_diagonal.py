"""Roots and inverses of block diagonal matrices, such as mass matrices, for any order of their rows."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit

from ...arrays import FloatArray, IntArray
from ...compilation.interpretation import interpretable
from ...errors import ProblemError
from .user_matrices import with_entries

BLOCK_SYMMETRY = 1e-12
"""Largest |A − Aᵀ| relative to the largest |A| in a block of M or M⁻¹ that counts as rounding."""

MAX_ENTRIES = 20_000_000
"""Largest number of entries of the inverse of a mass matrix, 160 MB of doubles."""


def block_cholesky(matrix: sp.csr_array[Any]) -> sp.csr_array[Any]:
    """Return S with S Sᵀ = M⁻¹ and the same blocks, for M⁻¹ in canonical CSR.

    Raises:
        ProblemError: if a block is not symmetric positive definite.
    """
    roots = [(dofs, _block_roots(dofs, blocks, "M⁻¹")) for dofs, blocks in _diagonal_blocks(matrix)]
    return _from_blocks(roots, matrix)


def block_inverse(mass: sp.csr_array[Any]) -> sp.csr_array[Any]:
    """Return M⁻¹ for M in canonical CSR, computed block by block and exactly symmetric.

    Raises:
        ProblemError: if a block of M is not symmetric positive definite, or M⁻¹ would have too many entries.
    """
    component_sizes = block_sizes(mass)
    if int((component_sizes**2).sum()) > MAX_ENTRIES:
        raise ProblemError(
            f"M couples {int(component_sizes.max())} degrees of freedom with each other, and its inverse would have "
            f"more than {MAX_ENTRIES} entries; give the problem by its Delassus matrix."
        )
    pattern = mass.copy()
    pattern.eliminate_zeros()
    inverses = []
    for dofs, blocks in _diagonal_blocks(pattern):
        _block_roots(dofs, blocks, "M")
        inverse = np.linalg.inv(blocks)
        inverses.append((dofs, 0.5 * (inverse + inverse.transpose(0, 2, 1))))
    return _from_blocks(inverses, mass)


def block_sizes(mass: sp.csr_array[Any]) -> IntArray:
    """Return the number of degrees of freedom in each diagonal block of M, for M in canonical CSR."""
    pattern = mass.copy()
    pattern.eliminate_zeros()
    component_sizes: IntArray = np.diff(_sort_by_component(pattern.indptr, pattern.indices)[1])
    return component_sizes


def _diagonal_blocks(matrix: sp.csr_array[Any]) -> Iterator[tuple[IntArray, FloatArray]]:
    """Yield the blocks of a block diagonal matrix, the connected components of its pattern, one size at a time.

    Yields:
        Degrees of freedom, ascending, shape (n_blocks, size), and blocks, shape (n_blocks, size, size).
    """
    order, starts = _sort_by_component(matrix.indptr, matrix.indices)
    for size in np.flatnonzero(np.bincount(np.diff(starts))):
        yield _blocks_of_size(size, order, starts, matrix.indptr, matrix.indices, matrix.data)


def _block_roots(dofs: IntArray, blocks: FloatArray, name: str) -> FloatArray:
    """Return the Cholesky factors of symmetric positive definite blocks; raise ``ProblemError`` for any other."""
    asymmetric = _first_asymmetric(blocks)
    if asymmetric >= 0:
        first = dofs[asymmetric, 0]
        raise ProblemError(f"{name} must be symmetric; the block of degree of freedom {first} is not.")
    try:
        return np.asarray(np.linalg.cholesky(blocks), dtype=np.float64)
    except np.linalg.LinAlgError:
        first = dofs[int(np.argmin(np.linalg.eigvalsh(blocks)[:, 0])), 0]
        raise ProblemError(
            f"{name} must be positive definite; the block of degree of freedom {first} is not."
        ) from None


def _from_blocks(parts: list[tuple[IntArray, FloatArray]], like: sp.csr_array[Any]) -> sp.csr_array[Any]:
    """Return the matrix with these blocks and the shape of ``like``; zeros are not stored."""
    starts = np.zeros(like.shape[0] + 1, dtype=np.int32)
    for dofs, blocks in parts:
        _count_entries(dofs, blocks, starts)
    np.cumsum(starts, dtype=starts.dtype, out=starts)
    columns, values = np.empty(starts[-1], dtype=np.int32), np.empty(starts[-1])
    for dofs, blocks in parts:
        _write_entries(dofs, blocks, starts, columns, values)
    matrix = with_entries(like, values, columns, starts)
    matrix.has_canonical_format = True
    return matrix


@interpretable
@njit(cache=True)
def _sort_by_component(indptr, indices):  # type: ignore[no-untyped-def]
    """Return the rows of a square matrix sorted by component (union–find), and the start of each component.

    Components are sorted by their first rows, and rows ascend in each.
    """
    n = len(indptr) - 1
    root = np.arange(n)
    for row in range(n):
        for p in range(indptr[row], indptr[row + 1]):
            a, b = row, np.int64(indices[p])
            while root[a] != a:
                root[a] = root[root[a]]
                a = root[a]
            while root[b] != b:
                root[b] = root[root[b]]
                b = root[b]
            if a < b:
                root[b] = a
            else:
                root[a] = b
    number, count = np.empty(n, dtype=np.int64), 0
    starts = np.zeros(n + 1, dtype=np.int64)
    for row in range(n):
        number[row] = count if root[row] == row else number[root[row]]
        count += root[row] == row
        starts[number[row] + 1] += 1
    for component in range(count):
        starts[component + 1] += starts[component]
    order, filled = np.empty(n, dtype=np.int64), starts[:count].copy()
    for row in range(n):
        order[filled[number[row]]] = row
        filled[number[row]] += 1
    return order, starts[: count + 1].copy()


@interpretable
@njit(cache=True)
def _blocks_of_size(size, order, starts, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Return the rows and the entries of all components of ``size`` rows."""
    n_components, count = len(starts) - 1, 0
    for component in range(n_components):
        count += starts[component + 1] - starts[component] == size
    dofs, blocks = np.empty((count, size), dtype=np.int64), np.zeros((count, size, size))
    position, count = np.empty(len(order), dtype=np.int64), 0
    for component in range(n_components):
        begin = starts[component]
        if starts[component + 1] - begin != size:
            continue
        for k in range(size):
            dofs[count, k] = order[begin + k]
            position[order[begin + k]] = k
        for k in range(size):
            row = order[begin + k]
            for p in range(indptr[row], indptr[row + 1]):
                blocks[count, k, position[indices[p]]] = data[p]
        count += 1
    return dofs, blocks


@interpretable
@njit(cache=True)
def _first_asymmetric(blocks):  # type: ignore[no-untyped-def]
    """Return the index of the first block that is not symmetric up to rounding, or −1."""
    for b in range(len(blocks)):
        largest, skew = 0.0, 0.0
        for row in range(blocks.shape[1]):
            for column in range(blocks.shape[1]):
                largest = max(largest, abs(blocks[b, row, column]))
                skew = max(skew, abs(blocks[b, row, column] - blocks[b, column, row]))
        if skew > BLOCK_SYMMETRY * largest:
            return b
    return -1


@interpretable
@njit(cache=True)
def _count_entries(dofs, blocks, counts):  # type: ignore[no-untyped-def]
    """Add the number of entries of each row to the next entry of ``counts``."""
    for b in range(len(blocks)):
        for row in range(blocks.shape[1]):
            for column in range(blocks.shape[1]):
                counts[dofs[b, row] + 1] += blocks[b, row, column] != 0.0


@interpretable
@njit(cache=True)
def _write_entries(dofs, blocks, starts, columns, values):  # type: ignore[no-untyped-def]
    """Write the entries of blocks into their rows."""
    for b in range(len(blocks)):
        for row in range(blocks.shape[1]):
            p = starts[dofs[b, row]]
            for column in range(blocks.shape[1]):
                if blocks[b, row, column] != 0.0:
                    columns[p], values[p] = dofs[b, column], blocks[b, row, column]
                    p += 1
