"""A trace contains the iterates of a solver, including the first and the last one."""

from typing import Any

import numpy as np
import pytest
from misbehaving_solvers import Misbehaving
from proxbench.bench.recordings.traces import Thinning, trace_solve
from proxbench.problems import judge, load
from proxbench.solvers import Stop, create


def test_thinning_keeps_all_first_iterations_and_few_of_many() -> None:
    thinning = Thinning(20, 1.08)
    kept = [iteration for iteration in range(100_001) if thinning.selects(iteration)]
    assert kept[:20] == list(range(20))
    assert len(kept) < 150
    assert max(np.diff(kept)[20:] / np.array(kept[20:-1])) < 0.15


def test_recorded_curves_match_the_judge_and_end_with_the_last_iterate() -> None:
    problem, stop = load("funnel-30"), Stop(1e-6, 333)
    solution = create("SORprox").prepare(problem).solve(stop)
    trace = trace_solve(problem, create("SORprox"), stop)
    assert trace.iterations == list(range(solution.iterations + 1))
    np.testing.assert_array_equal(problem.layout.unpad(trace.impulses[-1]), solution.impulses)
    verdict = judge(problem, solution.impulses)
    assert trace.residual[-1] == pytest.approx(verdict.residual, rel=1e-9)
    assert trace.residual[0] == pytest.approx(judge(problem, 0 * solution.impulses).residual, rel=1e-12)
    assert trace.complementarity[-1] == pytest.approx(verdict.complementarity, rel=1e-9)
    assert trace.shown[-1] == solution.iterations
    assert {int(counts.sum()) for counts in trace.state_counts} == {problem.n_contacts}


def test_step_changes_are_differences_of_successive_iterates() -> None:
    trace = trace_solve(load("funnel-30"), create("SORprox"), Stop(1e-12, 15))
    jumps = [np.linalg.norm(after - before) for before, after in zip(trace.impulses, trace.impulses[1:], strict=False)]
    np.testing.assert_allclose(trace.step_change[1:], jumps, rtol=1e-12)


def test_trace_of_a_solver_without_iterates_has_only_start_and_end() -> None:
    trace = trace_solve(load("hard-sticking-box"), create("ClarabelSOCP"), Stop(1e-6, 100))
    assert len(trace.iterations) == len(trace.shown) == 2
    assert trace.residual[1] < 1e-3


@pytest.mark.parametrize(("kind", "words"), [("raise", "It raised"), ("nan", "")])
def test_a_misbehaving_solver_ends_its_own_trace_only(kind: Any, words: str) -> None:
    trace = trace_solve(load("funnel-30"), Misbehaving(kind), Stop(1e-6, 100))
    assert trace.ending.startswith(words)
    assert trace.has_failed == (kind == "raise")
    assert trace.iterations[0] == 0


def test_an_unsupported_problem_is_named_with_the_reason() -> None:
    trace = trace_solve(load("funnel-30"), create("Enumeration"), Stop(1e-6, 100))
    assert trace.ending.startswith("The solver does not support this problem: ")
    assert trace.iterations == []
