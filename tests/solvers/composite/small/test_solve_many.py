"""Many problems are solved like single ones, on any number of threads, and each answer is judged."""

import os
from typing import Any

import numpy as np
import pytest
from proxbench import solve_many
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.matrices import memory
from proxbench.problems.errors import InsufficientMemoryError
from proxbench.solvers import SolverError, Status, Stop, create
from proxbench.solvers.composite.small.solve_many import _batches
from proxbench.solvers.iteration.cores import thread_requirement
from small_problems import FORMS, SWEPT, random_problem, slow_problem

N_CORES = len(os.sched_getaffinity(0))

UNUSUAL = ["hard-mixed-laws", "hard-stack-10-top-heavy", "hard-counterexample"]


def mixture() -> list[ContactProblem]:
    """Return problems of one to twelve contacts in all forms, and some that sweeps alone do not solve."""
    rng = np.random.default_rng(1)
    sizes = [(int(rng.integers(1, 13)), dim, form) for dim in (1, 2, 3) for form in FORMS for _ in range(3)]
    return [load(name) for name in (*SWEPT, *UNUSUAL)] + [random_problem(rng, *size) for size in sizes]


@pytest.mark.parametrize("threads", sorted({1, min(2, N_CORES), N_CORES}))
def test_solving_many_problems_equals_individual_solves_bit_by_bit(threads: int) -> None:
    problems, robust = mixture(), create("Robust")
    many = solve_many(problems, 1e-7, threads=threads)
    for problem, solution in zip(problems, many.solutions, strict=True):
        alone = robust.prepare(problem).solve(Stop(1e-7))
        assert solution.impulses.tobytes() == alone.impulses.tobytes()
        facts = solution.status, solution.iterations, solution.message
        assert facts == (alone.status, alone.iterations, alone.message)


def test_the_residuals_are_those_of_the_judge() -> None:
    problems = mixture()
    many = solve_many(problems, 1e-6)
    judged = [judge(*pair).residual for pair in zip(problems, (one.impulses for one in many.solutions), strict=True)]
    assert many.residuals == pytest.approx(judged, rel=1e-12)
    assert all(one.status is not Status.SOLVED or residual <= 1e-6 for one, residual in zip(*many, strict=True))


def test_limits_are_those_of_each_problem() -> None:
    many = solve_many([load("hard-stack-10")] * 3, 1e-8, max_iterations=30)
    assert [one.status for one in many.solutions] == [Status.ITERATION_LIMIT] * 3
    assert [one.iterations for one in many.solutions] == [30] * 3


def test_a_time_limit_is_that_of_each_problem() -> None:
    """A batch does not read the clock, so problems that may exceed the limit are solved one by one."""
    slow, quick = slow_problem(150), load("hard-tower-3")
    assert [batch.indices for batch in _batches([slow, quick], 1.0)] == [[0], [1]]
    assert [batch.indices for batch in _batches([slow, quick], 0.01)] == [[1]]
    solutions = solve_many([slow, quick, slow], 1e-10, max_seconds=1e-3).solutions
    assert [one.status for one in solutions[::2]] == [Status.TIME_LIMIT] * 2


@pytest.mark.parametrize("form", ["matrix", "diagonal"])
def test_memory_that_does_not_suffice_for_joined_copies_is_named_before_they_are_made(
    form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The joined copies of n equal problems take n times the arrays of one."""
    rng = np.random.default_rng(0)
    problems = [random_problem(rng, 4, 3, form)] * 50
    one = problems[0].matrix if problems[0].matrix is not None else problems[0].factors.directions
    copies = 50 * (one.data.nbytes + problems[0].free_velocity.nbytes)
    monkeypatch.setattr(memory, "SMALL_BYTES", 0)
    monkeypatch.setattr(memory, "available_bytes", lambda: copies)
    with pytest.raises(InsufficientMemoryError, match=r"for solving 50 problems in one call, but .*; solve them in"):
        solve_many(problems)
    monkeypatch.setattr(memory, "available_bytes", lambda: 10 * copies)
    assert solve_many(problems).solutions[0].status is Status.SOLVED


def test_memory_for_all_forms_is_checked_before_the_first_problem_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    """M⁻¹ counts, too: without it, the copies of the second form would fit."""
    rng = np.random.default_rng(0)
    given, factored = random_problem(rng, 4, 3, "matrix"), random_problem(rng, 4, 3, "diagonal")
    assert given.matrix is not None
    assert factored.factors is not None
    inverse_mass = factored.factors.inverse_mass
    matrices = [given.matrix, factored.factors.directions, inverse_mass.matrix, inverse_mass.root]
    needed = sum(one.data.nbytes + one.indices.nbytes + one.indptr.nbytes for one in matrices) + 6 * 12 * 8
    monkeypatch.setattr(memory, "SMALL_BYTES", 0)
    monkeypatch.setattr(memory, "available_bytes", lambda: needed - 1)
    with pytest.raises(InsufficientMemoryError, match=r"for solving 2 problems in one call"):
        next(_batches([given, factored], 1.0))
    monkeypatch.setattr(memory, "available_bytes", lambda: needed)
    assert len(list(_batches([given, factored], 1.0))) == 2


def test_empty_list_of_problems_has_no_solutions() -> None:
    many = solve_many([])
    assert many.solutions == []
    assert many.residuals.shape == (0,)


@pytest.mark.parametrize("threads", [0, -1, N_CORES + 1, 1.0, "2", True])
def test_invalid_number_of_threads_is_refused(threads: Any) -> None:
    with pytest.raises(SolverError, match=f"threads must be {thread_requirement(N_CORES)}, got"):
        solve_many([load("hard-tower-3")], threads=threads)


def test_a_single_problem_instead_of_a_list_is_refused() -> None:
    one: Any = load("hard-tower-3")
    with pytest.raises(SolverError, match="for one problem, use solve"):
        solve_many(one)


def test_an_item_that_is_not_a_problem_is_reported_with_its_index() -> None:
    some: Any = [load("hard-tower-3"), 3]
    with pytest.raises(SolverError, match=r"problems\[1\] must be a ContactProblem, a name or a path, not int"):
        solve_many(some)


def test_problems_may_be_given_by_name() -> None:
    by_name, by_problem = solve_many(["hard-tower-3"]), solve_many([load("hard-tower-3")])
    assert by_name.solutions[0].impulses.tobytes() == by_problem.solutions[0].impulses.tobytes()


def test_an_unknown_limit_is_refused_by_name() -> None:
    with pytest.raises(SolverError, match="solve_many has no argument `max_iter`; it takes max_iterations and"):
        solve_many([load("hard-tower-3")], max_iter=5)
