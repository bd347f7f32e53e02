"""Lemke's pivoting against the theory of linear complementarity problems."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.solvers.lcp.pivoting import Ending, Tableau


def pivoted(matrix: np.ndarray, vector: np.ndarray, most: int = 10_000) -> Tableau:
    tableau = Tableau(np.asarray(matrix, dtype=np.float64), np.asarray(vector, dtype=np.float64))
    tableau.advance(most)
    return tableau


def violation(matrix: np.ndarray, vector: np.ndarray, unknowns: np.ndarray) -> float:
    """The largest violation of z ≥ 0, w ≥ 0, zᵀw = 0."""
    slack = matrix @ unknowns + vector
    return float(np.abs(np.minimum(slack, unknowns)).max(initial=0.0))


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 12), rank=st.integers(0, 12))
def test_a_feasible_semidefinite_problem_of_any_rank_is_solved(seed: int, n: int, rank: int) -> None:
    """The matrix is copositive-plus: a solution is found if one exists, and here one exists by construction."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(min(rank, n), n))
    matrix = root.T @ root
    known = np.maximum(rng.normal(size=n), 0.0)
    slack = np.where(known > 0.0, 0.0, rng.uniform(0.0, 1.0, n))
    vector = slack - matrix @ known
    tableau = pivoted(matrix, vector)
    assert tableau.ending is Ending.SOLUTION
    assert violation(matrix, vector, tableau.solution()) <= 1e-9 * (1.0 + np.abs(vector).max())


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31), n=st.integers(1, 6))
def test_the_solution_of_a_p_matrix_is_that_of_enumerated_bases(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    skew = rng.normal(size=(n, n))
    matrix = skew - skew.T + np.diag(rng.uniform(0.5, 1.5, n))  # positive definite, far from symmetric
    vector = rng.normal(size=n)
    found = pivoted(matrix, vector).solution()
    best = None
    for closed in itertools.product((False, True), repeat=n):
        chosen = np.flatnonzero(closed)
        tried = np.zeros(n)
        tried[chosen] = np.linalg.solve(matrix[np.ix_(chosen, chosen)], -vector[chosen])
        if violation(matrix, vector, tried) <= 1e-9:
            best = tried
    assert best is not None
    assert np.abs(found - best).max() <= 1e-8 * (1.0 + np.abs(best).max())


def test_an_infeasible_semidefinite_problem_ends_on_a_ray() -> None:
    assert pivoted(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([-1.0, -1.0])).ending is Ending.RAY


def test_a_nonnegative_vector_needs_no_pivot() -> None:
    tableau = pivoted(np.eye(3), np.array([0.0, 1.0, 2.0]))
    assert (tableau.ending, tableau.pivots) == (Ending.SOLUTION, 0)
    assert not tableau.solution().any()


@pytest.mark.parametrize("n", [4, 30, 100])
def test_complete_degeneracy_does_not_make_it_cycle(n: int) -> None:
    """All rows are equal and all ratios are tied: n identical contacts under one weight."""
    tableau = pivoted(np.ones((n, n)), -np.ones(n), most=3 * n)
    assert tableau.ending is Ending.SOLUTION
    assert tableau.solution().sum() == pytest.approx(1.0, abs=1e-14)


def test_interrupted_pivoting_gives_the_same_bits() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(20, 30))
    matrix, vector = root.T @ root, rng.normal(size=30) - 1.0
    whole, parts = pivoted(matrix, vector), Tableau(matrix, vector)
    while parts.ending is Ending.UNFINISHED:
        parts.advance(1)
    assert parts.pivots == whole.pivots
    assert np.array_equal(parts.solution(), whole.solution())


def test_the_pivot_limit_holds_for_exponentially_many_pivots() -> None:
    """Murty's lower triangular example: 2ⁿ − 1 pivots for some q; the given count is never exceeded."""
    n = 12
    matrix = 2.0 * np.tril(np.ones((n, n)), -1).T + np.eye(n)
    tableau = Tableau(matrix, -np.ones(n))
    tableau.advance(3)
    assert tableau.pivots <= 3
