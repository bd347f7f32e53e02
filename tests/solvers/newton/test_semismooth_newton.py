"""SemismoothNewton is Newton's method alone: fast near a solution, with true statuses elsewhere."""

import itertools

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.hard.families import Family, random_problem
from proxbench.problems.hard.stacks import stack
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.newton.semismooth_newton import CycleDetector


def residuals(problem: ContactProblem, start: np.ndarray) -> list[float]:
    seen: list[float] = []
    create("SemismoothNewton").prepare(problem).solve(
        Stop(1e-13, 50), start, lambda _, x: seen.append(judge(problem, x).residual)
    )
    return seen


@pytest.mark.parametrize("masses", [[1.0] * 100, [1.0] * 9 + [1e4], list(np.logspace(0, 4, 10))])
def test_a_stack_of_any_masses_takes_at_most_one_step_per_contact(masses: list[float]) -> None:
    """From zero, each step closes at least one more contact, and once all are closed, the equations are linear."""
    problem = stack(np.array(masses))
    assert problem.answer is not None
    solution = solve(problem, "SemismoothNewton", tolerance=1e-9)
    assert solution.status is Status.SOLVED
    assert solution.iterations <= len(masses) + 1
    assert np.abs(solution.impulses / problem.answer.impulses[0] - 1.0).max() <= 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_it_converges_quadratically_where_contacts_slip_in_space(seed: int) -> None:
    """Only the direction of slip is nonlinear; with known Λ_N, every step squares the residual."""
    problem = random_problem(Family(6, dim=3, n_dofs=60, friction=0.5, states=("slip",)), seed)
    assert problem.answer is not None
    witness = np.asarray(problem.answer.witness)
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, len(witness))
    seen = residuals(problem, witness * (1.0 + 1e-2 * noise))
    assert seen[-1] <= 1e-13
    assert len(seen) <= 6
    for before, after in itertools.pairwise(seen):
        assert after <= max(100.0 * before**2, 1e-13)


@pytest.mark.parametrize("name", ["hard-mixed-laws", "hard-tresca-joint", "hard-counterexample"])
def test_velocity_agrees_with_the_known_answer(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "SemismoothNewton", tolerance=1e-12)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).velocity_error <= 1e-10  # type: ignore[operator]


def test_after_sweeps_it_solves_a_stack_that_sweeps_alone_do_not_solve() -> None:
    """Two blocks, the upper one 10⁴ times heavier: each sweep passes on 10⁻⁴ of the weight."""
    problem = load("hard-stack-2-top-1e4")
    swept = solve(problem, "SORprox", tolerance=1e-10, max_iterations=5000)
    solution = solve(problem, "Fallback(SORprox, SemismoothNewton)", tolerance=1e-10, max_iterations=5000)
    assert swept.status is Status.ITERATION_LIMIT
    assert solution.status is Status.SOLVED


@pytest.mark.parametrize("limit", [0, 1, 7])
def test_it_stops_at_the_iteration_limit_and_shows_every_step(limit: int) -> None:
    seen: list[int] = []
    prepared = create("SemismoothNewton").prepare(load("pile-100"))
    solution = prepared.solve(Stop(1e-12, limit), observe=lambda iteration, _: seen.append(iteration))
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == limit
    assert seen == list(range(1, limit + 1))


def test_the_best_iterate_is_returned() -> None:
    problem, seen = load("pile-100"), []
    start = np.zeros(problem.n_rows)
    solution = (
        create("SemismoothNewton")
        .prepare(problem)
        .solve(Stop(1e-12, 30), start, lambda _, x: seen.append(judge(problem, x).residual))
    )
    assert judge(problem, solution.impulses).residual <= min(seen)


@pytest.mark.parametrize("length", [1, 2, 3, 7])
def test_cycles_of_any_length_are_detected_and_constant_iterates_are_a_stall(length: int) -> None:
    repeats = CycleDetector(np.array([-1.0]))
    for count in range(8 * length + 8):
        assert repeats.status is None
        repeats.record(np.array([float(max(count - 3, 0) % length)]) if count >= 3 else np.array([10.0 + count]))
        if repeats.status is not None:
            break
    assert repeats.status is (Status.STALLED if length == 1 else Status.OSCILLATING)


def test_monotone_iterates_are_not_reported_as_a_cycle() -> None:
    repeats = CycleDetector(np.zeros(2))
    for count in range(100):
        repeats.record(np.array([1.0, 1.0 + 1e-12 * count]))
        if count > 0:
            assert repeats.status is None
