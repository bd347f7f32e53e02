"""Matrices as users give them, dense or sparse: copied, put in order and looked at entry by entry."""

import copy
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
from numba import njit, uint64
from numpy.typing import NDArray

from ...arrays import read_only
from ...errors import ProblemError

Compressed = TypeVar("Compressed", sp.csr_array[Any], sp.csc_array[Any])

RUN = 16
"""Entries of a dense matrix that are compared with zero at once."""


def read_matrix(given: Any, name: str, kind: type[Compressed]) -> Compressed:
    """Return a matrix, dense or sparse, as a canonical read-only CSR or CSC array of doubles in memory of its own.

    Raises:
        ProblemError: if it is no matrix of real numbers, has an index outside its shape, or an entry that is not
            finite, the first of which is named.
    """
    source = as_matrix(given, name)
    if type(source) is kind and source.dtype == np.float64:
        matrix = _copied(source)
    elif kind is sp.csr_array and isinstance(source, np.ndarray):
        dense = np.ascontiguousarray(source, dtype=np.float64)
        matrix = kind(_compressed(dense.reshape(-1), dense.shape[1]), shape=dense.shape)
    else:
        if sp.issparse(source):
            _check_sparse(source, name)
        matrix = kind(source, dtype=np.float64, copy=True)
    major, minor = matrix.shape if kind is sp.csr_array else matrix.shape[::-1]
    if len(matrix.indptr) == major + 1 and _is_in_order(matrix.indptr, matrix.indices, matrix.data, minor):
        matrix.has_canonical_format = True
    else:
        _check_sparse(matrix, name)
        matrix = kind(matrix, copy=True)  # knows nothing of the order of its arrays
        matrix.sum_duplicates()
        check_finite(matrix, name)
    read_only(matrix.data, matrix.indices, matrix.indptr)
    return matrix


def as_matrix(given: Any, name: str) -> Any:
    """Return ``given`` if it is a sparse matrix, else as a dense one of numbers.

    Raises:
        ProblemError: if it is neither.
    """
    try:
        matrix: Any = given if sp.issparse(given) else np.asarray(given)
        if matrix.ndim == 2 and matrix.dtype.kind in "fiub":
            return matrix
    except (TypeError, ValueError):
        pass
    raise ProblemError(f"{name} must be a matrix of real numbers, dense or scipy sparse, got {type(given).__name__}.")


def check_finite(matrix: Any, name: str) -> None:
    """Look at the entries of a CSR or CSC matrix, and make its arrays read-only.

    Raises:
        ProblemError: that names the first entry which is not finite.
    """
    if not np.isfinite(matrix.data).all():
        entries = matrix.tocoo()
        at = int(np.argmin(np.isfinite(entries.data)))
        raise ProblemError(f"{name}[{entries.row[at]}, {entries.col[at]}] = {entries.data[at]} must be finite.")
    read_only(matrix.data, matrix.indices, matrix.indptr)


def with_entries(matrix: Compressed, data: NDArray[Any], indices: NDArray[Any], indptr: NDArray[Any]) -> Compressed:
    """Return a matrix of the kind and shape of ``matrix`` with other entries, as much in order as those.

    On few entries this takes a fifth of the time of scipy's constructor.
    """
    other: Compressed = copy.copy(matrix)
    other.data, other.indices, other.indptr = data, indices, indptr
    return other


def sparse_numbers(label: str, matrix: Any) -> list[tuple[str, np.ndarray[Any, Any]]]:
    """Return the labelled arrays of a canonical CSR or CSC matrix, with index types that do not depend on its size."""
    indices, starts = matrix.indices.astype(np.int64), matrix.indptr.astype(np.int64)
    return [(label, matrix.data), (f"{label}.indices", indices), (f"{label}.indptr", starts)]


def _copied(source: Compressed) -> Compressed:
    return with_entries(source, source.data.copy(), source.indices.copy(), source.indptr.copy())


def _check_sparse(matrix: Any, name: str) -> None:
    """Look at the indices of a sparse matrix: the conversions of scipy write where they point."""
    try:
        if matrix.format in ("csr", "csc", "bsr"):
            matrix.check_format(full_check=True)
        if matrix.format == "coo":
            for indices, length in zip(matrix.coords, matrix.shape, strict=True):
                if len(indices) != len(matrix.data):
                    raise ValueError("indices and data have different lengths")
                if len(indices) and not 0 <= indices.min() <= indices.max() < length:
                    raise ValueError(f"an index is not within 0 to {length - 1}")
    except ValueError as error:
        raise ProblemError(f"{name} is no valid sparse matrix: {error}.") from None


@njit(cache=True)
def _is_in_order(indptr, indices, data, length):  # type: ignore[no-untyped-def]
    """Whether the minor indices of a compressed matrix ascend within 0 … ``length`` − 1 and all entries are finite."""
    one, count = uint64(1), uint64(len(data))
    if indptr[0] != 0 or indptr[-1] != len(data) or len(indices) != len(data):
        return False
    at_starts, descents, n_bad = 0, 0, 0
    for i in range(uint64(len(indptr) - 1)):
        begin = uint64(indptr[i])
        if indptr[i] > indptr[i + one] or indptr[i + one] > len(data):
            return False
        if 0 < begin < uint64(indptr[i + one]):
            at_starts += indices[begin] <= indices[begin - one]
    for p in range(one, count):  # simple loops, which the compiler turns into vector instructions
        descents += indices[p] <= indices[p - one]
    for p in range(count):
        n_bad += indices[p] < 0 or indices[p] >= length
    for p in range(count):
        n_bad += not abs(data[p]) < np.inf
    return descents == at_starts and n_bad == 0


@njit(cache=True)
def _compressed(dense, n_columns):  # type: ignore[no-untyped-def]
    """Return entries, columns and starts of the rows of a dense matrix, given flat, zeros left out."""
    run, width = uint64(RUN), uint64(n_columns)
    n_rows = len(dense) // max(n_columns, 1)
    starts = np.zeros(n_rows + 1, dtype=np.int32)
    room = max(64, n_rows * min(n_columns, 64))
    data, columns = np.empty(room), np.empty(room, dtype=np.int32)
    count = uint64(0)
    for row in range(uint64(n_rows)):
        if count + width > uint64(len(data)):
            data, columns = _moved(data, 2 * len(data) + n_columns), _moved(columns, 2 * len(data) + n_columns)
        first = uint64(0)
        while first < width:
            at, length, n_entries = width * row + first, min(run, width - first), 0
            for k in range(length):
                n_entries += dense[at + k] != 0.0
            if n_entries > 0:
                for k in range(length):
                    if dense[at + k] != 0.0:
                        data[count], columns[count] = dense[at + k], first + k
                        count += uint64(1)
            first += run
        starts[row + uint64(1)] = count
    return data[:count].copy(), columns[:count].copy(), starts


@njit(cache=True)
def _moved(array, room):  # type: ignore[no-untyped-def]
    """Return a longer array that begins with ``array``."""
    longer = np.empty(room, dtype=array.dtype)
    longer[: len(array)] = array
    return longer
