"""Conversion and validation of matrices from users, dense or sparse."""

import copy
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
from numba import njit, uint64
from numpy.typing import NDArray

from ...arrays import check_no_mask, read_only
from ...compilation.interpretation import interpretable
from ...errors import ProblemError

Compressed = TypeVar("Compressed", sp.csr_array[Any], sp.csc_array[Any])


def read_matrix(matrix_like: Any, name: str, kind: type[Compressed]) -> Compressed:
    """Return a copy of a matrix, dense or sparse, as a canonical read-only CSR or CSC array of doubles.

    Args:
        matrix_like: the matrix, dense or scipy sparse.
        name: name of the matrix in error messages.
        kind: ``scipy.sparse.csr_array`` or ``scipy.sparse.csc_array``.

    Raises:
        ProblemError: if ``matrix_like`` is not a matrix of real numbers, or has an index outside its shape or an entry
            that is not finite.
    """
    source = as_matrix(matrix_like, name)
    if type(source) is kind and source.dtype == np.float64:
        matrix = _copied(source)
    elif kind is sp.csr_array and isinstance(source, np.ndarray):
        matrix = _compressed_rows(source.astype(np.float64))
        check_finite(matrix, name)
        return matrix
    else:
        if sp.issparse(source):
            _check_sparse(source, name)
        matrix = kind(source, dtype=np.float64, copy=True)
    _shorten_indices(matrix)
    major, minor = matrix.shape if kind is sp.csr_array else matrix.shape[::-1]
    if len(matrix.indptr) == major + 1 and _is_in_order(matrix.indptr, matrix.indices, matrix.data, minor):
        matrix.has_canonical_format = True
    else:
        _check_sparse(matrix, name)
        matrix = kind(matrix, copy=True)  # without the flags of sorted indices, which may be wrong
        matrix.sum_duplicates()
        check_finite(matrix, name)
    read_only(matrix.data, matrix.indices, matrix.indptr)
    return matrix


def as_matrix(matrix_like: Any, name: str) -> Any:
    """Return ``matrix_like`` if it is a sparse matrix, else a dense matrix of numbers.

    Raises:
        ProblemError: if ``matrix_like`` is not a matrix of real numbers, or an entry is masked.
    """
    is_sparse = sp.issparse(matrix_like)
    if not is_sparse:
        check_no_mask(matrix_like, name)
    try:
        matrix: Any = matrix_like if is_sparse else np.asarray(matrix_like)
        if matrix.ndim == 2 and matrix.dtype.kind in "fiub":
            return matrix
    except (TypeError, ValueError):
        pass
    kind = type(matrix_like).__name__
    raise ProblemError(f"{name} must be a matrix of real numbers, dense or scipy sparse, got {kind}.")


def check_finite(matrix: Any, name: str) -> None:
    """Check the entries of a CSR or CSC matrix, and make its arrays read-only.

    Raises:
        ProblemError: if an entry is not finite; the message names the first one.
    """
    if not np.isfinite(matrix.data).all():
        entries = matrix.tocoo()
        first = int(np.argmin(np.isfinite(entries.data)))
        raise ProblemError(
            f"{name}[{entries.row[first]}, {entries.col[first]}] = {entries.data[first]} must be finite."
        )
    read_only(matrix.data, matrix.indices, matrix.indptr)


def read_only_copy(matrix: Compressed) -> Compressed:
    """Return a copy of a CSR or CSC matrix with read-only arrays."""
    other: Compressed = matrix.copy()
    read_only(other.data, other.indices, other.indptr)
    return other


def with_entries(matrix: Compressed, data: NDArray[Any], indices: NDArray[Any], indptr: NDArray[Any]) -> Compressed:
    """Return a matrix of the type, shape and flags of ``matrix`` with other entries.

    For few entries this is five times as fast as the constructor of scipy.
    """
    other: Compressed = copy.copy(matrix)
    other.data, other.indices, other.indptr = data, indices, indptr
    return other


MAX_TEMPLATE_COLUMNS = 1000
"""Largest number of columns of a matrix whose empty template is cached."""


def compressed_columns(
    entries: tuple[NDArray[Any], NDArray[Any], NDArray[Any]], shape: tuple[int, int]
) -> sp.csc_array[Any]:
    """Return the CSC matrix of (entries, rows, starts) of columns with ascending rows; see ``with_entries``."""
    if shape[1] > MAX_TEMPLATE_COLUMNS:
        return sp.csc_array(entries, shape=shape)
    return with_entries(_empty_columns(shape), *entries)


@lru_cache(maxsize=64)
def _empty_columns(shape: tuple[int, int]) -> sp.csc_array[Any]:
    return sp.csc_array(shape)


def sparse_arrays(label: str, matrix: Any) -> list[tuple[str, np.ndarray[Any, Any]]]:
    """Return the labelled arrays of a canonical CSR or CSC matrix, with index types that do not depend on its size."""
    indices, starts = matrix.indices.astype(np.int64), matrix.indptr.astype(np.int64)
    return [(label, matrix.data), (f"{label}.indices", indices), (f"{label}.indptr", starts)]


def _copied(source: Compressed) -> Compressed:
    return with_entries(source, source.data.copy(), source.indices.copy(), source.indptr.copy())


def _shorten_indices(matrix: Compressed) -> None:
    """Store the indices of a matrix as int32 if they fit, so that kernels are compiled for one index type."""
    max_index = np.iinfo(np.int32).max
    if matrix.indices.dtype == matrix.indptr.dtype == np.int32 or max(matrix.shape) > max_index:
        return
    if all(
        -1 <= array.min(initial=0) <= array.max(initial=0) <= max_index for array in (matrix.indices, matrix.indptr)
    ):
        matrix.indices, matrix.indptr = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)


def _check_sparse(matrix: Any, name: str) -> None:
    """Check the indices of a sparse matrix, on which scipy relies; raise ``ProblemError`` if one is invalid."""
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
        raise ProblemError(f"{name} is not a valid sparse matrix: {error}.") from None


@interpretable
@njit(cache=True)
def _is_in_order(indptr, indices, data, length):  # type: ignore[no-untyped-def]
    """Return whether the minor indices ascend within 0 … ``length`` − 1 and all entries are finite."""
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
    for p in range(one, count):  # simple loops, which the compiler can vectorise
        descents += indices[p] <= indices[p - one]
    for p in range(count):
        n_bad += indices[p] < 0 or indices[p] >= length
    for p in range(count):
        n_bad += not abs(data[p]) < np.inf
    return descents == at_starts and n_bad == 0


def _compressed_rows(dense: NDArray[np.float64]) -> sp.csr_array[Any]:
    """Return a dense matrix in canonical CSR, without its zeros."""
    rows, columns = np.nonzero(dense)
    starts = np.searchsorted(rows, np.arange(len(dense) + 1))
    empty = _empty_matrix(*dense.shape)
    return with_entries(empty, dense[rows, columns], columns.astype(np.int32), starts.astype(np.int32))


@lru_cache(maxsize=64)
def _empty_matrix(n_rows: int, n_columns: int) -> sp.csr_array[Any]:
    """Return a matrix of zeros, the template for matrices of its shape."""
    matrix = sp.csr_array((n_rows, n_columns))
    matrix.has_canonical_format = True
    return matrix
