"""A plan is checked as a whole before anything runs."""

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.plan import (
    DEFAULT_SOLVERS,
    LADDER,
    THOROUGH_LADDER,
    THOROUGH_PASSES,
    Limits,
    make_plan,
)
from proxbench.problems import ProblemError
from proxbench.problems.exchange.catalog import is_held
from proxbench.solvers import SolverError


def test_the_default_is_the_quick_suite_with_eight_problems_and_eight_variants() -> None:
    plan = make_plan()
    assert len(plan.problems) >= 8
    assert len(plan.solvers) == len(DEFAULT_SOLVERS) >= 8
    assert plan.tolerances == LADDER
    assert all(isinstance(name, str) and is_held(name) for name in plan.problems)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"suite": "quik"}, ProblemError, "'quick'"),
        ({"problems": ["funel-30"]}, ProblemError, "'funnel-30'"),
        ({"solvers": ["SORprx"]}, SolverError, "'SORprox'"),
        ({"solvers": ["SORprox(relaxtion=1)"]}, SolverError, "'relaxation'"),
        ({"solvers": ["SORprox", "SORprox"]}, BenchError, "more than once"),
        ({"problems": ["funnel-30", "funnel-30"]}, BenchError, "more than once"),
        ({"tolerances": [2.0]}, BenchError, "between 0 and 1"),
        ({"tolerances": [float("nan")]}, BenchError, "between 0 and 1"),
    ],
)
def test_what_is_wrong_is_named_with_the_remedy(
    arguments: dict[str, object], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        make_plan(**arguments)  # type: ignore[arg-type]


def test_a_thorough_plan_has_more_tolerances_and_passes_where_none_are_given() -> None:
    plan = make_plan(thorough=True)
    assert (plan.tolerances, plan.passes) == (THOROUGH_LADDER, THOROUGH_PASSES)
    assert set(LADDER) < set(THOROUGH_LADDER)
    assert make_plan().passes < THOROUGH_PASSES
    chosen = make_plan(thorough=True, tolerances=[1e-3], passes=1)
    assert (chosen.tolerances, chosen.passes) == ((1e-3,), 1)


def test_tolerances_are_ordered_from_coarse_to_fine_without_repetition() -> None:
    assert make_plan(tolerances=[1e-6, 1e-2, 1e-6]).tolerances == (1e-2, 1e-6)


@pytest.mark.parametrize("name", ["solve_seconds", "case_seconds", "memory_bytes", "max_iterations"])
def test_limits_must_be_positive(name: str) -> None:
    with pytest.raises(BenchError, match=name):
        Limits(**{name: 0})  # type: ignore[arg-type]
