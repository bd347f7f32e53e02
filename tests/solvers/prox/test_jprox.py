"""Jprox does what equation [46] says."""

import numpy as np
from proxbench.problems import ContactProblem
from proxbench.solvers import Status, Stop, create, solve


def random_spatial(seed: int = 0) -> ContactProblem:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(40, 30))
    return ContactProblem.from_delassus(root.T @ root, rng.normal(size=30), 0.4)


def first_iterates(problem: ContactProblem, solver: str, count: int) -> np.ndarray:
    seen: list[np.ndarray] = []
    create(solver).prepare(problem).solve(Stop(1e-300, count), observe=lambda _, x: seen.append(x.copy()))
    return np.array(seen)


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


def test_jprox_is_equation_46() -> None:
    problem = random_spatial()
    expected = jprox_by_the_book(problem, 6)
    assert np.abs(first_iterates(problem, "Jprox", 6) - expected).max() <= 1e-12 * np.abs(expected).max()


def test_jacobi_beyond_its_spectral_limit_ends_as_a_cycle_of_two() -> None:
    """k duplicates of one contact: D^-½ G D^-½ has the eigenvalue k > 2, so Jacobi alternates instead of converging."""
    problem = ContactProblem.from_delassus(np.ones((5, 5)), -np.ones(5), dim=1)
    solution = solve(problem, "Jprox", tolerance=1e-8)
    assert solution.status is Status.OSCILLATING
    assert "cycle" in solution.message
