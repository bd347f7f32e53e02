"""Adaptive relaxation: Young's ω, plain sweeps where these suffice, and problems on which a fixed ω fails."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.hard.stacks import stack
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.iteration.relaxation import MAX_RELAXATION, WINDOW, AdaptiveRelaxation, next_relaxation
from proxbench.solvers.sweeps.delassus import DelassusIterates, DelassusSweep
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes, lane_weights


def adaptive(problem: ContactProblem, start: np.ndarray) -> AdaptiveRelaxation:
    sizes = diagonal_step_sizes(problem, 1.0)
    sweep = DelassusSweep.over(problem, sizes)
    return AdaptiveRelaxation(DelassusIterates(sweep, start), lane_weights(problem.layout, sizes))


def high_friction(dim: int, seed: int) -> ContactProblem:
    """Eight contacts of friction coefficient 1 with random couplings, redundant ones among them."""
    rng = np.random.default_rng(seed)
    rows, dofs = 8 * dim, 8 * dim if seed % 2 else int(5.6 * dim)
    directions = rng.normal(size=(dofs, rows))
    directions[rng.random(directions.shape) < 0.5] = 0.0
    free = directions.T @ rng.normal(size=dofs)
    return ContactProblem.from_factors(directions, np.ones(dofs), free, 1.0, dim=dim)


def chain(n: int) -> ContactProblem:
    """Contacts pressed against each other in a row: all close, and sweeps are those of a linear system."""
    delassus = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    return ContactProblem.from_delassus(delassus, -delassus @ np.ones(n), dim=1)


@settings(max_examples=100, deadline=None)
@given(mu=st.floats(0.05, 0.99))
def test_relaxation_moves_half_of_the_way_to_youngs_value(mu: float) -> None:
    """At ω = 1 sweeps converge at the rate μ²."""
    best = min(2.0 / (1.0 + np.sqrt(1.0 - mu**2)), MAX_RELAXATION)
    assert next_relaxation(1.0, 1.0, mu ** (2 * (WINDOW - 1))) == pytest.approx(0.5 * (1.0 + best), rel=1e-9)


@settings(max_examples=100, deadline=None)
@given(mu=st.floats(0.2, 0.95), share=st.floats(0.0, 0.95))
def test_the_best_relaxation_does_not_depend_on_the_one_it_was_measured_with(mu: float, share: float) -> None:
    """The rate λ of ω below the best solves (λ + ω − 1)² = λ ω² μ²."""
    best = 2.0 / (1.0 + np.sqrt(1.0 - mu**2))
    omega = 1.0 + share * (best - 1.0)
    root = 0.5 * (omega * mu + np.sqrt(omega**2 * mu**2 - 4.0 * (omega - 1.0)))
    found = next_relaxation(omega, 1.0, root ** (2 * (WINDOW - 1)))
    assert found == pytest.approx(omega + 0.5 * (min(best, MAX_RELAXATION) - omega), rel=1e-6)


def test_growing_and_fast_changes_lower_the_relaxation_and_invalid_ones_keep_it() -> None:
    assert next_relaxation(1.8, 1.0, 2.0) == pytest.approx(1.4)
    assert next_relaxation(1.0, 1.0, 2.0) == 1.0
    assert 1.0 <= next_relaxation(1.8, 1.0, 1e-9) < 1.8
    for first, last in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (np.inf, 1.0), (1.0, np.nan)):
        assert next_relaxation(1.3, first, last) == 1.3


@pytest.mark.parametrize("name", ["funnel-30", "funnel-planar-30", "hard-mixed-laws"])
def test_the_first_window_is_that_of_plain_sweeps_to_the_last_bit(name: str) -> None:
    problem, seen = load(name), {"SORprox": [], "AdaptiveSORprox": []}
    for solver, iterates in seen.items():
        create(solver).prepare(problem).solve(
            Stop(1e-300, WINDOW), observe=lambda _, x, iterates=iterates: iterates.append(x.copy())
        )
    assert len(seen["SORprox"]) == WINDOW
    assert np.array_equal(seen["SORprox"], seen["AdaptiveSORprox"])


def test_a_solution_is_a_fixed_point_whatever_the_relaxation() -> None:
    problem = stack(np.ones(10))
    assert problem.answer is not None
    answer = problem.answer.impulses[0]
    iterates = adaptive(problem, answer)
    iterates.relaxation = 1.7
    iterates.scale_steps(np.ones(problem.layout.n_blocks))
    iterates.sweep(50)
    assert np.abs(iterates.impulses() - answer).max() <= 1e-13 * np.abs(answer).max()


def test_a_chain_needs_the_square_root_of_the_plain_sweeps() -> None:
    """Young: O(n) instead of O(n²), and ω comes near 2 / (1 + sin π/(n+1))."""
    problem = chain(20)
    best = 2.0 / (1.0 + np.sin(np.pi / 21.0))
    iterates = adaptive(problem, np.zeros(20))
    relaxations = []
    for _ in range(12):
        iterates.sweep(WINDOW)
        relaxations.append(iterates.relaxation)
    assert max(relaxations) == pytest.approx(best, abs=0.06)
    plain, fast = (solve(problem, name, tolerance=1e-9) for name in ("SORprox", "AdaptiveSORprox"))
    assert plain.status is fast.status is Status.SOLVED
    assert fast.iterations <= 0.25 * plain.iterations


@pytest.mark.parametrize("dim", [2, 3])
def test_problems_of_high_friction_are_solved_where_a_common_relaxation_fails(dim: int) -> None:
    failed = 0
    for seed in range(20):
        problem = high_friction(dim, seed)
        fixed = solve(problem, "SORprox(relaxation=1.5)", tolerance=1e-8)
        solution = solve(problem, "AdaptiveSORprox", tolerance=1e-8, max_iterations=20_000)
        failed += fixed.status is not Status.SOLVED
        assert solution.status is Status.SOLVED
        assert judge(problem, solution.impulses).residual <= 1.001e-8
    assert failed >= 2


def test_an_observer_changes_nothing() -> None:
    """Observed, sweeps are done one by one; windows have to end at the same sweeps."""
    for problem in (load("funnel-100"), high_friction(3, 1)):
        prepared, seen = create("AdaptiveSORprox").prepare(problem), []
        alone = prepared.solve(Stop(1e-8, 500))
        watched = prepared.solve(Stop(1e-8, 500), observe=lambda iteration, _, seen=seen: seen.append(iteration))
        assert seen == list(range(1, watched.iterations + 1))
        assert np.array_equal(alone.impulses, watched.impulses)


def test_without_progress_the_relaxation_returns_to_one() -> None:
    iterates = adaptive(chain(20), np.zeros(20))
    limits = []
    for _ in range(10):
        iterates.sweep(6 * WINDOW)
        limits.append(iterates.relaxation)
        if not iterates.reduce_acceleration():
            break
    assert len(limits) < 10
    assert limits[0] > 1.5
    assert all(later <= 1.0 + 0.5 * (MAX_RELAXATION - 1.0) for later in limits[1:])
    assert limits[-1] == 1.0


@pytest.mark.slow
def test_problems_of_plain_sweeps_are_solved_even_if_relaxation_fails() -> None:
    problem = load("funnel-planar-1000")
    assert create("AdaptiveSORprox").prepare(problem).solve(Stop(1e-8, 30_000)).status is Status.SOLVED
