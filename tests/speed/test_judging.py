"""Time of the judge: of a whole verdict, and of the residual alone, which convergence curves and solvers use.

The verdict confirms the solver's claim, and the residual alone equals that of the verdict in less time.
"""

import time
from collections.abc import Callable
from functools import cache
from typing import Any

import pytest
from contestants import SIZES, TOLERANCE, funnel_step
from proxbench.problems import ContactProblem, judge
from proxbench.problems.arrays import FloatArray
from proxbench.problems.contact.residual import Residual
from proxbench.solvers import Status, Stop, create


@cache
def solved(size: int) -> tuple[ContactProblem, FloatArray]:
    problem = funnel_step(f"funnel-{size}")
    solution = create("SORprox", relaxation=1.5).prepare(problem.fresh()).solve(Stop(TOLERANCE))
    assert solution.status is Status.SOLVED
    return problem, solution.impulses


def seconds(call: Callable[[], object]) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


@pytest.mark.parametrize("size", SIZES)
def test_verdict(benchmark: Any, size: int) -> None:
    problem, impulses = solved(size)
    verdict = judge(problem, impulses)
    benchmark.extra_info.update(problem=problem.name, digest=problem.digest, judged_residual=verdict.residual)
    assert benchmark.pedantic(judge, args=(problem, impulses), rounds=300, warmup_rounds=5) == verdict
    assert verdict.residual <= TOLERANCE


@pytest.mark.parametrize("size", SIZES)
def test_residual_of_an_iterate(benchmark: Any, size: int) -> None:
    problem, impulses = solved(size)
    residual = Residual(problem)

    def look() -> float:
        return residual(impulses, problem.relative_velocity(impulses))

    benchmark.extra_info.update(problem=problem.name, digest=problem.digest, judged_residual=look())
    verdict = judge(problem, impulses)
    assert benchmark.pedantic(look, rounds=500, warmup_rounds=5) == verdict.residual
    pairs = [(seconds(look), seconds(lambda: judge(problem, impulses))) for _ in range(100)]
    alone, whole = map(min, zip(*pairs, strict=True))
    assert alone < whole
