"""Every built-in solver passes the checks that plugins must pass.

Daily tests run all checks on ``SORprox``, the short ones on ``Robust``, and an eighth of the short ones on most other
solvers. Slow tests run all checks on ``FIRST``, half of the short ones on most solvers, and an eighth of the others;
the rest is weekly.

With PROXBENCH_PROFILE=full, each solver runs the checks with the limits of plugins. Otherwise, solves take fewer
iterations, and only the default solver and ``SORprox`` solve hard cases of more than 100 rows.
"""

import os
from dataclasses import replace
from itertools import product
from typing import Any

import pytest
from diagonal import is_on_diagonal
from proxbench.bench.conformance import (
    SOLVER_CHECKS,
    Check,
    NotApplicable,
    hard_checks,
    invariance_checks,
    repetition_checks,
    samples,
    solver_checks,
)
from proxbench.problems.exchange.index import stored_summaries
from proxbench.problems.hard import CASE_GROUPS
from proxbench.solvers import Solver, Stop, create

IS_FULL = os.environ.get("PROXBENCH_PROFILE") == "full"

MAX_ROWS = 100
"""Number of rows of the largest hard cases that most solvers solve without the full profile."""

KINDS = ("hard-stack-10", "hard-mixed-laws", "hard-tresca-joint", "hard-remote-partner", "hard-duplicated-slider")
"""The hard cases that ``CvxpyCoulomb``, which takes milliseconds per set-up, solves without the full profile."""

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


LONG = {check.name for check in (*hard_checks.HARD_CHECKS, *invariance_checks.INVARIANCE_CHECKS)}
"""Checks on more than a hundred problems, or with many repetitions."""

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
"""Solvers that take minutes for ``LONG``, and variants of such solvers; only the full profile runs these checks."""

PATIENT = (
    *("CentralPath", "InteriorPoint(", "InteriorNewton", "Refined", "ClarabelCoulomb", "MomentumFallback"),
    "ColouredSORprox",
)
"""Solvers that take seconds for all checks or to compile, or are composed of solvers that are checked daily."""

DAILY = {"SORprox"}
"""The solver that runs the long checks daily."""

THOROUGH = {"Robust", *DAILY}
"""Solvers that solve the largest hard cases without the full profile too."""


FIRST = {"Robust", *DAILY}
"""Solvers that run all checks in slow tests: the default solver, and the one that runs all of them daily."""


COMPILING = ("ColouredSORprox", "process")
"""The solver and the check on the diagonal for which kernels are compiled for ten seconds."""


def pairs() -> list[Any]:
    """Return each variant with each check, with the marks of its tier."""
    return [
        pytest.param(name, check, marks=marks_of(row, name, column, check), id=f"{name}-{check}")
        for (row, name), (column, check) in product(enumerate(VARIANTS), enumerate(SOLVER_CHECKS))
    ]


def marks_of(row: int, name: str, column: int, check: Check[Solver]) -> list[pytest.MarkDecorator]:
    is_chosen = name in FIRST or is_on_diagonal(row, column)
    if not is_slow(name, check):
        return [] if is_chosen else [pytest.mark.slow if is_on_diagonal(row, column, 2) else pytest.mark.weekly]
    is_chosen &= (name, check.name) != COMPILING
    return [pytest.mark.slow if is_chosen else pytest.mark.weekly]


def is_slow(name: str, check: Check[Solver]) -> bool:
    return name not in DAILY if check.name in LONG else name.startswith((*SLOW, *PATIENT))


def is_small(case: str) -> bool:
    return stored_summaries()[case].rows <= MAX_ROWS


@pytest.fixture
def few_iterations(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reduce the limits and cases of the checks, unless the profile is full."""
    if IS_FULL:
        return
    monkeypatch.setattr(repetition_checks, "STOP", Stop(1e-9, max_iterations=50, max_seconds=0.5))
    if name.startswith("Cvxpy"):
        monkeypatch.setattr(samples, "_HARD_CASES", KINDS)
    if name.startswith((*SLOW, *PATIENT)):
        monkeypatch.setattr(solver_checks, "DEFAULT_STOP", Stop(1e-6, max_iterations=200, max_seconds=1.0))
        monkeypatch.setattr(hard_checks, "CYCLING", Stop(1e-10, max_iterations=200, max_seconds=1.0))
    if name not in THOROUGH:
        monkeypatch.setattr(hard_checks, "HARD", replace(hard_checks.HARD, max_iterations=1000))
        small = {group: list(filter(is_small, cases)) for group, cases in CASE_GROUPS.items()}
        monkeypatch.setattr(hard_checks, "CASE_GROUPS", small)


@pytest.mark.usefixtures("few_iterations")
@pytest.mark.parametrize(("name", "check"), pairs())
def test_every_variant_passes_the_conformance_checks(name: str, check: Check[Solver]) -> None:
    is_variant = "=" in name or name.startswith(SLOW)
    if check.name in LONG and is_variant and not IS_FULL:
        pytest.skip("takes minutes for all; PROXBENCH_PROFILE=full runs it")
    try:
        check.run(create(name))
    except NotApplicable as reason:
        pytest.skip(str(reason))
