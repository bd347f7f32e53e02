"""Momentum: its definition, equality of all forms, its gain, and its reduction where it does harm."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.iteration.momentum import MomentumIterates
from proxbench.solvers.iteration.stopping import MAX_CHECK_INTERVAL


def history(problem: ContactProblem, form: str, count: int, **options: float) -> np.ndarray:
    seen: list[np.ndarray] = []
    prepared = create("SORprox", form=form, **options).prepare(problem)
    prepared.solve(Stop(1e-300, count), observe=lambda _, x: seen.append(x.copy()))
    return np.array(seen)


def one_sweep_from(problem: ContactProblem, start: np.ndarray, relaxation: float) -> np.ndarray:
    seen: list[np.ndarray] = []
    prepared = create("SORprox", relaxation=relaxation).prepare(problem)
    prepared.solve(Stop(1e-300, 1), start, observe=lambda _, x: seen.append(x.copy()))
    return seen[0]


@pytest.mark.parametrize(("momentum", "delay"), [(0.8, 0.0), (0.98, 1.0)])
def test_each_sweep_extrapolates_the_last_change_unless_it_turned_back(momentum: float, delay: float) -> None:
    problem = load("funnel-30")
    expected, turns = [np.zeros(problem.n_rows)], 0
    change, present = np.zeros(problem.n_rows), 0.0
    for k in range(1, 41):
        begin = expected[-1] + present * change
        end = one_sweep_from(problem, begin, 1.1)
        change = end - expected[-1]
        turned = (begin - end) @ change > 0.0
        turns += turned
        present = 0.0 if turned else min(momentum, k / (k + delay))
        expected.append(end)
    seen = history(problem, "delassus", 40, relaxation=1.1, momentum=momentum, momentum_delay=delay)
    assert 0 < turns < 40
    assert np.abs(seen - np.array(expected[1:])).max() <= 1e-12 * np.abs(seen).max()


@pytest.mark.parametrize("delay", [0.0, 4.0])
@pytest.mark.parametrize("name", ["funnel-planar-30", "funnel-frictionless-300", "funnel-30", "funnel-300"])
def test_all_forms_give_the_same_iterates_to_rounding(name: str, delay: float) -> None:
    """The last problem is swept in batches."""
    problem, options = load(name), {"relaxation": 1.1, "momentum": 0.8, "momentum_delay": delay}
    first, second = (history(problem, form, 40, **options) for form in ("delassus", "factors"))
    assert np.abs(first - second).max() <= 1e-11 * np.abs(first).max()


@pytest.mark.parametrize("form", ["delassus", "factors"])
def test_many_contacts_need_less_than_half_the_sweeps_of_the_best_relaxation_alone(form: str) -> None:
    problem = load("funnel-1000")
    plain = solve(problem, create("SORprox", relaxation=1.5, form=form), tolerance=1e-6)
    fast = solve(problem, create("SORprox", relaxation=1.1, form=form, momentum=0.8), tolerance=1e-6)
    assert fast.status is plain.status is Status.SOLVED
    assert fast.iterations <= 0.5 * plain.iterations
    assert judge(problem, fast.impulses).residual <= 1.001e-6


@pytest.mark.parametrize("name", ["funnel-100", "funnel-300"])
def test_too_much_momentum_is_reduced_until_the_problem_is_solved(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "SORprox(relaxation=1.4, momentum=0.97, form='factors')", tolerance=1e-6)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1.001e-6


def test_momentum_is_reduced_to_zero() -> None:
    class Still:
        def sweep(self, count: int) -> None: ...

        def impulses(self) -> np.ndarray:
            return np.zeros(1)

        relative_velocity = impulses

        def linear_state(self) -> tuple[np.ndarray, int]:
            return np.zeros(1), 1

    iterates = MomentumIterates(Still(), 0.8)
    assert [iterates.reduce_acceleration() for _ in range(5)] == [True, True, True, False, False]


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("name", ["funnel-1000", "funnel-planar-300", "pile-100"])
def test_growing_momentum_needs_about_as_few_sweeps_as_short_and_long_memory(name: str, tolerance: float) -> None:
    """The margin is one interval between checks of the residual; short memory alone takes up to three times as many."""
    problem = load(name)
    constant = [f"SORprox(relaxation=1.1, momentum={beta}, form='factors')" for beta in (0.65, 0.8)]
    growing = "SORprox(relaxation=1.1, momentum=0.8, momentum_delay=4, form='factors')"
    counts = [solve(problem, solver, tolerance, max_iterations=2000).iterations for solver in (*constant, growing)]
    assert counts[-1] <= 1.1 * min(counts[:-1]) + MAX_CHECK_INTERVAL


@pytest.mark.parametrize("delay", [-1.0, float("inf"), float("nan"), "long"])
def test_delay_out_of_range_is_refused(delay: object) -> None:
    with pytest.raises(SolverError, match="momentum_delay"):
        create("SORprox", momentum=0.5, momentum_delay=delay)


@pytest.mark.parametrize("momentum", [-0.1, 1.0, float("nan"), "much"])
def test_momentum_out_of_range_is_refused(momentum: object) -> None:
    with pytest.raises(SolverError, match="momentum"):
        create("SORprox", momentum=momentum)
