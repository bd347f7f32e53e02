"""Every built-in solver keeps the promises that plugins are held to."""

import os
from itertools import product
from typing import Any

import pytest
from proxbench.bench.conformance import SOLVER_CHECKS, Check, NotApplicable
from proxbench.bench.conformance.hard_checks import HARD_CHECKS
from proxbench.bench.conformance.invariance_checks import INVARIANCE_CHECKS
from proxbench.solvers import Solver, create

VARIANTS = [
    "Robust",
    "Jprox",
    "JORprox(relaxation=0.5)",
    "JORprox(step_size='row_sum')",
    "SORprox",
    "SORprox(relaxation=1.5, form='factors')",
    "ColouredSORprox",
    "ColouredSORprox(relaxation=1.1, momentum=0.65)",
    "SafeguardedSORprox",
    "NesterovSORprox",
    "AndersonSORprox",
    "NSGS",
    "SemismoothNewton",
    "ProximalADMM",
    "ProximalADMM(memory=0)",
    "APGD",
    "SAP",
    "ProximalPoint",
    "InteriorPoint",
    "InteriorPoint(form='factors')",
    "CentralPath",
    "CentralPath(form='factors')",
    "InteriorNewton",
    "HybridNewton",
    "MomentumFallback",
    "Fallback(SORprox, NSGS)",
    "ClarabelSOCP",
    "ClarabelSOCP(form='factors')",
    "ClarabelCoulomb",
    "Refined(ClarabelCoulomb)",
    "Warm(SORprox)",
    "CvxpyCoulomb",
    "Lemke",
    "PyramidPGS",
    "Enumeration",
]


def test_the_variants_cover_every_built_in_solver() -> None:
    from proxbench.solvers.registry import BUILT_IN, PARTS, composites

    assert {name.split("(")[0] for name in VARIANTS} == {*BUILT_IN, *PARTS, *composites()}


LONG = {check.name for check in (*HARD_CHECKS, *INVARIANCE_CHECKS)}
"""Checks on more than a hundred problems, or on some many times."""

COMPARED = ("ProximalADMM", "ProximalPoint", "APGD", "SAP")
SLOW = (
    "Cvxpy",
    "ClarabelSOCP(",
    "JORprox(step",
    "InteriorPoint(form",
    "InteriorNewton",
    "MomentumFallback",
    "CentralPath",
    "NesterovSORprox",
    *COMPARED,
)
"""Solvers that take minutes for those, or variants of others that do; only the full profile runs them there."""

PATIENT = ("CentralPath", "InteriorPoint(", "InteriorNewton", "Refined", "ClarabelCoulomb", "MomentumFallback")
"""Solvers that take seconds for all checks, or are made of those that are checked daily."""

DAILY = {"SORprox"}
"""The solver that runs the long checks daily."""


def pairs() -> list[Any]:
    """Return each variant with each check; what takes long is slow but for one solver."""
    return [
        pytest.param(name, check, marks=[pytest.mark.slow] if is_slow(name, check) else [], id=f"{name}-{check}")
        for name, check in product(VARIANTS, SOLVER_CHECKS)
    ]


def is_slow(name: str, check: Check[Solver]) -> bool:
    return name not in DAILY if check.name in LONG else name.startswith((*SLOW, *PATIENT))


@pytest.mark.parametrize(("name", "check"), pairs())
def test_it_conforms(name: str, check: Check[Solver]) -> None:
    is_variant = "=" in name or name.startswith(SLOW)
    if check.name in LONG and is_variant and os.environ.get("PROXBENCH_PROFILE") != "full":
        pytest.skip("takes minutes for all; PROXBENCH_PROFILE=full runs it")
    try:
        check.run(create(name))
    except NotApplicable as reason:
        pytest.skip(str(reason))
