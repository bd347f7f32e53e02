"""Validation of a Delassus matrix: symmetry, and a cheap test of positive semidefiniteness.

Small matrices are tested with NumPy, which compiles nothing. Larger ones are tested entry by entry, and by the extreme
Ritz values of a few Lanczos steps.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit, uint64

from ...arrays import FloatArray, read_only
from ...errors import IndefiniteError, ProblemError
from .delassus import diagonal_of
from .user_matrices import as_matrix, read_matrix

SYMMETRY_TOLERANCE = 1e-12
"""Largest |G − Gᵀ| relative to the largest |G| that counts as rounding."""

SINGLE_SYMMETRY_TOLERANCE = 1e-5
"""The same limit for a matrix in single precision, which is then symmetrised; also its ``NEGATIVE_TOLERANCE``."""

NEGATIVE_TOLERANCE = 1e-9
"""Largest magnitude of a negative eigenvalue of G, relative to the largest one, that counts as rounding."""

LANCZOS_STEPS = 16
"""Number of steps of Lanczos' method in the search for a negative eigenvalue."""

MAX_DENSE_ROWS = 64
"""Largest number of rows for which all eigenvalues are computed instead of Ritz values."""

BREAKDOWN_TOLERANCE = 1e-12
"""Lanczos' method stops if the norm of a new vector is below this fraction of the largest Ritz value."""


def checked_delassus(delassus: Any, n_rows: int, allow_asymmetric: bool) -> sp.csr_array[Any]:
    """Return G as a canonical read-only CSR array.

    Args:
        delassus: G [1/kg], dense or scipy sparse, shape (n_rows, n_rows).
        n_rows: number of rows of the problem.
        allow_asymmetric: whether G may be any matrix without negative diagonal entries.

    Raises:
        IndefiniteError: if a diagonal entry, a 2×2 minor or an eigenvalue is negative beyond rounding.
        ProblemError: if G has the wrong shape, contains numbers that are not finite, or is not symmetric.
    """
    source = as_matrix(delassus, "G")
    is_single_precision = source.dtype == np.float32
    if source.shape != (n_rows, n_rows):
        raise ProblemError(f"G must have shape ({n_rows}, {n_rows}) to go with c, got {source.shape}.")
    matrix: sp.csr_array[Any] = read_matrix(source, "G", sp.csr_array)
    if allow_asymmetric:
        _check_diagonal(matrix)
        return matrix
    if is_single_precision:
        _check_diagonal(matrix)
        _check_symmetry(matrix, SINGLE_SYMMETRY_TOLERANCE)
        matrix = sp.csr_array(0.5 * (matrix + matrix.T))
        read_only(matrix.data, matrix.indices, matrix.indptr)
    tolerance = SINGLE_SYMMETRY_TOLERANCE if is_single_precision else NEGATIVE_TOLERANCE
    dense = None
    if n_rows <= MAX_DENSE_ROWS:
        dense = matrix.toarray() if is_single_precision or sp.issparse(source) else source.astype(np.float64)
    is_sound = _is_sound_sparse(matrix, tolerance) if dense is None else _is_sound_dense(dense, tolerance)
    if not is_sound:  # the checks of each property find the entry to report
        _check_diagonal(matrix)
        _check_symmetry(matrix, SYMMETRY_TOLERANCE)
        _check_minors(matrix, tolerance)
    if dense is None:
        _check_eigenvalues(_ritz_values(matrix), tolerance)
    elif not _has_cholesky_factor(dense, 0.5 * tolerance):
        _check_eigenvalues(np.linalg.eigvalsh(dense), tolerance)
    return matrix


def _is_sound_sparse(matrix: sp.csr_array[Any], tolerance: float) -> bool:
    """Return whether no diagonal entry is negative, G is symmetric, and no 2×2 minor is negative, within tolerances."""
    diagonal = diagonal_of(matrix)
    if not len(diagonal):
        return True
    if diagonal.min() < 0.0:
        return False
    arrays = matrix.indptr, matrix.indices, matrix.data, np.sqrt(diagonal), diagonal.max()
    return bool(_has_sound_pairs(*arrays, SYMMETRY_TOLERANCE, tolerance))


def _check_diagonal(matrix: sp.csr_array[Any]) -> None:
    diagonal = diagonal_of(matrix)
    if (diagonal < 0).any():
        row = int(np.argmax(diagonal < 0))
        raise IndefiniteError(f"G is not positive semidefinite: its diagonal entry G[{row}, {row}] is {diagonal[row]}.")


def _check_symmetry(matrix: sp.csr_array[Any], tolerance: float) -> None:
    difference, row, column = _largest_asymmetry(matrix.indptr, matrix.indices, matrix.data)
    if difference > tolerance * np.abs(matrix.data).max(initial=0.0):
        raise ProblemError(
            f"G[{row}, {column}] = {matrix[row, column]} but G[{column}, {row}] = {matrix[column, row]}: "
            "G must be symmetric (pass allow_asymmetric=True for public data that is not)."
        )


def _check_minors(matrix: sp.csr_array[Any], tolerance: float) -> None:
    """Raise ``IndefiniteError`` if a 2×2 minor g_ii g_jj − g_ij² shows that a symmetric G is indefinite."""
    diagonal = diagonal_of(matrix)
    excess, row, column = _largest_excess(matrix.indptr, matrix.indices, matrix.data, np.sqrt(diagonal))
    if excess > tolerance * diagonal.max(initial=0.0):
        root = np.sqrt(diagonal[row]) * np.sqrt(diagonal[column])
        raise IndefiniteError(
            f"G[{row}, {column}] = {matrix[row, column]} exceeds the square root of G[{row}, {row}] G[{column}, "
            f"{column}], {root}: G must be positive semidefinite."
        )


def _check_eigenvalues(values: FloatArray, tolerance: float) -> None:
    """Raise ``IndefiniteError`` if the first of ascending eigenvalues or Ritz values of G is negative beyond rounding.

    A Ritz value bounds the smallest eigenvalue from above, so an indefinite matrix may pass.
    """
    if len(values) and values[0] < -tolerance * values[-1]:
        raise IndefiniteError(
            f"G has an eigenvalue of {values[0]:.3g} or less; the largest is {values[-1]:.3g}. "
            "G must be positive semidefinite."
        )


def _ritz_values(matrix: sp.csr_array[Any]) -> FloatArray:
    """Return the Ritz values of G, ascending: ``LANCZOS_STEPS`` steps from a fixed random vector.

    Without reorthogonalisation, Ritz values still lie within the range of the eigenvalues (Paige 1976).
    """
    vector, projected = np.random.default_rng(0).normal(size=matrix.shape[0]), np.zeros((LANCZOS_STEPS, LANCZOS_STEPS))
    steps = _tridiagonalise(matrix.indptr, matrix.indices, matrix.data, vector, projected)
    return np.asarray(np.linalg.eigvalsh(projected[:steps, :steps]), dtype=np.float64)


def _is_sound_dense(matrix: FloatArray, tolerance: float) -> bool:
    """Return whether a dense G is symmetric, without negative diagonal entries or 2×2 minors, within tolerances."""
    diagonal = matrix.diagonal()
    if (diagonal < 0.0).any():
        return False
    magnitudes, root = np.abs(matrix), np.sqrt(diagonal)
    excess = magnitudes - root[:, None] * root
    if (excess > tolerance * diagonal.max(initial=0.0)).any():
        return False
    difference = matrix - matrix.T
    return not difference.any() or bool(np.abs(difference).max() <= SYMMETRY_TOLERANCE * magnitudes.max())


def _has_cholesky_factor(matrix: FloatArray, shift: float) -> bool:
    """Return whether G + ``shift`` max(diag G) I has a Cholesky factor, for a dense G.

    If so, no eigenvalue of G is below −``shift`` max(diag G), except by rounding.
    """
    shifted = matrix.copy()
    shifted.reshape(-1)[:: len(matrix) + 1] += shift * matrix.diagonal().max(initial=0.0)
    try:
        np.linalg.cholesky(shifted)
    except np.linalg.LinAlgError:
        return False
    return True


@njit(cache=True, fastmath={"contract", "reassoc"})
def _tridiagonalise(indptr, indices, data, vector, projected):  # type: ignore[no-untyped-def]
    """Write the tridiagonal Qᵀ G Q for the Lanczos basis Q from ``vector``; return the number of steps.

    ``vector`` is overwritten.
    """
    previous, product = np.zeros_like(vector), np.empty_like(vector)
    length, coupling, largest = np.sqrt((vector * vector).sum()), 0.0, 0.0
    for step in range(len(projected)):
        if length <= BREAKDOWN_TOLERANCE * largest:
            return step
        if step > 0:
            projected[step, step - 1] = projected[step - 1, step] = coupling = length
        vector /= length
        ritz = 0.0
        for row in range(uint64(len(vector))):
            total = 0.0
            for p in range(uint64(indptr[row]), uint64(indptr[row + uint64(1)])):
                total += data[p] * vector[uint64(indices[p])]
            product[row] = total
            ritz += total * vector[row]
        projected[step, step] = ritz
        largest = max(largest, max(abs(ritz), coupling))
        squared = 0.0
        for k in range(len(vector)):
            following = product[k] - ritz * vector[k] - coupling * previous[k]
            previous[k], vector[k] = vector[k], following
            squared += following * following
        length = np.sqrt(squared)
    return len(projected)


@njit(cache=True)
def _has_sound_pairs(indptr, indices, data, root, largest_diagonal, symmetry_tolerance, negative_tolerance):  # type: ignore[no-untyped-def]
    """Return whether each entry below the diagonal equals its mirror image, and neither exceeds √g_ii √g_jj.

    ``ahead`` is the next entry of each row to the right of the diagonal. A false result may be due to stored zeros; the
    caller must check it.
    """
    n_below, n_above, largest, difference, excess = 0, 0, largest_diagonal, 0.0, 0.0
    ahead = indptr[:-1].copy()
    for row in range(len(root)):
        p, end = indptr[row], indptr[row + 1]
        first = p
        while p < end and indices[p] < row:
            column = indices[p]
            q = ahead[column]
            if q >= indptr[column + 1] or indices[q] != row:
                return False
            ahead[column] = q + 1
            entry, mirrored = data[p], data[q]
            size = max(abs(entry), abs(mirrored))
            largest = max(largest, size)
            difference = max(difference, abs(entry - mirrored))
            excess = max(excess, size - root[row] * root[column])
            p += 1
        n_below += p - first
        if p < end and indices[p] == row:
            p += 1
        ahead[row] = p
        n_above += end - p
    is_symmetric = n_below == n_above and difference <= symmetry_tolerance * largest
    return is_symmetric and excess <= negative_tolerance * largest_diagonal


@njit(cache=True)
def _largest_asymmetry(indptr, indices, data):  # type: ignore[no-untyped-def]
    """Return the largest |g_ij − g_ji| and its first position; the columns of each row ascend.

    ``following`` is the first entry of each row whose column is not below the current row.
    """
    largest, at_row, at_column = 0.0, 0, 0
    following = indptr[:-1].copy()
    for row in range(len(indptr) - 1):
        for p in range(indptr[row], indptr[row + 1]):
            column = indices[p]
            while following[column] < indptr[column + 1] and indices[following[column]] < row:
                following[column] += 1
            q = following[column]
            mirrored = data[q] if q < indptr[column + 1] and indices[q] == row else 0.0
            difference = abs(data[p] - mirrored)
            if difference > largest:
                largest, at_row, at_column = difference, row, column
    return largest, at_row, at_column


@njit(cache=True)
def _largest_excess(indptr, indices, data, root):  # type: ignore[no-untyped-def]
    """Return the largest |g_ij| − √g_ii √g_jj and its first position."""
    largest, at_row, at_column = -np.inf, 0, 0
    for row in range(len(root)):
        for p in range(indptr[row], indptr[row + 1]):
            excess = abs(data[p]) - root[row] * root[indices[p]]
            if excess > largest:
                largest, at_row, at_column = excess, row, indices[p]
    return largest, at_row, at_column
