"""Jprox and JORprox do what equations [41–51] say."""

import numpy as np
import pytest
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


def test_jorprox_with_unit_relaxation_is_jprox() -> None:
    problem = random_spatial(1)
    assert np.array_equal(first_iterates(problem, "JORprox", 8), first_iterates(problem, "Jprox", 8))


def test_a_jacobi_sweep_does_not_depend_on_the_order_of_contacts() -> None:
    problem = random_spatial(2)
    order = np.random.default_rng(5).permutation(problem.n_rows // 3)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    delassus = problem.delassus().toarray()[np.ix_(rows, rows)]
    permuted = ContactProblem.from_delassus(delassus, problem.free_velocity[rows], 0.4)
    solver = "JORprox(relaxation=0.1)"
    straight, turned = first_iterates(problem, solver, 30)[-1], first_iterates(permuted, solver, 30)[-1]
    assert np.abs(straight[rows] - turned).max() <= 1e-12 * np.abs(straight).max()


def test_jacobi_beyond_its_spectral_limit_ends_as_a_cycle_of_two() -> None:
    """k duplicates of one contact: D^-½ G D^-½ has the eigenvalue k > 2, so Jacobi alternates instead of converging."""
    problem = ContactProblem.from_delassus(np.ones((5, 5)), -np.ones(5), dim=1)
    solution = solve(problem, "Jprox", tolerance=1e-8)
    assert solution.status is Status.OSCILLATING
    assert "cycle" in solution.message


@pytest.mark.parametrize("solver", ["JORprox(relaxation=0.3)", "JORprox(step_size='row_sum')"])
def test_smaller_steps_mend_the_cycle(solver: str) -> None:
    problem = ContactProblem.from_delassus(np.ones((5, 5)), -np.ones(5), dim=1)
    solution = solve(problem, solver, tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert solution.impulses.sum() == pytest.approx(1.0, abs=1e-7)
