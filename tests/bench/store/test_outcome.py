"""The rule that separates right from wrong and relaxed."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.bench.store.outcome import Outcome, point_outcome
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
def test_other_endings_keep_their_name(status: Status) -> None:
    assert outcome(status, 0.0, 0.0).value == status.value
