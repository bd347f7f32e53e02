"""The rule that distinguishes correct, wrong and relaxed answers."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.bench.store.outcome import (
    RELAXED_FACTOR,
    ROUNDING,
    WRONG_FACTOR,
    Outcome,
    claim_reason,
    late_reason,
    point_outcome,
)
from proxbench.problems import ContactProblem, judge
from proxbench.solvers import Model, Status

VERDICT = judge(ContactProblem.from_delassus(np.eye(1), (1.0,), dim=1), np.zeros(1))


def outcome(status: Status, own: float, coulomb: float, model: Model = Model.COULOMB) -> Outcome:
    return point_outcome(status, 1e-4, model, replace(VERDICT, residual=own), replace(VERDICT, residual=coulomb))


def test_a_claim_that_its_own_judge_confirms_is_solved() -> None:
    assert outcome(Status.SOLVED, 9e-5, 9e-5) is Outcome.SOLVED


@pytest.mark.parametrize("residual", [1.1e-3, float("inf"), float("nan")])
def test_a_claim_refuted_by_more_than_ten_times_is_wrong(residual: float) -> None:
    assert outcome(Status.SOLVED, residual, residual) is Outcome.WRONG
    assert outcome(Status.SOLVED, residual, 0.3, Model.CONVEX) is Outcome.WRONG


def test_a_relaxed_model_is_never_solved_where_it_differs_from_coulomb() -> None:
    assert outcome(Status.SOLVED, 1e-5, 0.3, Model.CONVEX) is Outcome.RELAXED
    assert outcome(Status.SOLVED, 1e-9, 5e-5, Model.CONVEX) is Outcome.RELAXED
    assert outcome(Status.SOLVED, 3e-5, 3e-5, Model.CONVEX) is Outcome.SOLVED


@pytest.mark.parametrize("status", [status for status in Status if status is not Status.SOLVED])
def test_the_outcome_of_an_unsuccessful_solve_is_its_status(status: Status) -> None:
    assert outcome(status, 0.0, 0.0).value == status.value


def test_a_relaxed_residual_is_not_compared_with_rounding() -> None:
    """If the residual under its own model is zero, a Coulomb residual of rounding size is still accepted."""
    for own in (0.0, 0.1 * ROUNDING, ROUNDING):
        assert outcome(Status.SOLVED, own, 0.9 * RELAXED_FACTOR * ROUNDING, Model.CONVEX) is Outcome.SOLVED
        assert outcome(Status.SOLVED, own, 1.1 * RELAXED_FACTOR * ROUNDING, Model.CONVEX) is Outcome.RELAXED


@pytest.mark.parametrize("factor", [1.0, 1.0 + 1e-9])
def test_a_relaxed_residual_may_be_the_tolerance_and_not_more(factor: float) -> None:
    expected = Outcome.SOLVED if factor == 1.0 else Outcome.RELAXED
    assert outcome(Status.SOLVED, 5e-5, factor * 1e-4, Model.CONVEX) is expected


def test_a_claim_is_wrong_from_ten_times_its_tolerance_on() -> None:
    assert outcome(Status.SOLVED, WRONG_FACTOR * 1e-4, WRONG_FACTOR * 1e-4) is Outcome.SOLVED
    assert outcome(Status.SOLVED, 1.0001 * WRONG_FACTOR * 1e-4, 0.0) is Outcome.WRONG


def test_reasons_are_given_for_claims_that_do_not_count_alone() -> None:
    assert claim_reason(Outcome.WRONG, 1e-4, Model.COULOMB, 0.25) == "claimed 1e-04, but judged 2.5e-01"
    assert claim_reason(Outcome.WRONG, 2.4e-4, Model.COULOMB, 0.25) == "claimed 2.4e-04, but judged 2.5e-01"
    assert claim_reason(Outcome.RELAXED, 1e-4, Model.CONVEX, 0.0) == "solves the convex model, not Coulomb friction"
    assert claim_reason(Outcome.SOLVED, 1e-4, Model.COULOMB, 0.0) == ""
    assert late_reason(2.0, 2.0) == ""
    assert late_reason(2.01, 2.0) == "solved after 2.01 s, but its limit is 2 s"
