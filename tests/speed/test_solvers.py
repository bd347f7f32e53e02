"""Speeds of preparing, sweeping, judging and stepping, on a funnel step of about 1700 contacts.

Run with ``nox -s speed``; nothing here asserts a time.
"""

from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.moreau import Moreau
from proxbench.problems.scenes.funnel import TIME_STEP, Funnel
from proxbench.solvers import Stop, create

FORMS = ["delassus", "factors"]
SWEEPS = 100


@pytest.fixture(scope="module")
def problem() -> ContactProblem:
    return load("funnel-1000")


@pytest.mark.parametrize("form", FORMS)
def test_sweeps(benchmark: Any, problem: ContactProblem, form: str) -> None:
    iterates = create("SORprox", relaxation=1.5, form=form).prepare(problem).begin(np.zeros(problem.n_rows))  # type: ignore[attr-defined]
    iterates.sweep(SWEEPS)
    benchmark(iterates.sweep, SWEEPS)
    nanoseconds = 1e9 * benchmark.stats.stats.median / SWEEPS / problem.n_contacts
    benchmark.extra_info["nanoseconds_per_contact_and_sweep"] = nanoseconds


@pytest.mark.parametrize("form", FORMS)
def test_preparing(benchmark: Any, problem: ContactProblem, form: str) -> None:
    solver = create("SORprox", relaxation=1.5, form=form)
    benchmark.pedantic(solver.prepare, setup=lambda: ((problem.fresh(),), {}), rounds=30, warmup_rounds=2)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_solving_with_preparing(benchmark: Any, problem: ContactProblem, form: str, tolerance: float) -> None:
    solver = create("SORprox", relaxation=1.5, form=form)

    def solve(fresh: ContactProblem) -> Any:
        return solver.prepare(fresh).solve(Stop(tolerance))

    solution = benchmark.pedantic(solve, setup=lambda: ((problem.fresh(),), {}), rounds=15, warmup_rounds=1)
    benchmark.extra_info["iterations"] = solution.iterations
    benchmark.extra_info["judged_residual"] = judge(problem, solution.impulses).residual
    benchmark.extra_info["digest"] = problem.digest


def test_judging(benchmark: Any, problem: ContactProblem) -> None:
    impulses = create("SORprox").prepare(problem).solve(Stop(1e-4)).impulses
    benchmark(judge, problem, impulses)


def test_one_step_of_the_thousand_ball_funnel(benchmark: Any) -> None:
    scene = Funnel(1000)
    stepper = Moreau(scene.system(), create("SORprox", relaxation=1.5), Stop(1e-4), TIME_STEP)
    state = scene.start()
    for step in stepper.steps(state, 600):
        state = step.state
    benchmark.pedantic(stepper.step, args=(state,), rounds=20, warmup_rounds=2)
