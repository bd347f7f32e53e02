"""Time of every solver to one accuracy, including preparation, and of preparation alone, on steps of three sizes."""

import time
from typing import Any

import pytest
from contestants import SIZES, TOLERANCE, contestants, excuse, step_for
from proxbench.problems import ContactProblem, judge
from proxbench.solvers import Model, Solution, Solver, Status, Stop

STOP = Stop(TOLERANCE, max_seconds=10.0)

SOLVING_SECONDS = 1.5
PREPARING_SECONDS = 0.4


def rounds_in(seconds: float, once: float) -> int:
    """Return the number of rounds that fit into ``seconds``, at least five and at most two hundred."""
    return min(max(int(seconds / once), 5), 200)


def supported(entry: str, size: int) -> tuple[Solver, ContactProblem]:
    """The solver and its step; the test is skipped with the solver's reason if it supports none."""
    solver, problem, reasons = step_for(entry, size)
    if problem is None:
        pytest.skip(reasons)
    return solver, problem


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("entry", contestants())
def test_time_to_accuracy(benchmark: Any, entry: str, size: int) -> None:
    if reason := excuse(entry, size):
        pytest.skip(reason)
    solver, problem = supported(entry, size)

    def solve(fresh: ContactProblem) -> Solution:
        return solver.prepare(fresh).solve(STOP)

    solve(problem.fresh())  # compiles
    began = time.perf_counter()
    solution = solve(problem.fresh())
    once = time.perf_counter() - began
    own, coulomb = judge(problem, solution.impulses, solver.model), judge(problem, solution.impulses)
    ended = f"{solution.status}, {solution.message} (residual {own.residual:.1e}); if it must be so, excuse it"
    assert solution.status is Status.SOLVED, ended
    assert own.residual <= 10 * TOLERANCE
    benchmark.extra_info.update(
        problem=problem.name,
        digest=problem.digest,
        iterations=solution.iterations,
        judged_residual=coulomb.residual,
    )
    if solver.model != Model.COULOMB:
        benchmark.extra_info["model_residual"] = own.residual
    benchmark.pedantic(solve, setup=lambda: ((problem.fresh(),), {}), rounds=rounds_in(SOLVING_SECONDS, once))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("entry", contestants())
def test_preparing(benchmark: Any, entry: str, size: int) -> None:
    solver, problem = supported(entry, size)
    solver.prepare(problem.fresh())
    fresh = problem.fresh()
    began = time.perf_counter()
    solver.prepare(fresh)
    once = time.perf_counter() - began
    benchmark.extra_info.update(problem=problem.name, digest=problem.digest)
    rounds = rounds_in(PREPARING_SECONDS, once)
    benchmark.pedantic(solver.prepare, setup=lambda: ((problem.fresh(),), {}), rounds=rounds)
