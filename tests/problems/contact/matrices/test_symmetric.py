"""A matrix is refused if it has a negative eigenvalue beyond the tolerance, at any size."""

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.contact.matrices.symmetric import (
    MAX_DENSE_ROWS,
    NEGATIVE_TOLERANCE,
    SYMMETRY_TOLERANCE,
    _is_sound_dense,
    _is_sound_sparse,
)


def with_least_eigenvalue(n: int, least: float) -> np.ndarray:
    """Return a symmetric matrix of random directions whose largest eigenvalue is 1."""
    directions = np.linalg.qr(np.random.default_rng(n).normal(size=(n, n)))[0]
    values = np.append(np.linspace(0.1, 1.0, n - 1), least)
    matrix = (directions * values) @ directions.T
    return np.asarray(0.5 * (matrix + matrix.T))


@pytest.mark.parametrize("n", [3, 12, MAX_DENSE_ROWS - 1])
@pytest.mark.parametrize("part", [0.4, 0.8])
def test_small_matrices_are_accepted_or_refused_exactly_at_the_tolerance(n: int, part: float) -> None:
    ContactProblem.from_delassus(with_least_eigenvalue(n, -part * NEGATIVE_TOLERANCE), -np.ones(n), dim=1)
    with pytest.raises(ProblemError, match="eigenvalue of"):
        ContactProblem.from_delassus(with_least_eigenvalue(n, -NEGATIVE_TOLERANCE / part), -np.ones(n), dim=1)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_large_matrices_with_an_isolated_negative_eigenvalue_are_refused(dim: int) -> None:
    n = 2 * MAX_DENSE_ROWS - 2 * MAX_DENSE_ROWS % 6 + 6
    ContactProblem.from_delassus(with_least_eigenvalue(n, 0.0), -np.ones(n), dim=dim)
    with pytest.raises(ProblemError, match="eigenvalue of"):
        ContactProblem.from_delassus(with_least_eigenvalue(n, -0.5), -np.ones(n), dim=dim)


def test_large_matrices_with_a_single_distinct_eigenvalue_are_accepted() -> None:
    ContactProblem.from_delassus(np.eye(300), -np.ones(300))
    ContactProblem.from_delassus(np.zeros((300, 300)), np.ones(300))


@pytest.mark.parametrize("change", ["none", "mirrored", "alone", "minor", "diagonal"])
@pytest.mark.parametrize("part", [0.5, 2.0])
def test_sparse_and_dense_forms_of_a_matrix_pass_the_same_checks(change: str, part: float) -> None:
    """One change violates symmetry, a 2 × 2 minor or the sign of a diagonal entry, within or beyond a tolerance."""
    rng, tolerance = np.random.default_rng(7), 1e-3
    for _ in range(20):
        n = int(rng.integers(2, 8))
        matrix = rng.uniform(-0.5, 0.5, (n, n)) * (rng.random((n, n)) < 0.5)
        matrix = matrix + matrix.T
        matrix[np.diag_indices(n)] = rng.uniform(2.0, 3.0, n)
        i, j = rng.choice(n, 2, replace=False)
        if change == "mirrored":
            matrix[i, j] = matrix[j, i] + part * SYMMETRY_TOLERANCE * matrix.max() * rng.choice([-1.0, 1.0])
        elif change == "alone":
            matrix[i, j], matrix[j, i] = part * SYMMETRY_TOLERANCE * matrix.max(), 0.0
        elif change == "minor":
            excess = part * tolerance * matrix.max()
            matrix[i, j] = matrix[j, i] = rng.choice([-1.0, 1.0]) * (np.sqrt(matrix[i, i] * matrix[j, j]) + excess)
        elif change == "diagonal":
            matrix[i, :] = matrix[:, i] = 0.0
            matrix[i, i] = (part - 1.0) * 1e-9
        is_sound, is_paired = _is_sound_dense(matrix, tolerance), np.array_equal(matrix != 0.0, matrix.T != 0.0)
        assert is_sound == (change == "none" or (part > 1.0) == (change == "diagonal"))
        assert _is_sound_sparse(sp.csr_array(matrix), tolerance) == (is_sound and is_paired)


@pytest.mark.parametrize("n", [MAX_DENSE_ROWS, MAX_DENSE_ROWS + 1])
@pytest.mark.parametrize(("first", "second"), [(0.5, 0.3), (0.3, 0.5), (0.5, -0.5), (0.5, 0.0), (0.0, 0.5)])
def test_entries_that_differ_across_the_diagonal_are_refused_at_any_size(n: int, first: float, second: float) -> None:
    matrix = np.eye(n)
    matrix[1, 4], matrix[4, 1] = first, second
    with pytest.raises(ProblemError, match="G must be symmetric"):
        ContactProblem.from_delassus(matrix, -np.ones(n), dim=1)


@pytest.mark.parametrize("seed", range(30))
def test_the_fast_check_of_a_sparse_matrix_agrees_with_the_detailed_checks(seed: int) -> None:
    """Symmetric matrices pass; one changed entry, or one without its mirror image, makes the answer false."""
    rng = np.random.default_rng(seed)
    root = sp.random_array((80, 80), density=0.05, rng=rng, format="csr")
    matrix = sp.csr_array(root @ root.T + sp.eye_array(80))
    matrix = sp.csr_array(0.5 * (matrix + matrix.T))
    matrix.sort_indices()
    assert _is_sound_sparse(matrix, 1e-9)
    place = int(rng.choice(np.flatnonzero(matrix.indices != np.repeat(np.arange(80), np.diff(matrix.indptr)))))
    changed = matrix.copy()
    changed.data[place] += 1e-9
    assert not _is_sound_sparse(changed, 1e-9)
    dropped = matrix.copy()
    dropped.data[place] = 0.0
    dropped.eliminate_zeros()
    assert not _is_sound_sparse(dropped, 1e-9)
    large = matrix.tolil()
    large[0, 1] = large[1, 0] = 1.1 * np.sqrt(matrix[0, 0] * matrix[1, 1])
    assert not _is_sound_sparse(sp.csr_array(large), 1e-9)
    negative = matrix.copy()
    negative.setdiag(np.where(np.arange(80) == 3, -1.0, matrix.diagonal()))
    assert not _is_sound_sparse(sp.csr_array(negative), 1e-9)
