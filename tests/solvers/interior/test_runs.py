"""A stall near the boundary of a cone ends a run; a run without gain ends the solve."""

import numpy as np
import pytest
from proxbench.problems import judge, load
from proxbench.problems.contact.residual import Residual
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.interior.central_path import CentralPath
from proxbench.solvers.interior.interior_point import InteriorPoint
from proxbench.solvers.interior.progress import MAX_SHORT_STEPS, MIN_STEPS, MIN_WARM_STEPS, Progress
from proxbench.solvers.interior.runs import InteriorMethod, SingleRun
from proxbench.solvers.iteration.stopping import BETTER_RATIO


@pytest.mark.parametrize(
    ("method", "name", "tolerance"),
    [
        (InteriorPoint(), "hard-slider-in-km-t", 1e-12),
        (InteriorPoint(), "hard-duplicated-slider-100", 1e-8),
        (CentralPath(), "hard-sliding-block", 1e-10),
    ],
)
def test_a_second_run_solves_what_the_first_does_not(method: InteriorMethod, name: str, tolerance: float) -> None:
    problem = load(name)
    single = SingleRun(method).prepare(problem).solve(Stop(tolerance))
    solution = method.prepare(problem).solve(Stop(tolerance))
    assert single.status is Status.STALLED
    assert solution.status is Status.SOLVED
    assert solution.iterations > single.iterations
    assert judge(problem, solution.impulses).residual <= 1.001 * tolerance


@pytest.mark.parametrize("method", [InteriorPoint(), CentralPath()])
def test_a_run_that_does_not_stall_is_the_whole_solve(method: InteriorMethod) -> None:
    problem = load("funnel-30")
    single, solution = SingleRun(method).prepare(problem).solve(Stop(1e-8)), method.prepare(problem).solve(Stop(1e-8))
    assert single.status is solution.status is Status.SOLVED
    assert single.iterations == solution.iterations
    assert np.array_equal(single.impulses, solution.impulses)


def test_runs_share_the_iteration_limit_and_are_counted_together() -> None:
    problem, seen = load("hard-slider-in-km-t"), []
    prepared = create("InteriorPoint").prepare(problem)
    stalled = SingleRun(InteriorPoint()).prepare(problem).solve(Stop(1e-12))
    assert stalled.status is Status.STALLED
    most = stalled.iterations + 2
    solution = prepared.solve(Stop(1e-15, most), observe=lambda iteration, _: seen.append(iteration))
    assert solution.status is Status.ITERATION_LIMIT
    assert seen == list(range(1, most + 1))


def test_a_single_run_has_the_name_and_the_refusals_of_its_method() -> None:
    method = InteriorPoint(form="factors")
    single = SingleRun(method)
    assert single.name == method.name
    problem = load("hard-counterexample")
    assert single.supports(problem) == method.supports(problem) is not None


@pytest.mark.parametrize("name", ["hard-sliding-block", "hard-sliding-block-32"])
def test_a_solve_without_a_later_run_continues_after_short_steps(name: str) -> None:
    """There are five consecutive steps of a billionth of a Newton step, and then long ones again."""
    problem = load(name)
    single = SingleRun(InteriorPoint()).prepare(problem).solve(Stop(1e-12))
    solution = create("InteriorPoint").prepare(problem).solve(Stop(1e-12, 300))
    assert "boundary of a cone" in single.message
    assert solution.iterations > single.iterations
    assert judge(problem, solution.impulses).residual < BETTER_RATIO * judge(problem, single.impulses).residual


def test_impulses_that_repeat_to_the_last_bit_end_a_solve() -> None:
    problem = load("funnel-30")
    residual = Residual(problem)
    progress = Progress(problem, residual, Stop(1e-12), None, flops=1.0, first=np.zeros(problem.n_rows))
    for count in range(2 * MAX_SHORT_STEPS):
        progress.record(np.ones(problem.n_rows) * (1.0 + min(count, MAX_SHORT_STEPS)), 2.0, 1e-12)
        assert progress.outcome is None
    progress.record(np.ones(problem.n_rows) * (1.0 + MAX_SHORT_STEPS), 2.0)
    assert progress.outcome is not None
    assert progress.outcome[0] is Status.STALLED


def test_steps_without_gain_end_a_solve_as_stalled() -> None:
    """Steps that change only the last bits would continue to the limits."""
    solution = create("InteriorPoint").prepare(load("hard-random-rank")).solve(Stop(1e-12, 10**5, 30.0))
    assert solution.status is Status.STALLED
    assert solution.iterations < 2000


def test_a_solve_without_gain_ends_only_when_the_gain_is_checked() -> None:
    """The residual may stay large on most of a path while τ rises; Newton steps without gain end the solve."""
    problem = load("funnel-30")
    residual, rng = Residual(problem), np.random.default_rng(1)
    progress = Progress(problem, residual, Stop(1e-12, 10**6), None, flops=1.0, first=np.zeros(problem.n_rows))
    for _ in range(1000):
        progress.record(rng.uniform(size=problem.n_rows), 2.0)
    assert progress.outcome is None
    progress.check_gain()
    assert progress.outcome is not None
    assert progress.outcome[0] is Status.STALLED


def test_a_fruitless_run_from_a_start_ends_early_and_the_solve_continues_as_from_zero() -> None:
    problem = load("funnel-30")
    residual, rng = Residual(problem), np.random.default_rng(1)
    first = rng.uniform(size=problem.n_rows)
    progress = Progress(problem, residual, Stop(1e-12, 10**6), None, flops=1.0, first=first, is_warm=True)
    began = progress.best_residual
    for _ in range(MIN_WARM_STEPS):
        assert progress.outcome is None
        progress.record(rng.uniform(size=problem.n_rows), 2.0 * began)
        progress.check_gain()
    assert progress.outcome is not None
    assert progress.may_run()
    assert not progress.best.any()
    assert progress.best_residual == residual.judged(problem, progress.best)


def test_a_failed_run_from_zero_returns_the_better_impulses_of_the_run_before_it() -> None:
    problem = load("funnel-30")
    near = solve(problem, "SORprox", tolerance=1e-3).impulses
    progress = Progress(problem, Residual(problem), Stop(1e-12), None, flops=1.0, first=near, is_warm=True)
    progress.end(Status.STALLED, "short steps")
    assert progress.may_run()
    progress.end(Status.STALLED, "short steps")
    assert not progress.may_run()
    assert np.array_equal(progress.solution().impulses, near)


def test_the_gain_of_a_run_is_measured_within_that_run() -> None:
    """A run after 300 fruitless steps of an earlier run has 200 steps of its own."""
    problem = load("funnel-30")
    residual, rng = Residual(problem), np.random.default_rng(1)
    progress = Progress(problem, residual, Stop(1e-12, 10**6), None, flops=1.0, first=np.zeros(problem.n_rows))
    progress.record(rng.uniform(size=problem.n_rows), 1e-3)
    for _ in range(300):
        progress.record(rng.uniform(size=problem.n_rows), 2.0)
    progress.end(Status.STALLED, "short steps")
    assert progress.may_run()
    for _ in range(MIN_STEPS - 1):
        progress.record(rng.uniform(size=problem.n_rows), 2.0)
    progress.check_gain()
    assert progress.outcome is None
    progress.record(rng.uniform(size=problem.n_rows), 2.0)
    progress.check_gain()
    assert progress.outcome is not None
