"""Anderson acceleration is equivalent to GMRES for linear maps; without memory, it is the plain iteration."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.solvers.iteration.anderson import Anderson


def contraction(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return A, symmetric with eigenvalues from 0.1 to 0.9, and b of a linear map x ↦ A x + b."""
    rng = np.random.default_rng(seed)
    vectors = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return vectors @ np.diag(rng.uniform(0.1, 0.9, n)) @ vectors.T, rng.normal(size=n)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 6))
def test_a_linear_map_of_n_dimensions_is_solved_after_n_extrapolations(seed: int, n: int) -> None:
    matrix, offset = contraction(seed, n)
    x, anderson = np.zeros(n), Anderson(n + 1)
    for _ in range(n + 2):
        x = anderson.next(x, matrix @ x + offset)
    exact = np.linalg.solve(np.eye(n) - matrix, offset)
    assert x == pytest.approx(exact, abs=1e-6 * max(1.0, float(np.abs(exact).max())))


def test_without_memory_the_iteration_is_plain() -> None:
    matrix, offset = contraction(1, 4)
    x, anderson = np.zeros(4), Anderson(0)
    for _ in range(5):
        image = matrix @ x + offset
        x = anderson.next(x, image)
        assert np.array_equal(x, image)


def test_after_a_restart_the_next_step_is_plain() -> None:
    matrix, offset = contraction(2, 4)
    x, anderson = np.zeros(4), Anderson(3)
    for _ in range(3):
        x = anderson.next(x, matrix @ x + offset)
    anderson.restart()
    image = matrix @ x + offset
    assert np.array_equal(anderson.next(x, image), image)
