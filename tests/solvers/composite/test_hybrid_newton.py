"""HybridNewton solves problems on which sweeps are slow, and equals sweeps on others."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.hard.families import Family, random_problem
from proxbench.problems.hard.stacks import stack
from proxbench.problems.hard.supports import block_on_supports
from proxbench.solvers import SolverError, Status, Stop, create, solve

SEEDS = st.integers(0, 2**31)

STACKS = {
    "2, upper 1e6": [1.0, 1e6],
    "2, lower 1e6": [1e6, 1.0],
    "10, top 1e4": [1.0] * 9 + [1e4],
    "10, bottom 1e4": [1e4] + [1.0] * 9,
    "10, growing to 1e4": list(np.logspace(0, 4, 10)),
    "10, falling to 1e-4": list(np.logspace(0, -4, 10)),
    "100, equal": [1.0] * 100,
}


@pytest.mark.parametrize("solver", ["HybridNewton", "Lemke"])
@pytest.mark.parametrize("masses", STACKS.values(), ids=STACKS)
def test_stacks_of_unequal_masses_have_the_known_impulses(masses: list[float], solver: str) -> None:
    problem = stack(np.array(masses))
    assert problem.answer is not None
    solution = solve(problem, solver, tolerance=1e-9)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-8
    assert np.abs(solution.impulses / problem.answer.impulses[0] - 1.0).max() <= 1e-6


def test_ten_thousand_sweeps_alone_do_not_solve_the_heavy_stacks() -> None:
    for masses in (STACKS["2, upper 1e6"], STACKS["10, top 1e4"]):
        solution = solve(stack(np.array(masses)), "SafeguardedSORprox", tolerance=1e-9, max_iterations=10_000)
        assert solution.status is Status.ITERATION_LIMIT


@pytest.mark.parametrize(
    "name", ["hard-counterexample", "hard-counterexample-mu4", "hard-mixed-laws", "hard-tresca-joint"]
)
def test_velocity_agrees_with_the_known_answer(name: str) -> None:
    problem = load(name)
    solution = solve(problem, "HybridNewton", tolerance=1e-12)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).velocity_error <= 1e-10  # type: ignore[operator]


@pytest.mark.slow
@settings(max_examples=settings.default.max_examples // 3, deadline=None)
@given(seed=SEEDS, friction=st.sampled_from([0.0, 0.3, 1.0]), spread=st.sampled_from([0, 6]))
def test_planar_velocities_are_among_those_of_enumeration(seed: int, friction: float, spread: int) -> None:
    rng = np.random.default_rng(seed)
    directions, inverse_mass = rng.normal(size=(12, 8)), 10.0 ** rng.uniform(-spread / 2, spread / 2, 12)
    free = directions.T @ rng.normal(size=12)
    problem = ContactProblem.from_factors(directions, inverse_mass, free, friction, dim=2)
    solution = solve(problem, "HybridNewton", tolerance=1e-11)
    assert solution.status is Status.SOLVED, solution.message
    assert judge(problem, solution.impulses).residual <= 1e-10
    known = create("Enumeration").prepare(problem).all_solutions(1e-9)  # type: ignore[attr-defined]
    velocities = [problem.relative_velocity(other) - problem.relative_velocity(solution.impulses) for other in known]
    assert min(np.abs(difference).max() for difference in velocities) <= 1e-6 * np.abs(free).max()


@pytest.mark.parametrize("count", [2, 4, 32, 256])
def test_damping_does_not_change_the_solution_of_redundant_supports(count: int) -> None:
    """G has rank 2; the damping of the step must not change the solution."""
    problem = block_on_supports(count)
    assert problem.answer is not None
    start = np.random.default_rng(count).uniform(0.0, 1.0, count)
    solution = create("HybridNewton").prepare(problem).solve(Stop(1e-13, 2000), start=start)
    assert solution.status is Status.SOLVED
    assert problem.answer.functionals is not None
    sums = problem.answer.functionals @ solution.impulses
    assert sums == pytest.approx(problem.answer.values, abs=1e-12)


def test_newton_takes_over_where_sweeps_are_slow() -> None:
    problem = stack(np.ones(100))
    swept = solve(problem, "SafeguardedSORprox", tolerance=1e-9, max_iterations=20_000)
    taken = solve(problem, "HybridNewton", tolerance=1e-9)
    assert swept.status is Status.ITERATION_LIMIT
    assert taken.iterations < 300


def test_iterates_are_those_of_sweeps_while_sweeps_are_fast() -> None:
    problem, histories = load("funnel-100"), []
    for name in ("SafeguardedSORprox", "HybridNewton"):
        seen: list[np.ndarray] = []
        create(name).prepare(problem).solve(Stop(1e-10), observe=lambda _, x, seen=seen: seen.append(x.copy()))
        histories.append(np.array(seen))
    assert np.array_equal(*histories)


@pytest.mark.parametrize("masses", [STACKS["2, upper 1e6"], STACKS["10, top 1e4"]], ids=["2", "10"])
def test_an_observer_sees_every_iteration_and_changes_nothing(masses: list[float]) -> None:
    prepared, seen = create("HybridNewton").prepare(stack(np.array(masses))), []
    alone = prepared.solve(Stop(1e-9))
    watched = prepared.solve(Stop(1e-9), observe=lambda iteration, _: seen.append(iteration))
    assert seen == list(range(1, alone.iterations + 1))
    assert np.array_equal(alone.impulses, watched.impulses)


@pytest.mark.parametrize("limit", [0, 1, 200, 203])
def test_it_stops_at_the_iteration_limit(limit: int) -> None:
    solution = solve(load("pile-100"), "HybridNewton", tolerance=1e-12, max_iterations=limit)
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == limit
    assert np.isfinite(solution.impulses).all()


def test_the_answer_does_not_depend_on_the_units_of_contacts() -> None:
    """Rows in units 1e-3 … 1e6 apart: G → D G D, c → D c, Λ → D⁻¹ Λ."""
    plain = stack(np.array(STACKS["10, top 1e4"]))
    scales = 10.0 ** np.array([0, 3, -3, 0, 6, 0, 1, 2, -2, 0])
    delassus = plain.delassus().toarray() * np.outer(scales, scales)
    scaled = ContactProblem.from_delassus(delassus, scales * plain.free_velocity, dim=1)
    assert plain.answer is not None
    solution = solve(scaled, "HybridNewton", tolerance=1e-14, max_iterations=2000)
    assert np.abs(solution.impulses * scales / plain.answer.impulses[0] - 1.0).max() <= 1e-6


@pytest.mark.parametrize("relaxation", [0.0, float("inf"), "one"])
def test_a_relaxation_out_of_range_is_refused(relaxation: object) -> None:
    with pytest.raises(SolverError, match="relaxation"):
        create("HybridNewton", relaxation=relaxation)


@pytest.mark.parametrize("solver", ["HybridNewton", "Lemke"])
@pytest.mark.parametrize("count", [2, 10, 100])
def test_a_mass_ratio_beyond_rounding_is_neither_solved_nor_infeasible(count: int, solver: str) -> None:
    """At 1e8, even the impulses known from theory have a residual above 1e-9, due to rounding."""
    for masses in ([1.0] * (count - 1) + [1e8], [1.0, 1e8] * (count // 2)):
        problem = stack(np.array(masses))
        assert problem.answer is not None
        solution = solve(problem, solver, tolerance=1e-10)
        residual = judge(problem, solution.impulses).residual
        assert residual <= 1e-10 or solution.status is not Status.SOLVED
        assert solution.status in (Status.SOLVED, Status.STALLED, Status.ITERATION_LIMIT)
        assert residual <= 2e-6
        assert np.abs(solution.impulses / problem.answer.impulses[0] - 1.0).max() <= 1e-4


HIGH_FRICTION = {
    "five sliding": (Family(5, dim=2, n_dofs=4, density=0.6, friction=0.5, states=("slip",)), 1130),
    "twenty of friction 8": (None, "hard-random-mu8"),
}


@pytest.mark.parametrize(("family", "seed"), HIGH_FRICTION.values(), ids=HIGH_FRICTION)
def test_restarts_solve_problems_on_which_sweeps_diverge(family: Family | None, seed: int | str) -> None:
    problem = load(str(seed)) if family is None else random_problem(family, int(seed))
    swept = solve(problem, "SafeguardedSORprox", tolerance=1e-8, max_iterations=3000)
    solution = solve(problem, "HybridNewton", tolerance=1e-8, max_iterations=3000)
    assert swept.status is Status.ITERATION_LIMIT
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-8


@pytest.mark.parametrize("limit", [1990, 2050, 2500, pytest.param(5000, marks=pytest.mark.slow)])
def test_restarts_and_later_sweeps_respect_the_iteration_limit_and_are_observed(limit: int) -> None:
    seen: list[int] = []
    prepared = create("HybridNewton").prepare(load("hard-squeezed"))
    solution = prepared.solve(Stop(1e-8, limit), observe=lambda iteration, _: seen.append(iteration))
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == limit
    assert seen == list(range(1, limit + 1))


def test_there_are_no_restarts_at_the_rounding_limit() -> None:
    solution = solve(stack(np.array([1.0, 1e8])), "HybridNewton", tolerance=1e-10, max_iterations=20_000)
    assert solution.status is Status.STALLED
    assert solution.iterations < 2100


@pytest.mark.parametrize("name", ["pile-100", "hard-random-mu8"])
def test_a_tighter_tolerance_continues_what_a_looser_one_begins(name: str) -> None:
    prepared, iterates = create("HybridNewton").prepare(load(name)), []
    for tolerance in (1e-2, 1e-4, 1e-6):
        seen: list[np.ndarray] = []
        prepared.solve(Stop(tolerance, 2500), observe=lambda _, x, seen=seen: seen.append(x.copy()))
        iterates.append(seen)
    for fewer, more in itertools.pairwise(iterates):
        assert 0 < len(fewer) <= len(more)
        assert np.array_equal(fewer, more[: len(fewer)])
