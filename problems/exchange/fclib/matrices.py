"""Sparse matrices as FCLIB stores them: triplets, compressed columns or compressed rows, in a group of arrays.

    nz ≥ 0   triplets: rows i, columns p, values x, nz of each (as in CSparse and in public files)
    nz = −1  compressed columns: column k has the entries p[k] … p[k+1] − 1 of rows i and values x
    nz = −2  compressed rows: the same, where i contains columns

The arrays may be longer than their content, up to nzmax. With ``symmetric_packed`` = 1 only the lower triangle of a
symmetric matrix is stored.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .container import ContainerError, Group

Integers = NDArray[np.signedinteger[Any]]

TRIPLETS, COLUMNS, ROWS = 0, -1, -2
"""Values of nz."""


def read_matrix(group: Group, shape: tuple[int, int]) -> sp.csr_array[Any] | sp.csc_array[Any]:
    """Return the matrix of a group; duplicate entries are summed, as in CSparse.

    Args:
        group: the group that contains its arrays.
        shape: required numbers of rows and columns. The file contains vectors of these lengths, so it cannot demand a
            matrix of absurd size.

    Raises:
        ContainerError: if the matrix does not have this shape, or its arrays contradict each other.
    """
    stored_shape = group.integer("m"), group.integer("n")
    if stored_shape != shape:
        raise ContainerError(f"{group.path} must have shape {shape} to match the vectors, got {stored_shape}")
    kind, values = group.integer("nz"), group.floats("x")
    indices, pointers = group.integers("i"), group.integers("p")
    matrix: sp.csr_array[Any] | sp.csc_array[Any]
    if kind >= TRIPLETS:
        parts = (
            _leading_entries(array, kind, group, name)
            for array, name in ((values, "x"), (indices, "i"), (pointers, "p"))
        )
        values, rows, columns = parts
        _check_range(rows, shape[0], group, "i")
        _check_range(columns, shape[1], group, "p")
        matrix = sp.csc_array(sp.coo_array((values, (_in_32_bits(rows), _in_32_bits(columns))), shape=shape))
    elif kind in (COLUMNS, ROWS):
        n_minor, n_major = shape if kind == COLUMNS else shape[::-1]
        _check_pointers(pointers, n_major, min(len(indices), len(values)), group)
        indices, values = indices[: pointers[-1]], values[: pointers[-1]]
        _check_range(indices, n_minor, group, "i")
        matrix = _compressed_class(kind)((values, _in_32_bits(indices), _in_32_bits(pointers)), shape=shape)
        matrix.sum_duplicates()
    else:
        raise ContainerError(f"{group.path}/nz = {kind} is not a storage format; it must be -2, -1, or 0 or more")
    return _unpacked(matrix, group) if group.is_set("symmetric_packed") else matrix


def stored_matrix(matrix: sp.csr_array[Any] | sp.csc_array[Any], kind: int) -> dict[str, NDArray[Any]]:
    """Return the arrays of a group; ``kind`` is TRIPLETS, COLUMNS or ROWS."""
    if kind == TRIPLETS:
        entries = sp.csc_array(matrix).tocoo()
        indices, pointers, values, nz = entries.row, entries.col, entries.data, entries.nnz
    else:
        compressed = _compressed_class(kind)(matrix)
        indices, pointers, values, nz = compressed.indices, compressed.indptr, compressed.data, kind
    counts = {"nzmax": len(values), "m": matrix.shape[0], "n": matrix.shape[1], "nz": nz}
    scalars = {name: np.array([number], dtype=np.int32) for name, number in counts.items()}
    return {**scalars, "p": pointers.astype(np.int32), "i": indices.astype(np.int32), "x": values}


def _compressed_class(kind: int) -> Any:
    return sp.csc_array if kind == COLUMNS else sp.csr_array


def _leading_entries(array: NDArray[Any], count: int, group: Group, name: str) -> NDArray[Any]:
    """Return the first ``count`` entries of an array; raise ``ContainerError`` if it has fewer."""
    if len(array) < count:
        raise ContainerError(f"{group.path}/{name} has {len(array)} entries, fewer than nz = {count}")
    return array[:count]


def _check_range(indices: Integers, size: int, group: Group, name: str) -> None:
    if len(indices) and (indices.min() < 0 or indices.max() >= size):
        invalid = indices[(indices < 0) | (indices >= size)][0]
        raise ContainerError(f"{group.path}/{name} has the index {invalid}, which must be from 0 to {size - 1}")


def _check_pointers(pointers: Integers, n_major: int, n_entries: int, group: Group) -> None:
    if len(pointers) != n_major + 1:
        raise ContainerError(f"{group.path}/p must have {n_major + 1} entries, got {len(pointers)}")
    if pointers[0] != 0 or (np.diff(pointers) < 0).any() or pointers[-1] > n_entries:
        raise ContainerError(f"{group.path}/p must rise from 0 to at most the {n_entries} entries of i and x")


def _in_32_bits(indices: Integers) -> NDArray[np.int32]:
    return indices.astype(np.int32, copy=False)


def _unpacked(lower: Any, group: Group) -> sp.csr_array[Any]:
    """Return L + Lᵀ − diag(L)."""
    if lower.shape[0] != lower.shape[1] or sp.triu(lower, 1).count_nonzero():
        raise ContainerError(f"{group.path} is packed as symmetric, but has more than a lower triangle")
    strict = sp.tril(lower, -1)
    return sp.csr_array(sp.csr_array(lower) + strict.T)
