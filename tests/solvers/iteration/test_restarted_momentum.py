"""Restarted momentum: its definition, its sweeps as a function of the condition, and its bound."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.hard.stacks import stack
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.iteration.momentum import RestartedMomentum


def history(problem: ContactProblem, solver: str, count: int, start: np.ndarray | None = None) -> np.ndarray:
    seen: list[np.ndarray] = []
    create(solver).prepare(problem).solve(Stop(1e-300, count), start, observe=lambda _, x: seen.append(x.copy()))
    return np.array(seen)


@pytest.mark.parametrize("name", ["funnel-30", "funnel-planar-30", "hard-mixed-laws"])
def test_each_sweep_follows_nesterovs_sequence_with_restarts(name: str) -> None:
    problem = load(name)
    expected, turns, age, momentum = [np.zeros(problem.n_rows)], 0, 1.0, 0.0
    change = np.zeros(problem.n_rows)
    for _ in range(120):
        begin = expected[-1] + momentum * change
        end = history(problem, "SORprox", 1, begin)[0]
        change = end - expected[-1]
        if (begin - end) @ change > 0.0:
            turns, age, momentum = turns + 1, 1.0, 0.0
        else:
            after = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * age**2))
            age, momentum = after, (age - 1.0) / after
        expected.append(end)
    seen = history(problem, "NesterovSORprox", 120)
    assert 0 < turns < 60
    assert np.abs(seen - np.array(expected[1:])).max() <= 1e-11 * np.abs(seen).max()


def test_sweeps_grow_with_the_root_of_the_condition_where_plain_ones_grow_with_the_condition() -> None:
    """The condition of a stack grows with the square of its blocks: sixteenfold from 20 to 80."""
    sweeps = {
        solver: [solve(stack(np.ones(n)), solver, tolerance=1e-6, max_iterations=10**5).iterations for n in (20, 80)]
        for solver in ("SORprox", "NesterovSORprox")
    }
    assert sweeps["SORprox"][1] >= 12 * sweeps["SORprox"][0]
    assert sweeps["NesterovSORprox"][1] <= 5 * sweeps["NesterovSORprox"][0]


@pytest.mark.parametrize(
    ("name", "tolerance"), [("hard-tower-100", 1e-8), ("pile-300", 1e-4), ("funnel-planar-300", 1e-8)]
)
def test_it_takes_less_than_half_the_sweeps_of_the_best_relaxation(name: str, tolerance: float) -> None:
    problem = load(name)
    solution = solve(problem, "NesterovSORprox", tolerance=tolerance)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= tolerance
    relaxed = create("SORprox(relaxation=1.5)").prepare(problem).solve(Stop(tolerance, 2 * solution.iterations))
    assert relaxed.status is Status.ITERATION_LIMIT


def test_a_bound_of_zero_leaves_plain_sweeps() -> None:
    """Without progress the bound of β is halved and finally zero."""
    problem = load("funnel-30")
    iterates = create("NesterovSORprox").prepare(problem).begin(np.zeros(problem.n_rows))
    assert isinstance(iterates, RestartedMomentum)
    while iterates.reduce_acceleration():
        pass
    iterates.sweep(15)
    assert np.array_equal(iterates.impulses(), history(problem, "SORprox", 15)[-1])


def test_momentum_restarts_where_sweeps_over_redundant_joints_grow() -> None:
    """Twenty parallel cranks: without restarts, impulses grow by many orders, and rounding destroys all digits."""
    problem = load("hard-four-bar-redundant-20")
    solution = solve(problem, "NesterovSORprox", tolerance=1e-8, max_iterations=1000)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-8
