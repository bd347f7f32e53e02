"""``iterate`` makes a complete solver of a generator: limits, observers and statuses."""

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load, project
from proxbench.problems.arrays import FloatArray
from proxbench.problems.contact.residual import Residual
from proxbench.problems.hard.stacks import stack
from proxbench.solvers import Prepared, SolverError, Status, Stop, create, iterate
from proxbench.solvers.iteration import loop
from proxbench.solvers.iteration.loop import PreparedIteration
from proxbench.solvers.iteration.stopping import Monitor


def gradient(problem: ContactProblem, step: float) -> Prepared:
    def sweeps(impulses: FloatArray) -> Iterator[FloatArray]:
        while True:
            impulses = project(problem.laws, impulses - step * problem.relative_velocity(impulses))
            yield impulses

    return iterate(problem, sweeps)


def test_it_stops_at_the_judges_residual_and_starts_from_the_given_impulses() -> None:
    problem = load("hard-mixed-laws")
    prepared = gradient(problem, 0.5)
    solution = prepared.solve(Stop(1e-9))
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-9
    assert prepared.solve(Stop(1e-9), start=solution.impulses).iterations == 0


def test_too_long_a_step_ends_as_oscillating_diverged_or_stalled() -> None:
    assert gradient(load("hard-stack-10"), 1.0).solve(Stop(1e-9, 50_000)).status in (
        Status.OSCILLATING,
        Status.DIVERGED,
        Status.STALLED,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "solver",
    [
        "SORprox(relaxation=1.5)",
        "SafeguardedSORprox",
        pytest.param("SORprox(momentum=0.8)", marks=pytest.mark.weekly),
        "NSGS",
    ],
)
def test_a_plateau_is_crossed_at_once_and_from_the_impulses_that_a_limit_returned(solver: str) -> None:
    """Two blocks, the upper 10⁴ times heavier: every sweep passes on 10⁻⁴ of the weight."""
    problem = load("hard-stack-2-top-1e4")
    assert problem.answer is not None
    prepared = create(solver).prepare(problem)
    short = prepared.solve(Stop(1e-8, 5000))
    assert short.status is Status.ITERATION_LIMIT
    for start in (None, short.impulses):
        solution = prepared.solve(Stop(1e-8, 300_000), start=start)
        assert solution.status is Status.SOLVED
        assert np.abs(solution.impulses / problem.answer.impulses[0] - 1.0).max() <= 1e-6


@pytest.mark.parametrize("masses", [[1.0, 1e8] * 5, list(np.logspace(0, 8, 10))], ids=["in turn", "growing"])
@pytest.mark.parametrize(
    "solver", ["SORprox", "SafeguardedSORprox", "NSGS", "PyramidPGS", "SemismoothNewton", "HybridNewton"]
)
def test_a_residual_at_the_rounding_limit_is_a_stall(solver: str, masses: list[float]) -> None:
    """Ten blocks of mass ratio 10⁸, from the known impulses: the rounding of sums of 10⁹ is 10⁻¹¹ of c or more."""
    problem = stack(np.array(masses))
    assert problem.answer is not None
    noise = 1e-12 * np.random.default_rng(1).uniform(-1.0, 1.0, problem.n_rows)
    start = problem.answer.impulses[0] * (1.0 + noise)
    solution = create(solver).prepare(problem).solve(Stop(1e-14, 10**7), start=start)
    assert solution.status is Status.STALLED
    left = judge(problem, solution.impulses).residual
    assert 1e-14 < left <= Residual(problem).rounding(solution.impulses)


@pytest.mark.parametrize(
    ("name", "solver", "tolerance"),
    [
        ("hard-scaled-rows", "SORprox(relaxation=1.5)", 5e-11),
        ("hard-scaled-rows", "NSGS", 1e-11),
        ("hard-scaled-tower-10", "SORprox(relaxation=1.5)", 1e-11),
        ("hard-scaled-rows-15", "SORprox", 1e-9),
    ],
)
def test_rounding_is_not_a_stall_if_the_best_impulses_lead_to_the_solution(
    name: str, solver: str, tolerance: float
) -> None:
    """Units of rows differ by 10⁹: sweeps stop at one Λ, but another Λ has the least residual in their arithmetic."""
    problem = load(name)
    solution = create(solver).prepare(problem).solve(Stop(tolerance, 10**6))
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= tolerance < Residual(problem).rounding(solution.impulses)


def test_a_failed_rounding_test_doubles_the_waiting_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Λ is constant, ξ is zero up to rounding, and the judge's residual is 1; judging takes as long as a sweep."""
    problem, calls = ContactProblem.from_delassus(np.eye(1), (-1.0,), dim=1), 0

    def judged(*arguments: object) -> float:
        nonlocal calls
        calls += 1
        return 1.0

    class Resting:
        def sweep(self, count: int) -> None: ...

        def impulses(self) -> FloatArray:
            return np.ones(1)

        def relative_velocity(self) -> FloatArray:
            return np.array([-1e-15])

    monkeypatch.setattr(Residual, "judged", judged)
    monkeypatch.setattr(Monitor, "check_cycle", lambda *arguments: None)
    prepared = PreparedIteration(problem, Residual(problem), lambda start: Resting())
    assert prepared.solve(Stop(1e-16, 50_000)).status is Status.ITERATION_LIMIT
    assert 0 < calls <= 6 * loop.ROUNDING_TEST_SWEEPS


def test_impulses_that_repeat_temporarily_are_not_a_stall() -> None:
    """A generator may have hidden state."""
    problem = ContactProblem.from_delassus(np.eye(1), (-1.0,), dim=1)

    def sweeps(start: FloatArray) -> Iterator[FloatArray]:
        for count in itertools.count():
            yield np.array([0.0 if count < 150 else 1.0])

    assert iterate(problem, sweeps).solve(Stop(1e-9)).status is Status.SOLVED


def test_constant_impulses_are_a_stall() -> None:
    problem = ContactProblem.from_delassus(np.eye(1), (-1.0,), dim=1)
    solution = iterate(problem, itertools.repeat).solve(Stop(1e-9))
    assert solution.status is Status.STALLED
    assert solution.iterations < 1000


def test_a_generator_may_yield_the_same_array() -> None:
    problem = ContactProblem.from_delassus(np.eye(2), (-1.0, -2.0), dim=1)

    def sweeps(start: FloatArray) -> Iterator[FloatArray]:
        impulses = start.copy()
        while True:
            impulses += 0.5 * (np.array([1.0, 2.0]) - impulses)
            yield impulses

    seen: list[FloatArray] = []
    solution = iterate(problem, sweeps).solve(Stop(1e-6), observe=lambda iteration, impulses: seen.append(impulses))
    assert solution.status is Status.SOLVED
    assert len(seen) == solution.iterations
    assert np.array_equal(seen[0], [0.5, 1.0])


def test_impulses_that_are_not_finite_are_the_reason_for_divergence() -> None:
    solution = iterate(load("hard-mixed-laws"), lambda start: itertools.repeat(start + np.nan)).solve(Stop(1e-9))
    assert solution.status is Status.DIVERGED
    assert solution.message == "the impulses are not finite after 1 sweep"
    assert np.isfinite(solution.impulses).all()


@pytest.mark.parametrize(("yielded", "words"), [([], "ended"), ([np.zeros(2)], r"yielded an array of shape \(2,\)")])
def test_a_generator_that_ends_or_yields_something_else_is_an_error(yielded: list[FloatArray], words: str) -> None:
    with pytest.raises(SolverError, match=words):
        iterate(load("hard-mixed-laws"), lambda start: iter(yielded)).solve(Stop(1e-6))


@pytest.mark.parametrize("solver", ["SORprox", "JORprox", "SafeguardedSORprox", "NSGS"])
def test_a_start_with_an_impulse_at_a_contact_that_opens_for_any_impulses_leads_to_the_solution(solver: str) -> None:
    """With G_NN = 0 the step of the normal impulse is 0, and its impulse would permit friction forever."""
    problem = ContactProblem.from_delassus(np.diag([0.0, 1.0, 1.0]), [1.0, 0.3, 0.2], 0.5)
    solution = create(solver).prepare(problem).solve(Stop(1e-9, 100), np.full(3, 0.1))
    assert solution.status is Status.SOLVED
    assert not solution.impulses.any()
