"""SCS and ProxQP solve contact problems through cvxpy."""

import pytest
from proxbench.problems import judge, load
from proxbench.solvers import Status, Stop, create


@pytest.mark.parametrize(
    ("module", "name", "problem"),
    [
        ("scs", "CvxpyCoulomb(solver='SCS')", "funnel-30"),
        ("proxsuite", "CvxpyCoulomb(solver='PROXQP')", "funnel-frictionless-30"),
        ("proxsuite", "CvxpyCoulomb(solver='PROXQP')", "funnel-planar-30"),
    ],
)
def test_back_ends_reach_the_judges_residual_of_their_model(module: str, name: str, problem: str) -> None:
    pytest.importorskip(module, reason="the extra peers is not installed")
    solver, posed = create(name), load(problem)
    solution = solver.prepare(posed).solve(Stop(1e-4, max_seconds=60.0))
    assert solution.status is Status.SOLVED
    assert judge(posed, solution.impulses, model=solver.model).residual <= 1e-4
