"""A matrix with a negative eigenvalue is refused from the tolerance on, and one within it passes, at any size."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.contact.matrices.symmetric import MAX_DENSE_ROWS, NEGATIVE_TOLERANCE


def with_least_eigenvalue(n: int, least: float) -> np.ndarray:
    """Return a symmetric matrix of random directions whose largest eigenvalue is 1."""
    directions = np.linalg.qr(np.random.default_rng(n).normal(size=(n, n)))[0]
    values = np.append(np.linspace(0.1, 1.0, n - 1), least)
    matrix = (directions * values) @ directions.T
    return np.asarray(0.5 * (matrix + matrix.T))


@pytest.mark.parametrize("n", [3, 12, MAX_DENSE_ROWS - 1])
@pytest.mark.parametrize("part", [0.4, 0.8])
def test_few_rows_are_decided_at_the_tolerance(n: int, part: float) -> None:
    ContactProblem.from_delassus(with_least_eigenvalue(n, -part * NEGATIVE_TOLERANCE), -np.ones(n), dim=1)
    with pytest.raises(ProblemError, match="eigenvalue of"):
        ContactProblem.from_delassus(with_least_eigenvalue(n, -NEGATIVE_TOLERANCE / part), -np.ones(n), dim=1)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_many_rows_are_refused_where_an_eigenvalue_stands_apart(dim: int) -> None:
    n = 2 * MAX_DENSE_ROWS - 2 * MAX_DENSE_ROWS % 6 + 6
    ContactProblem.from_delassus(with_least_eigenvalue(n, 0.0), -np.ones(n), dim=dim)
    with pytest.raises(ProblemError, match="eigenvalue of"):
        ContactProblem.from_delassus(with_least_eigenvalue(n, -0.5), -np.ones(n), dim=dim)


def test_a_matrix_of_few_eigenvalues_is_read_to_the_end() -> None:
    ContactProblem.from_delassus(np.eye(300), -np.ones(300))
    ContactProblem.from_delassus(np.zeros((300, 300)), np.ones(300))
