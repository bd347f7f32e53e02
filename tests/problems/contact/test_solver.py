"""Stopping criteria are valid numbers, and every solver can count to the iteration limit."""

import sys
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem
from proxbench.solvers import SolverError, Status, Stop, create


@pytest.mark.parametrize("limit", [10, 10.0, np.int32(10), np.float64(10.0)])
def test_a_whole_iteration_limit_of_any_type_becomes_an_integer(limit: int) -> None:
    stop = Stop(1e-6, limit)
    assert stop.max_iterations == 10
    assert type(stop.max_iterations) is int


@pytest.mark.parametrize("limit", [np.inf, 10**30])
def test_an_infinite_or_huge_iteration_limit_becomes_the_largest_index(limit: int) -> None:
    assert Stop(1e-6, limit).max_iterations == sys.maxsize


@pytest.mark.parametrize("limit", [2.5, -1, np.nan, -np.inf, "10"])
def test_any_other_iteration_limit_is_refused(limit: int) -> None:
    with pytest.raises(SolverError, match="max_iterations"):
        Stop(1e-6, limit)


@pytest.mark.parametrize("solver", ["SORprox", "SORprox(momentum=0.5)", "SemismoothNewton", "Robust"])
@pytest.mark.parametrize("limit", [np.inf, 1e3])
def test_solvers_accept_an_iteration_limit_that_was_given_as_a_float(solver: str, limit: int) -> None:
    matrix = np.eye(6) + 0.2
    problem = ContactProblem.from_delassus(matrix, [-1.0, 0.4, 0.2, -0.5, 0.1, 0.3], 0.5)
    assert create(solver).prepare(problem).solve(Stop(1e-6, limit, 20.0)).status is Status.SOLVED


@pytest.mark.parametrize("huge", [10**400, Fraction(10**400), np.longdouble("1e400")])
def test_a_number_too_large_for_a_float_counts_as_infinite(huge: Any) -> None:
    assert Stop(huge, max_seconds=huge) == Stop(np.inf, max_seconds=np.inf)
    for options in ({"tolerance": -huge}, {"max_seconds": -huge}):
        with pytest.raises(SolverError, match="must be positive, got -inf"):
            Stop(**options)


def test_a_tolerance_too_small_for_a_float_counts_as_zero() -> None:
    with pytest.raises(SolverError, match="`tolerance` must be positive, got 0"):
        Stop(Fraction(1, 10**400))
