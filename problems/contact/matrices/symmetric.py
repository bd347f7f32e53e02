"""A given G is symmetric positive semidefinite, or an error says where it is not.

Kernels over the blocks of G first look whether it is sound, fast; only where they find that it may not be, or that it
is at the edge, the entries of G are looked at one by one to decide, and to name the worst.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit, uint64

from ...arrays import FloatArray, read_only
from ...errors import IndefiniteError, ProblemError
from ..blocks import BlockLayout
from .delassus import blocks_from_matrix, diagonal_of
from .given import as_matrix, read_matrix

SYMMETRY_TOLERANCE = 1e-12
"""Largest |G − Gᵀ| relative to the largest |G| that passes as rounding."""

SINGLE_SYMMETRY_TOLERANCE = 1e-5
"""The same for a matrix given in single precision, which is then made symmetric."""

NEGATIVE_TOLERANCE = 1e-9
"""Most negative eigenvalue of G relative to the largest that passes as rounding."""

LANCZOS_STEPS = 16
"""Steps of Lanczos' method that look for a negative eigenvalue."""

DENSE_ROWS = 64
"""Rows up to which all eigenvalues count instead."""

EXHAUSTED = 1e-12
"""Lanczos' method ends where what is new in a step is below this part of the largest Ritz value: no more is found."""


def checked_delassus(given: Any, layout: BlockLayout, allow_asymmetric: bool) -> sp.csr_array[Any]:
    """Return G as a canonical read-only CSR array, or raise ``ProblemError``.

    Args:
        given: G [1/kg], dense or scipy sparse, of shape (n_rows, n_rows) for the rows of ``layout``.
        layout: the padded blocks of the problem.
        allow_asymmetric: whether G may be any matrix without negative diagonal entries.
    """
    source = as_matrix(given, "G")
    n_rows, is_single = len(layout.slot), source.dtype == np.float32
    if source.shape != (n_rows, n_rows):
        raise ProblemError(f"G must have shape ({n_rows}, {n_rows}) to go with c, got {source.shape}.")
    matrix: sp.csr_array[Any] = read_matrix(source, "G", sp.csr_array)
    if allow_asymmetric:
        _check_diagonal(matrix)
        return matrix
    if is_single:
        _check_diagonal(matrix)
        _check_symmetry(matrix, SINGLE_SYMMETRY_TOLERANCE)
        matrix = sp.csr_array(0.5 * (matrix + matrix.T))
        read_only(matrix.data, matrix.indices, matrix.indptr)
    tolerance = SINGLE_SYMMETRY_TOLERANCE if is_single else NEGATIVE_TOLERANCE
    if n_rows <= DENSE_ROWS:
        dense = matrix.toarray()
        is_sound = _is_sound_dense(dense, SYMMETRY_TOLERANCE, tolerance)
    else:
        blocks = blocks_from_matrix(matrix, layout)
        arrays = (tuple(range(layout.width)), blocks.starts, blocks.columns, blocks.values.reshape(-1))
        is_sound = _is_sound(*arrays, SYMMETRY_TOLERANCE, tolerance)
    if not is_sound:
        _check_diagonal(matrix)
        _check_symmetry(matrix, SYMMETRY_TOLERANCE)
        _check_minors(matrix, tolerance)
    if n_rows > DENSE_ROWS:
        _check_eigenvalues(_ritz_values(arrays, layout), tolerance)
    elif not _has_root(dense, 0.5 * tolerance):
        _check_eigenvalues(np.linalg.eigvalsh(dense), tolerance)
    return matrix


def _check_diagonal(matrix: sp.csr_array[Any]) -> None:
    diagonal = diagonal_of(matrix)
    if (diagonal < 0).any():
        row = int(np.argmax(diagonal < 0))
        raise IndefiniteError(f"G[{row}, {row}] = {diagonal[row]} must not be negative: G is positive semidefinite.")


def _check_symmetry(matrix: sp.csr_array[Any], tolerance: float) -> None:
    difference, row, column = _largest_asymmetry(matrix.indptr, matrix.indices, matrix.data)
    if difference > tolerance * np.abs(matrix.data).max(initial=0.0):
        raise ProblemError(
            f"G[{row}, {column}] = {matrix[row, column]} but G[{column}, {row}] = {matrix[column, row]}: "
            "G must be symmetric (allow_asymmetric=True admits public data that is not)."
        )


def _check_minors(matrix: sp.csr_array[Any], tolerance: float) -> None:
    """Raise ``ProblemError`` if a 2×2 minor g_ii g_jj − g_ij² shows that G, symmetric, is indefinite."""
    diagonal = diagonal_of(matrix)
    excess, row, column = _largest_excess(matrix.indptr, matrix.indices, matrix.data, np.sqrt(diagonal))
    if excess > tolerance * diagonal.max(initial=0.0):
        root = np.sqrt(diagonal[row]) * np.sqrt(diagonal[column])
        raise IndefiniteError(
            f"G[{row}, {column}] = {matrix[row, column]} exceeds the root of G[{row}, {row}] G[{column}, {column}], "
            f"{root}: G must be positive semidefinite."
        )


def _check_eigenvalues(values: FloatArray, tolerance: float) -> None:
    """Raise ``ProblemError`` if eigenvalues, or Ritz values, of G are negative beyond rounding; they ascend.

    A Ritz value bounds the least eigenvalue from above: what is refused is indefinite, and what passes may be so.
    """
    if len(values) and values[0] < -tolerance * values[-1]:
        raise IndefiniteError(
            f"G has an eigenvalue of {values[0]:.3g} or less beside {values[-1]:.3g}: G must be positive semidefinite."
        )


def _ritz_values(blocks: tuple[Any, Any, Any, Any], layout: BlockLayout) -> FloatArray:
    """Return the Ritz values of G, ascending: ``LANCZOS_STEPS`` steps from a fixed random vector.

    The basis is not made orthogonal again: Ritz values stay within the range of the eigenvalues without (Paige 1976).
    """
    vector = layout.pad(np.random.default_rng(0).normal(size=len(layout.slot))).reshape(-1)
    projected = np.zeros((LANCZOS_STEPS, LANCZOS_STEPS))
    steps = _project(*blocks, vector, projected)
    return np.asarray(np.linalg.eigvalsh(projected[:steps, :steps]), dtype=np.float64)


def _is_sound_dense(matrix: FloatArray, symmetry: float, negative: float) -> bool:
    """Whether G, dense, is symmetric, its diagonal not negative, and none of its 2×2 minors, to the tolerances."""
    diagonal = matrix.diagonal()
    if (diagonal < 0.0).any():
        return False
    size, root = np.abs(matrix), np.sqrt(diagonal)
    excess = size - root[:, None] * root
    if (excess > negative * diagonal.max(initial=0.0)).any():
        return False
    difference = matrix - matrix.T
    return not difference.any() or bool(np.abs(difference).max() <= symmetry * size.max())


def _has_root(matrix: FloatArray, shift: float) -> bool:
    """Whether G, dense, with ``shift`` times its largest diagonal entry on the diagonal has a Cholesky factor.

    Then no eigenvalue of G is further below zero, beside the largest one, but by rounding.
    """
    shifted = matrix.copy()
    shifted.reshape(-1)[:: len(matrix) + 1] += shift * matrix.diagonal().max(initial=0.0)
    try:
        np.linalg.cholesky(shifted)
    except np.linalg.LinAlgError:
        return False
    return True


@njit(cache=True)
def _is_sound(lanes, starts, columns, values, symmetry, negative):  # type: ignore[no-untyped-def]
    """Whether G is symmetric, its diagonal not negative, and none of its 2×2 minors, all but the second to a tolerance.

    Each block below the diagonal is compared with the one that mirrors it: ``ahead`` is the first block of each row
    right of the diagonal that has not been met, and blocks are met in its order. The diagonal stands first in its row.
    """
    one, width = uint64(1), uint64(len(lanes))
    n_blocks, area = uint64(len(starts) - 1), width * width
    root, ahead = np.empty(len(lanes) * (len(starts) - 1)), np.empty(len(starts) - 1, dtype=np.uint64)
    largest, difference, excess, most, n_below, n_above = 0.0, 0.0, 0.0, 0.0, 0, 0
    for i in range(n_blocks):
        first, end = uint64(starts[i]), uint64(starts[i + one])
        own = width * i
        for lane in range(width):
            diagonal = values[area * first + lane * (width + one)]
            if diagonal < 0.0:
                return False
            most = max(most, diagonal)
            root[own + lane] = np.sqrt(diagonal)
        for lane in range(width):
            for other in range(lane):
                entry, mirrored = (
                    values[area * first + width * lane + other],
                    values[area * first + width * other + lane],
                )
                largest = max(largest, max(abs(entry), abs(mirrored)))
                difference = max(difference, abs(entry - mirrored))
                excess = max(excess, max(abs(entry), abs(mirrored)) - root[own + lane] * root[own + other])
        p = first + one
        while p < end and uint64(columns[p]) < i:
            j = uint64(columns[p])
            q = ahead[j]
            if q >= uint64(starts[j + one]) or uint64(columns[q]) != i:
                return False
            ahead[j] = q + one
            for lane in range(width):
                for other in range(width):
                    entry = values[area * p + width * lane + other]
                    mirrored = values[area * q + width * other + lane]
                    larger = max(abs(entry), abs(mirrored))
                    largest = max(largest, larger)
                    difference = max(difference, abs(entry - mirrored))
                    excess = max(excess, larger - root[own + lane] * root[width * j + other])
            p += one
        ahead[i] = p
        n_below += p - first - one
        n_above += end - p
    largest = max(largest, most)
    return n_below == n_above and difference <= symmetry * largest and excess <= negative * most


@njit(cache=True, fastmath={"contract", "reassoc"})
def _project(lanes, starts, columns, values, vector, projected):  # type: ignore[no-untyped-def]
    """Write Qᵀ G Q, tridiagonal, for the Lanczos basis Q from ``vector``, which is lost; return the number of steps."""
    width, n = len(lanes), uint64(len(vector))
    before, product = np.zeros(len(vector)), np.empty(len(vector))
    squared = 0.0
    for k in range(n):
        squared += vector[k] * vector[k]
    length, coupling, largest = np.sqrt(squared), 0.0, 0.0
    for step in range(len(projected)):
        if length <= EXHAUSTED * largest:
            return step
        if step > 0:
            projected[step, step - 1] = projected[step - 1, step] = length
            coupling = length
        scale = 1.0 / length
        for k in range(n):
            vector[k] *= scale
        if width == 3:
            _times_spatial(starts, columns, values, vector, product)
        else:
            _times(lanes, starts, columns, values, vector, product)
        ritz = 0.0
        for k in range(n):
            ritz += product[k] * vector[k]
        projected[step, step] = ritz
        largest = max(largest, max(abs(ritz), length if step > 0 else 0.0))
        squared = 0.0
        for k in range(n):
            after = product[k] - ritz * vector[k] - coupling * before[k]
            before[k], vector[k] = vector[k], after
            squared += after * after
        length = np.sqrt(squared)
    return len(projected)


@njit(cache=True, fastmath={"contract"})
def _times(lanes, starts, columns, values, vector, product):  # type: ignore[no-untyped-def]
    """Write G times a vector."""
    one, width = uint64(1), uint64(len(lanes))
    for i in range(uint64(len(starts) - 1)):
        for lane in range(width):
            product[width * i + lane] = 0.0
        for p in range(uint64(starts[i]), uint64(starts[i + one])):
            j, v = width * uint64(columns[p]), width * width * p
            for lane in range(width):
                total = 0.0
                for other in range(width):
                    total += values[v + width * lane + other] * vector[j + other]
                product[width * i + lane] += total


@njit(cache=True, fastmath={"contract"})
def _times_spatial(starts, columns, values, vector, product):  # type: ignore[no-untyped-def]
    """Do the same for blocks of three lanes, a third faster."""
    one, two, three = uint64(1), uint64(2), uint64(3)
    for i in range(uint64(len(starts) - 1)):
        normal, first, second = 0.0, 0.0, 0.0
        for p in range(uint64(starts[i]), uint64(starts[i + one])):
            j, v = three * uint64(columns[p]), uint64(9) * p
            n, t, s = vector[j], vector[j + one], vector[j + two]
            normal += values[v] * n + values[v + one] * t + values[v + two] * s
            first += values[v + three] * n + values[v + uint64(4)] * t + values[v + uint64(5)] * s
            second += values[v + uint64(6)] * n + values[v + uint64(7)] * t + values[v + uint64(8)] * s
        k = three * i
        product[k], product[k + one], product[k + two] = normal, first, second


@njit(cache=True)
def _largest_asymmetry(indptr, indices, data):  # type: ignore[no-untyped-def]
    """Return the largest |g_ij − g_ji| and its place, the first of equals; the columns of each row ascend.

    ``following`` is the entry of each row from which on its columns are not below the present row.
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
    """Return the largest |g_ij| − √g_ii √g_jj and its place, the first of equals."""
    largest, at_row, at_column = -np.inf, 0, 0
    for row in range(len(root)):
        for p in range(indptr[row], indptr[row + 1]):
            excess = abs(data[p]) - root[row] * root[indices[p]]
            if excess > largest:
                largest, at_row, at_column = excess, row, indices[p]
    return largest, at_row, at_column
