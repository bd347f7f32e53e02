"""JORprox is Jprox with other step sizes, which make it converge."""

from collections.abc import Callable

import numpy as np
import pytest
from proxbench.problems import ContactProblem
from proxbench.solvers import Status, solve

Seeded = Callable[[int], ContactProblem]
Iterates = Callable[[ContactProblem, str, int], np.ndarray]


def test_jorprox_with_unit_relaxation_is_jprox(random_spatial: Seeded, first_iterates: Iterates) -> None:
    problem = random_spatial(1)
    assert np.array_equal(first_iterates(problem, "JORprox", 8), first_iterates(problem, "Jprox", 8))


def test_a_jacobi_sweep_does_not_depend_on_the_order_of_contacts(
    random_spatial: Seeded, first_iterates: Iterates
) -> None:
    problem = random_spatial(2)
    order = np.random.default_rng(5).permutation(problem.n_rows // 3)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    delassus = problem.delassus().toarray()[np.ix_(rows, rows)]
    permuted = ContactProblem.from_delassus(delassus, problem.free_velocity[rows], 0.4)
    solver = "JORprox(relaxation=0.1)"
    straight, turned = first_iterates(problem, solver, 30)[-1], first_iterates(permuted, solver, 30)[-1]
    assert np.abs(straight[rows] - turned).max() <= 1e-12 * np.abs(straight).max()


@pytest.mark.parametrize("solver", ["JORprox(relaxation=0.3)", "JORprox(step_size='row_sum')"])
def test_smaller_steps_prevent_the_cycle(solver: str) -> None:
    problem = ContactProblem.from_delassus(np.ones((5, 5)), -np.ones(5), dim=1)
    solution = solve(problem, solver, tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert solution.impulses.sum() == pytest.approx(1.0, abs=1e-7)
