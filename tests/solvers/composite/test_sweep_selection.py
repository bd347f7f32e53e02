"""Robust selects its sweeps by size and coupling."""

from collections.abc import Callable

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.solvers import Solver, Stop
from proxbench.solvers.composite.sweep_selection import select_sweeps, sweeps_between_checks
from proxbench.solvers.prox.nsgs import NSGS
from proxbench.solvers.prox.safeguarded_sorprox import SafeguardedSORprox
from proxbench.solvers.prox.sorprox import SORprox
from scipy.linalg import block_diag


def by_matrix(coupling: float) -> ContactProblem:
    """Return two spatial contacts, coupled by one entry of G."""
    matrix = block_diag(np.eye(3), np.eye(3))
    matrix[0, 3] = matrix[3, 0] = coupling
    return ContactProblem.from_delassus(matrix, [-1.0, 0.1, 0.0, -1.0, 0.0, 0.1], 0.3)


def by_factors(coupling: float) -> ContactProblem:
    """Return two spatial contacts on one body each; the second contact also touches the first body."""
    directions = np.eye(6)
    directions[0, 3] = coupling
    return ContactProblem.from_factors(directions, np.ones(6), [-1.0, 0.1, 0.0, -1.0, 0.0, 0.1], 0.3)


@pytest.mark.parametrize("make", [by_matrix, by_factors])
def test_contacts_that_share_no_body_are_solved_one_by_one(make: Callable[[float], ContactProblem]) -> None:
    apart, together = make(0.0), make(0.5)
    assert isinstance(select_sweeps(apart), NSGS)
    assert not isinstance(select_sweeps(together), NSGS)


@pytest.mark.parametrize("name", ["hard-touching", "hard-many-rods", "hard-scattered-100", "hard-inclines-30"])
def test_one_sweep_over_uncoupled_contacts_is_exact(name: str) -> None:
    problem = load(name)
    solution = select_sweeps(problem).prepare(problem).solve(Stop(1e-10, max_iterations=1))
    assert judge(problem, solution.impulses).residual <= 1e-10


@pytest.mark.parametrize(
    ("name", "least"), [("hard-sticking-box", 8), ("hard-touching", 1), ("hard-stack-10", 10), ("funnel-100", 1)]
)
def test_the_interval_of_checks_is_their_cost_in_sweeps(name: str, least: int) -> None:
    problem = load(name)
    assert sweeps_between_checks(problem, select_sweeps(problem)) == least


@pytest.mark.parametrize(
    ("name", "sweeps"),
    [
        ("hard-random-mu8", SafeguardedSORprox(1.5)),  # 60 rows; sweeps over the factors do not solve it
        ("hard-supports-128", SORprox(relaxation=1.5, form="factors")),
        ("hard-sticking-box-256", SORprox(relaxation=1.5, form="factors")),
    ],
)
def test_few_rows_get_the_safeguard_and_a_single_body_its_factors(name: str, sweeps: Solver) -> None:
    assert select_sweeps(load(name)) == sweeps
