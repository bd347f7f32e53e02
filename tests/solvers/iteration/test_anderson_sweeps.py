"""Anderson acceleration of sweeps: GMRES on linear maps, plain sweeps without memory, never far from plain sweeps."""

from collections.abc import Callable

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.arrays import FloatArray
from proxbench.problems.hard.stacks import stack
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.iteration.anderson import FIRST_WINDOW, MAX_WINDOW, AndersonSweeps, WindowDifferences


class Map:
    """Sweeps by any map x ↦ g(x)."""

    def __init__(self, mapped: Callable[[FloatArray], FloatArray], start: FloatArray) -> None:
        self.mapped, self.padded = mapped, start.copy()

    def sweep(self, count: int) -> None:
        for _ in range(count):
            self.padded[:] = self.mapped(self.padded)

    def impulses(self) -> FloatArray:
        return self.padded.copy()

    relative_velocity = impulses

    def note_jump(self) -> None: ...


def linear(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A matrix of spectral radius below 0.95, and an offset."""
    rng = np.random.default_rng(seed)
    vectors = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return vectors @ np.diag(rng.uniform(0.5, 0.95, n)) @ vectors.T, rng.normal(size=n)


@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("seed", range(5))
def test_a_linear_map_of_n_dimensions_is_solved_after_n_extrapolations(n: int, seed: int) -> None:
    matrix, offset = linear(n, seed)
    exact = np.linalg.solve(np.eye(n) - matrix, offset)
    mixed = AndersonSweeps(Map(lambda x: matrix @ x + offset, np.zeros(n)), np.ones(n), n)
    mixed.sweep((n + 2) * FIRST_WINDOW + 1)
    assert mixed.impulses() == pytest.approx(exact, abs=1e-6 * max(1.0, float(np.abs(exact).max())))


def iterates(problem: ContactProblem, solver: str, count: int) -> np.ndarray:
    seen: list[np.ndarray] = []
    create(solver).prepare(problem).solve(Stop(1e-300, count), observe=lambda _, x: seen.append(x.copy()))
    return np.array(seen)


@pytest.mark.parametrize("name", ["funnel-30", "funnel-planar-30", "hard-mixed-laws"])
def test_sweeps_are_plain_without_memory_and_before_the_second_window(name: str) -> None:
    problem = load(name)
    plain = iterates(problem, "SORprox", 15)
    assert np.array_equal(plain, iterates(problem, "AndersonSORprox(memory=0)", 15))
    mixed = iterates(problem, "AndersonSORprox", 15)
    assert np.array_equal(plain[: 2 * FIRST_WINDOW], mixed[: 2 * FIRST_WINDOW])
    assert not np.array_equal(plain, mixed)


def test_a_solution_is_a_fixed_point() -> None:
    problem = stack(np.ones(10))
    assert problem.answer is not None
    answer = problem.answer.impulses[0]
    prepared = create("AndersonSORprox").prepare(problem)
    mixed = prepared.begin(answer)
    mixed.sweep(50)
    assert np.abs(mixed.impulses() - answer).max() <= 1e-12 * np.abs(answer).max()


def test_observed_impulses_satisfy_the_cones() -> None:
    """An extrapolated Λ may leave the cones; a swept one may not."""
    problem = load("funnel-30")
    for impulses in iterates(problem, "AndersonSORprox", 60):
        assert judge(problem, impulses).cone_violation <= 1e-15 * np.abs(impulses).max()


def test_an_extrapolation_that_misleads_is_undone() -> None:
    """The map contracts towards 0, but jumps by 100 near 0, which is where the extrapolation leads."""
    mixed = AndersonSweeps(Map(lambda x: np.where(x > 0.01, 0.9 * x, x + 100.0), np.ones(1)), np.ones(1), 1)
    mixed.sweep(3 * FIRST_WINDOW)
    assert mixed.impulses() == pytest.approx(100.0 * 0.9 ** (FIRST_WINDOW - 1), rel=1e-3)
    mixed.sweep(1)
    assert mixed.impulses() == pytest.approx(0.9 ** (2 * FIRST_WINDOW + 1))


@pytest.mark.parametrize(("trap", "is_undone"), [(0.1, False), (0.8, True)])
def test_an_extrapolation_is_undone_if_it_moves_more_than_twice_as_far_as_the_window_before(
    trap: float, is_undone: bool
) -> None:
    """The window before moved by 0.9³ − 0.9⁶ = 0.198; the map adds ``trap`` at the extrapolated point."""
    mixed = AndersonSweeps(Map(lambda x: np.where(x > 0.01, 0.9 * x, x + trap), np.ones(1)), np.ones(1), 1)
    mixed.sweep(3 * FIRST_WINDOW)
    away = trap * 0.9 ** (FIRST_WINDOW - 1)
    assert mixed.impulses() == pytest.approx(away, rel=1e-3)
    mixed.sweep(1)
    assert (mixed.impulses() == pytest.approx(0.9 ** (2 * FIRST_WINDOW + 1))) is is_undone


def test_zero_differences_and_diverging_iterates_are_not_extrapolated() -> None:
    differences = WindowDifferences(3, 2)
    assert differences.step(np.ones(2), np.zeros(2)) is None
    assert differences.step(np.ones(2), np.zeros(2)) is None  # no difference at all
    with np.errstate(over="ignore", invalid="ignore"):
        mixed = AndersonSweeps(Map(lambda x: 1e300 * x, np.ones(1)), np.ones(1), 3)
        mixed.sweep(4 * FIRST_WINDOW)
    assert mixed.impulses() == np.inf


@pytest.mark.parametrize("name", ["funnel-300", "funnel-planar-300", "hard-stack-100", "hard-stack-2-top-1e4"])
def test_it_takes_less_than_a_third_of_the_plain_sweeps_on_long_problems(name: str) -> None:
    problem = load(name)
    mixed = solve(problem, "AndersonSORprox", tolerance=1e-6)
    assert mixed.status is Status.SOLVED
    assert judge(problem, mixed.impulses).residual <= 1.001e-6
    plain = create("SORprox").prepare(problem).solve(Stop(1e-6, 3 * mixed.iterations))
    assert plain.status is Status.ITERATION_LIMIT


def test_an_observer_changes_nothing() -> None:
    prepared, seen = create("AndersonSORprox").prepare(load("funnel-100")), []
    alone = prepared.solve(Stop(1e-8, 500))
    watched = prepared.solve(Stop(1e-8, 500), observe=lambda iteration, _: seen.append(iteration))
    assert seen == list(range(1, watched.iterations + 1))
    assert np.array_equal(alone.impulses, watched.impulses)


@pytest.mark.parametrize("memory", [-1, 2.0, True, 51, "five"])
def test_memory_out_of_range_is_refused(memory: object) -> None:
    with pytest.raises(SolverError, match="memory"):
        create("AndersonSORprox", memory=memory)


def test_without_progress_extrapolations_become_rarer_and_end() -> None:
    """From then on the iterates are those of plain sweeps."""
    mixed = AndersonSweeps(Map(lambda x: 0.9 * x, np.ones(1)), np.ones(1), 3)
    reductions = 0
    while mixed.reduce_acceleration():
        reductions += 1
    assert FIRST_WINDOW * 2 ** (reductions - 1) <= MAX_WINDOW < FIRST_WINDOW * 2**reductions
    mixed.sweep(500)
    assert mixed.impulses() == pytest.approx(0.9**500, rel=1e-12)


@pytest.mark.slow
def test_problems_of_plain_sweeps_are_solved_even_if_acceleration_fails() -> None:
    problem = load("funnel-planar-1000")
    assert create("AndersonSORprox").prepare(problem).solve(Stop(1e-8, 40_000)).status is Status.SOLVED
