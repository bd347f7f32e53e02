"""Every built-in solver keeps the promises that plugins are held to."""

import os

import pytest
from proxbench.bench.conformance import SOLVER_CHECKS, Check, NotApplicable
from proxbench.bench.conformance.hard_checks import HARD_CHECKS
from proxbench.bench.conformance.invariance_checks import INVARIANCE_CHECKS
from proxbench.solvers import Solver, create

VARIANTS = [
    "Jprox",
    "JORprox(relaxation=0.5)",
    "JORprox(step_size='row_sum')",
    "SORprox",
    "SORprox(relaxation=1.5, form='factors')",
    "SafeguardedSORprox",
    "NSGS",
    "SemismoothNewton",
    "HybridNewton",
    "MomentumFallback",
    "Fallback(SORprox, NSGS)",
    "ClarabelSOCP",
    "ClarabelSOCP(form='factors')",
    "ClarabelCoulomb",
    "Refined(ClarabelCoulomb)",
    "CvxpySOCP",
    "CvxpyCoulomb",
    "CvxpyQP",
    "Lemke",
    "PyramidPGS",
    "Enumeration",
]


def test_the_variants_cover_every_built_in_solver() -> None:
    from proxbench.solvers.registry import BUILT_IN, composites

    assert {name.split("(")[0] for name in VARIANTS} == {*BUILT_IN, *composites()}


LONG = {check.name for check in (*HARD_CHECKS, *INVARIANCE_CHECKS)}
"""Checks on more than a hundred problems, or on some many times."""

SLOW = ("Cvxpy", "ClarabelSOCP(", "JORprox(step")
"""Solvers that take minutes for those, or variants of others that take them; only the full profile tries."""


@pytest.mark.parametrize("check", SOLVER_CHECKS, ids=str)
@pytest.mark.parametrize("name", VARIANTS)
def test_it_conforms(name: str, check: Check[Solver]) -> None:
    if check.name in LONG and name.startswith(SLOW) and os.environ.get("PROXBENCH_PROFILE") != "full":
        pytest.skip("minutes; PROXBENCH_PROFILE=full tries it")
    try:
        check.run(create(name))
    except NotApplicable as reason:
        pytest.skip(str(reason))
