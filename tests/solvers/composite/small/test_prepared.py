"""One kernel gives the same bits as the parts of Robust, and leaves unusual solves to these parts.

Bits are compared, because an observed solve runs the parts, and must show the iterates of a timed solve.
"""

from time import process_time
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ContactProblem, Laws, load
from proxbench.solvers import Status, Stop, create
from proxbench.solvers.composite.robust import PreparedRobust, prepare_by_parts
from proxbench.solvers.composite.small.prepared import PreparedSmall, longest_seconds, prepare_small
from small_problems import FORMS, SWEPT, random_problem, slow_problem

ROBUST = create("Robust")


@given(
    seed=st.integers(0, 2**32 - 1),
    n_contacts=st.integers(1, 12),
    dim=st.integers(1, 3),
    form=st.sampled_from(FORMS),
    digits=st.integers(1, 11),
    is_started=st.booleans(),
)
def test_the_kernel_gives_the_same_bits_as_its_parts(
    seed: int, n_contacts: int, dim: int, form: str, digits: int, is_started: bool
) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, n_contacts, dim, form)
    start = rng.normal(size=problem.n_rows) if is_started else None
    limits = Stop(10.0**-digits, max_iterations=1000)
    one, other = (prepare(problem).solve(limits, start) for prepare in (ROBUST.prepare, prepare_by_parts))
    assert (one.status, one.iterations, one.message) == (other.status, other.iterations, other.message)
    assert one.impulses.tobytes() == other.impulses.tobytes()


@pytest.mark.parametrize("name", ["hard-groove-flat-mu10", "hard-parallel-1e-3"])
def test_the_kernel_ends_slow_sweeps_where_the_parts_do(name: str) -> None:
    """The first sweeps gain digits; later sweeps take more than a window per digit."""
    problem = load(name)
    limits = Stop(1e-6, max_iterations=500)
    one, other = (prepare(problem).solve(limits) for prepare in (ROBUST.prepare, prepare_by_parts))
    assert "slow" in other.message
    assert (one.status, one.iterations, one.message) == (other.status, other.iterations, other.message)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-8])
@pytest.mark.parametrize("name", SWEPT)
def test_the_kernel_alone_solves_what_sweeps_solve(name: str, tolerance: float) -> None:
    problem = load(name)
    solution = without_parts(problem).solve(Stop(tolerance))
    assert solution.status is Status.SOLVED
    by_parts = prepare_by_parts(problem).solve(Stop(tolerance))
    assert solution.impulses.tobytes() == by_parts.impulses.tobytes()
    assert (solution.iterations, solution.message) == (by_parts.iterations, by_parts.message)


def test_a_prepared_problem_is_solved_again_with_the_same_bits() -> None:
    prepared = without_parts(load("hard-stack-10"))
    first, second = (prepared.solve(Stop(1e-8)) for _ in range(2))
    assert first.impulses.tobytes() == second.impulses.tobytes()
    assert not np.shares_memory(first.impulses, second.impulses)


def test_observed_solves_and_short_time_limits_use_the_separate_parts() -> None:
    prepared = without_parts(load("hard-tower-3"))
    with pytest.raises(PartsError):
        prepared.solve(Stop(1e-8), observe=lambda iteration, impulses: None)
    with pytest.raises(PartsError):
        prepared.solve(Stop(1e-8, max_seconds=0.5 * longest_seconds(prepared.problem.n_rows)))


@pytest.mark.parametrize("n_rows", [3, 30, 150])
def test_the_kernel_keeps_the_shortest_time_limit_for_which_it_is_used(n_rows: int) -> None:
    """The kernel does not read the clock; dense frictionless rows need the most sweeps, and the most time per sweep."""
    problem = slow_problem(n_rows)
    prepared, limit = without_parts(problem), longest_seconds(n_rows)
    times = []
    for _ in range(5):
        began = process_time()
        assert prepared.solve(Stop(1e-10, max_seconds=limit)).status is Status.SOLVED
        times.append(process_time() - began)
    assert min(times) < limit
    with pytest.raises(PartsError):
        prepared.solve(Stop(1e-10, max_seconds=0.99 * limit))


@pytest.mark.parametrize(
    "stop", [Stop(1e-8, max_iterations=7), Stop(1e-300)], ids=["iteration limit", "beyond rounding"]
)
def test_a_solve_that_sweeps_do_not_finish_uses_the_separate_parts(stop: Stop) -> None:
    with pytest.raises(PartsError):
        without_parts(load("hard-tower-3")).solve(stop)


ROD, SINGULAR = np.array([[2.0, 1.0], [1.0, 2.0]]), np.diag([0.0, 1.0])


@pytest.mark.parametrize(
    "problem",
    [
        ContactProblem.from_delassus(ROD, [0.0, 0.0], 0.3, dim=2),
        ContactProblem.from_delassus(ROD, [-1e-200, 0.0], 0.3, dim=2),
        ContactProblem.from_delassus(SINGULAR, [-1.0, 0.0], 0.3, dim=2),
        ContactProblem.from_delassus(ROD, [-1.0, 1.0], laws=Laws.joints(2)),
        load("hard-mixed-laws"),
    ],
    ids=["at rest", "tiny velocities", "infeasible", "joints", "mixed laws"],
)
def test_problems_that_the_kernel_does_not_support_use_the_separate_parts(problem: ContactProblem) -> None:
    assert prepare_small(problem, prepare_by_parts) is None
    assert isinstance(ROBUST.prepare(problem), PreparedRobust)


@pytest.mark.parametrize(
    "problem", [load("funnel-100"), ContactProblem.from_delassus(np.zeros((0, 0)), [], [])], ids=["many", "none"]
)
def test_problems_of_many_rows_or_none_use_the_separate_parts(problem: ContactProblem) -> None:
    assert isinstance(ROBUST.prepare(problem), PreparedRobust)


class PartsError(Exception):
    """The kernel has left a solve to the parts."""


def without_parts(problem: ContactProblem) -> PreparedSmall:
    """Return the prepared kernel, whose solves raise an exception instead of running the parts."""

    def refuse(problem: ContactProblem) -> Any:
        raise PartsError

    prepared = prepare_small(problem, refuse)
    assert prepared is not None
    return prepared
