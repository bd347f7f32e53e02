"""A generator of impulses is a whole solver: limits, observers and verdicts are seen to."""

from collections.abc import Iterator

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load, project
from proxbench.problems.laws import FloatArray
from proxbench.solvers import Prepared, SolverError, Status, Stop, iterate


def gradient(problem: ContactProblem, step: float) -> Prepared:
    def sweeps(impulses: FloatArray) -> Iterator[FloatArray]:
        while True:
            impulses = project(problem.laws, impulses - step * problem.relative_velocity(impulses))
            yield impulses

    return iterate(problem, sweeps)


def test_it_stops_at_the_judges_residual_and_starts_where_it_is_told() -> None:
    problem = load("hard-mixed-laws")
    prepared = gradient(problem, 0.5)
    solution = prepared.solve(Stop(1e-9))
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-9
    assert prepared.solve(Stop(1e-9), start=solution.impulses).iterations == 0


def test_too_long_a_step_is_told_for_what_it_is() -> None:
    assert gradient(load("hard-stack-10"), 1.0).solve(Stop(1e-9, 50_000)).status in (
        Status.OSCILLATING,
        Status.DIVERGED,
        Status.STALLED,
    )


def test_one_array_may_be_yielded_again_and_again() -> None:
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


@pytest.mark.parametrize(("yielded", "words"), [([], "ended"), ([np.zeros(2)], r"yielded an array of shape \(2,\)")])
def test_a_generator_that_ends_or_yields_something_else_is_told(yielded: list[FloatArray], words: str) -> None:
    with pytest.raises(SolverError, match=words):
        iterate(load("hard-mixed-laws"), lambda start: iter(yielded)).solve(Stop(1e-6))
