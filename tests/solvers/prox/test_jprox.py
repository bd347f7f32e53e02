"""Jprox implements equation [46]."""

from collections.abc import Callable

import numpy as np
from proxbench.problems import ContactProblem
from proxbench.solvers import Status, solve


def jprox_by_the_book(problem: ContactProblem, count: int) -> np.ndarray:
    """[46]: −1/α_i (Σ_{j≠i} G_ij Λ_j + c_i + B_i Λ_i), with G_ii = α_i I + B_i, for spatial contacts of equal μ."""
    delassus, c = problem.delassus().toarray(), problem.free_velocity
    impulses = np.zeros(problem.n_rows)
    iterates = []
    for _ in range(count):
        new = np.empty_like(impulses)
        for first in range(0, problem.n_rows, 3):
            for rows in (np.array([first]), np.array([first + 1, first + 2])):
                alpha = delassus[rows, rows].max()
                rest = delassus[np.ix_(rows, rows)] - alpha * np.eye(len(rows))
                others = np.setdiff1d(np.arange(problem.n_rows), rows)
                inner = delassus[np.ix_(rows, others)] @ impulses[others] + c[rows] + rest @ impulses[rows]
                argument = -inner / alpha
                if len(rows) == 1:
                    new[rows] = np.maximum(argument, 0.0)
                else:
                    bound, length = 0.4 * new[first], np.linalg.norm(argument)
                    new[rows] = argument * (bound / length if length > bound else 1.0)
        impulses = new
        iterates.append(impulses.copy())
    return np.array(iterates)


def test_jprox_iterates_satisfy_equation_46(
    random_spatial: Callable[[int], ContactProblem], first_iterates: Callable[[ContactProblem, str, int], np.ndarray]
) -> None:
    problem = random_spatial(0)
    expected = jprox_by_the_book(problem, 6)
    assert np.abs(first_iterates(problem, "Jprox", 6) - expected).max() <= 1e-12 * np.abs(expected).max()


def test_jacobi_beyond_its_spectral_limit_ends_as_a_cycle_of_two() -> None:
    """k duplicates of one contact: D^-½ G D^-½ has the eigenvalue k > 2, so Jacobi alternates instead of converging."""
    problem = ContactProblem.from_delassus(np.ones((5, 5)), -np.ones(5), dim=1)
    solution = solve(problem, "Jprox", tolerance=1e-8)
    assert solution.status is Status.OSCILLATING
    assert "cycle" in solution.message
