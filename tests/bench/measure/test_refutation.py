"""A claim that a problem has no solution is kept unless another solver has a solution."""

import pytest
from proxbench.bench.measure.refutation import mark_refuted_claims, without_refuted_claims
from proxbench.bench.store.outcome import Cell, Outcome, point_outcome, verdicts
from proxbench.bench.store.records import CaseRecord, Point
from proxbench.problems import Model, load
from proxbench.solvers import Status
from stored_cases import case_record, measured_in, timed_round

TOLERANCE = 1e-8


def case_of(solver: str, status: Status, outcome: Outcome, residual: float) -> CaseRecord:
    measured = measured_in([timed_round(0, 1.0)], residual=residual, model_residual=residual)
    point = Point(tolerance=TOLERANCE, outcome=outcome, status=status.value, reason="", measured=measured)
    return case_record(problem="hard-squeezed", solver=solver, points=[point])


@pytest.mark.parametrize("size", [1e9, 1e16, 1e200])
def test_huge_impulses_do_not_refute_a_true_claim_of_infeasibility(size: float) -> None:
    own, coulomb = verdicts(load("hard-squeezed"), [size, size], Model.COULOMB)  # type: ignore[arg-type]
    outcome = point_outcome(Status.SOLVED, TOLERANCE, Model.COULOMB, own, coulomb)
    assert outcome is Outcome.WRONG
    honest = case_of("Honest", Status.INFEASIBLE, Outcome.INFEASIBLE, 1.0)
    assert mark_refuted_claims([honest, case_of("Bracing", Status.SOLVED, outcome, own.residual)], None) == []


def test_a_solution_refutes_a_claim() -> None:
    claim = case_of("Hasty", Status.INFEASIBLE, Outcome.INFEASIBLE, 1.0)
    [changed] = mark_refuted_claims([claim, case_of("Solver", Status.SOLVED, Outcome.SOLVED, 1e-9)], None)
    assert changed.points[0].outcome is Outcome.WRONG


@pytest.mark.parametrize(("residual", "is_refuted"), [(1e-9, True), (1e-7, False)])
def test_a_solution_refutes_claims_under_its_own_model_in_a_matrix(residual: float, is_refuted: bool) -> None:
    cells = [
        Cell("p", "Solver", Outcome.SOLVED, residual, residual),
        Cell("p", "Hasty", Outcome.INFEASIBLE),
        Cell("p", "Convex", Outcome.INFEASIBLE),
        Cell("q", "Hasty", Outcome.INFEASIBLE),
    ]
    models = {"Solver": Model.COULOMB, "Hasty": Model.COULOMB, "Convex": Model.CONVEX}
    solved, hasty, *others = without_refuted_claims(cells, models, {"p": None, "q": None})
    assert hasty.outcome is (Outcome.WRONG if is_refuted else Outcome.INFEASIBLE)
    assert [solved, *others] == [cells[0], *cells[2:]]
    known = without_refuted_claims(cells, models, {"p": True, "q": False})
    assert [cell.outcome for cell in known[1:]] == [Outcome.WRONG, Outcome.INFEASIBLE, Outcome.INFEASIBLE]
