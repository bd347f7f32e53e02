"""SafeguardedSORprox reduces the steps of contacts that oscillate, and only those."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.solvers import SolverError, Status, Stop, create, solve


def counterexample(friction: float) -> ContactProblem:
    delassus = [[1.87577975, -1.36394614], [-1.36394614, 3.12422025]]
    return ContactProblem.from_delassus(delassus, (-0.0981, 1.0), friction, dim=2)


def high_friction(dim: int, seed: int) -> ContactProblem:
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(16 * dim, 8 * dim))
    directions[rng.random(directions.shape) < 0.5] = 0.0
    free = directions.T @ rng.normal(size=16 * dim)
    return ContactProblem.from_factors(directions, np.ones(16 * dim), free, 3.0, dim=dim)


def iterates(problem: ContactProblem, name: str, count: int) -> np.ndarray:
    seen: list[np.ndarray] = []
    create(name).prepare(problem).solve(Stop(1e-300, count), observe=lambda _, x: seen.append(x.copy()))
    return np.array(seen)


@pytest.mark.parametrize("relaxation", [1.0, 1.5])
@pytest.mark.parametrize("friction", [2.0, 4.0, 10.0])
def test_the_counterexample_is_solved_where_plain_sweeps_cycle(friction: float, relaxation: float) -> None:
    problem = counterexample(friction)
    normal = 0.0981 / (1.87577975 + friction * 1.36394614)
    plain = solve(problem, "SORprox", tolerance=1e-12)
    safeguarded = solve(problem, f"SafeguardedSORprox(relaxation={relaxation})", tolerance=1e-12)
    assert plain.status is Status.OSCILLATING
    assert safeguarded.status is Status.SOLVED
    assert safeguarded.impulses == pytest.approx([normal, -friction * normal], rel=1e-10)


@pytest.mark.parametrize("dim", [2, 3])
def test_contacts_of_high_friction_are_solved_more_often_than_by_plain_sweeps(dim: int) -> None:
    counts = {"SORprox(relaxation=1.5)": 0, "SafeguardedSORprox": 0}
    for name in counts:
        for seed in range(20):
            solution = solve(high_friction(dim, seed), name, tolerance=1e-9)
            counts[name] += solution.status is Status.SOLVED
    assert counts["SafeguardedSORprox"] >= 19
    assert counts["SafeguardedSORprox"] > counts["SORprox(relaxation=1.5)"]


def test_without_oscillation_the_iterates_are_those_of_plain_sweeps() -> None:
    problem = load("funnel-100")
    plain, safeguarded = (
        iterates(problem, f"{name}(relaxation=1.2)", 60) for name in ("SORprox", "SafeguardedSORprox")
    )
    assert np.array_equal(plain, safeguarded)


@pytest.mark.parametrize("name", ["funnel-30", "funnel-300", "funnel-planar-300", "funnel-frictionless-300"])
def test_it_takes_no_more_sweeps_than_fast_plain_sweeps(name: str) -> None:
    problem = load(name)
    plain = solve(problem, "SORprox(relaxation=1.5)", tolerance=1e-6)
    safeguarded = solve(problem, "SafeguardedSORprox(relaxation=1.5)", tolerance=1e-6)
    assert plain.status is safeguarded.status is Status.SOLVED
    assert safeguarded.iterations <= 1.1 * plain.iterations


@pytest.mark.parametrize("name", ["SafeguardedSORprox", "SafeguardedSORprox(relaxation=1.0)", "NSGS(relaxation=1.5)"])
def test_an_observer_changes_nothing_when_steps_are_reduced(name: str) -> None:
    """Observed sweeps run one by one, but a reduction must occur at the same sweep."""
    for problem in [counterexample(10.0), *(high_friction(2, seed) for seed in range(5))]:
        seen: list[int] = []
        prepared = create(name).prepare(problem)
        alone = prepared.solve(Stop(1e-10, 500))
        watched = prepared.solve(Stop(1e-10, 500), observe=lambda iteration, _, seen=seen: seen.append(iteration))
        assert seen == list(range(1, watched.iterations + 1))
        assert alone.iterations == watched.iterations
        assert np.array_equal(alone.impulses, watched.impulses)


def test_two_solves_of_one_preparation_are_the_same() -> None:
    """The next solve does not begin with the step sizes that the previous one has reduced."""
    prepared = create("SafeguardedSORprox").prepare(counterexample(4.0))
    first, second = prepared.solve(Stop(1e-12)), prepared.solve(Stop(1e-12))
    assert first.iterations == second.iterations > 20
    assert np.array_equal(first.impulses, second.impulses)


def test_fixed_bounds_and_mixed_rows_are_solved() -> None:
    for name in ("hard-mixed-laws", "hard-tresca-joint", "hard-duplicated-slider"):
        problem = load(name)
        solution = solve(problem, "SafeguardedSORprox", tolerance=1e-11)
        assert solution.status is Status.SOLVED
        assert judge(problem, solution.impulses).velocity_error <= 1e-9  # type: ignore[operator]


@pytest.mark.parametrize("relaxation", [0.0, float("inf"), "one"])
def test_a_relaxation_out_of_range_is_refused(relaxation: object) -> None:
    with pytest.raises(SolverError, match="relaxation"):
        create("SafeguardedSORprox", relaxation=relaxation)
