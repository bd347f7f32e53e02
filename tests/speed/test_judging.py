"""Time of the judge: a whole verdict, and the residual alone that convergence curves and solvers look at."""

from functools import cache
from typing import Any

import pytest
from contestants import SIZES, TOLERANCE, funnel_step
from proxbench.problems import ContactProblem, judge
from proxbench.problems.judge import Residual
from proxbench.problems.laws import FloatArray
from proxbench.solvers import Stop, create


@cache
def solved(size: int) -> tuple[ContactProblem, FloatArray]:
    problem = funnel_step(f"funnel-{size}")
    solution = create("SORprox", relaxation=1.5).prepare(problem.fresh()).solve(Stop(TOLERANCE))
    return problem, solution.impulses


@pytest.mark.parametrize("size", SIZES)
def test_verdict(benchmark: Any, size: int) -> None:
    problem, impulses = solved(size)
    verdict = judge(problem, impulses)
    benchmark.extra_info.update(problem=problem.name, digest=problem.digest, judged_residual=verdict.residual)
    benchmark.pedantic(judge, args=(problem, impulses), rounds=300, warmup_rounds=5)


@pytest.mark.parametrize("size", SIZES)
def test_residual_of_an_iterate(benchmark: Any, size: int) -> None:
    problem, impulses = solved(size)
    residual = Residual(problem)

    def look() -> float:
        return residual(impulses, problem.relative_velocity(impulses))

    benchmark.extra_info.update(problem=problem.name, digest=problem.digest, judged_residual=look())
    benchmark.pedantic(look, rounds=500, warmup_rounds=5)
