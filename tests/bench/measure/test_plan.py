"""A plan is checked as a whole before anything runs."""

from collections.abc import Callable
from typing import Any

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.plan import DEFAULT_SOLVERS, make_plan
from proxbench.bench.store.plans import LADDER, THOROUGH_LADDER, THOROUGH_PASSES, Limits, RunSettings, limit_in_bytes
from proxbench.problems import ProblemError
from proxbench.problems.exchange.catalog import is_shipped
from proxbench.solvers import SolverError


def test_the_default_is_the_quick_suite_with_eight_problems_and_eight_variants() -> None:
    plan = make_plan()
    assert len(plan.problems) >= 8
    assert len(plan.solvers) == len(DEFAULT_SOLVERS) >= 8
    assert plan.record.tolerances == list(LADDER)
    assert all(isinstance(name, str) and is_shipped(name) for name in plan.problems)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"suite": "quik"}, ProblemError, "'quick'"),
        ({"problems": ["funel-30"]}, ProblemError, "'funnel-30'"),
        ({"solvers": ["SORprx"]}, SolverError, "'SORprox'"),
        ({"solvers": ["SORprox(relaxtion=1)"]}, SolverError, "'relaxation'"),
        ({"solvers": ["SORprox", "SORprox"]}, BenchError, "more than once"),
        ({"problems": ["funnel-30", "funnel-30"]}, BenchError, "more than once"),
    ],
)
def test_error_names_the_fault_and_the_remedy(arguments: dict[str, object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        make_plan(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tolerances": [2.0]}, "between 0 and 1"),
        ({"tolerances": [float("nan")]}, "between 0 and 1"),
        ({"passes": 0}, "passes"),
        ({"passes": 1001}, "passes"),
        ({"seed": -1}, "seed"),
    ],
)
def test_settings_out_of_range_are_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(BenchError, match=words):
        RunSettings.checked(**arguments)


def test_thorough_settings_have_more_tolerances_and_passes_by_default() -> None:
    settings = RunSettings.checked(thorough=True)
    assert (tuple(settings.tolerances), settings.passes) == (THOROUGH_LADDER, THOROUGH_PASSES)
    assert set(LADDER) < set(THOROUGH_LADDER)
    assert RunSettings.checked() == RunSettings()
    assert RunSettings().passes < THOROUGH_PASSES
    chosen = RunSettings.checked([1e-3], passes=1, thorough=True)
    assert (chosen.tolerances, chosen.passes) == ([1e-3], 1)


def test_tolerances_are_ordered_from_coarse_to_fine_without_repetition() -> None:
    assert RunSettings.checked([1e-6, 1e-2, 1e-6]).tolerances == [1e-2, 1e-6]


@pytest.mark.parametrize("name", ["solve_seconds", "case_seconds", "memory_bytes", "max_iterations"])
def test_limits_must_be_positive(name: str) -> None:
    with pytest.raises(BenchError, match=name):
        Limits(**{name: 0})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("made", "name"),
    [
        (lambda: Limits(solve_seconds="1"), "solve_seconds"),  # type: ignore[arg-type]
        (lambda: limit_in_bytes("x"), "memory"),  # type: ignore[arg-type]
        (lambda: RunSettings.checked("x"), "tolerances"),  # type: ignore[arg-type]
        (lambda: RunSettings.checked(passes="x"), "passes"),  # type: ignore[arg-type]
        (lambda: RunSettings.checked(seed=None), "seed"),  # type: ignore[arg-type]
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)
def test_error_names_the_setting_that_is_not_a_number(made: Callable[[], object], name: str) -> None:
    with pytest.raises(BenchError, match=f"^`{name}` must be a number, got "):
        made()


def test_an_empty_list_is_refused_and_does_not_mean_the_default() -> None:
    with pytest.raises(BenchError, match="no solver is given; name at least one, or omit the solvers"):
        make_plan(["funnel-30"], [])
    with pytest.raises(BenchError, match="no problem is given; name at least one, or omit the problems"):
        make_plan([])
