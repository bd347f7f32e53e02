"""Rejudging on another machine agrees up to rounding of the sums, however small a residual is, and no further."""

from dataclasses import replace as with_changes
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from proxbench.bench.store.bundles.bundle import Bundle
from proxbench.bench.store.bundles.rejudge import ROUNDING, rejudge_bundle
from proxbench.bench.store.impulses import Impulses
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits, PlanRecord
from proxbench.bench.store.records import CaseRecord, Point, RunRecord
from proxbench.problems import ContactProblem, Model, judge
from simulated_runs import MACHINE
from stored_cases import case_record, measured_in, timed_round

PROBLEM = ContactProblem.from_delassus(
    np.array([[2.0, 0.1, 0.2], [0.1, 1.0, 0.3], [0.2, 0.3, 1.5]]), (-1.0, 0.7, 0.1), 2.0, name="stuck"
)
SOLUTION = -np.linalg.solve(PROBLEM.delassus().toarray(), PROBLEM.free_velocity)
RUN = RunRecord(
    run_id="run",
    plan=PlanRecord(problems=["stuck"], solvers=["S"], tolerances=[1e-6], limits=Limits()),
    machine=MACHINE,
    plugins=[],
)


def bundle_that_says(judged: np.ndarray, sent: np.ndarray, problem: ContactProblem = PROBLEM) -> Bundle:
    """Return a bundle that contains the impulses ``sent`` with the residuals of the impulses ``judged``."""
    verdict = judge(problem, judged)
    measured = measured_in(
        [timed_round(0, 1.0)],
        residual=verdict.residual,
        model_residual=verdict.residual,
        verdict=verdict.numeric_fields(),
        impulses=[replace(Impulses.of(judged, verdict, verdict), packed=Impulses.of(sent, verdict, verdict).packed)],
    )
    point = Point(tolerance=1e-6, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)
    sizes = {"n_rows": problem.n_rows, "n_contacts": problem.n_contacts}
    case: CaseRecord = case_record(problem="stuck", digest=problem.digest, points=[point], **sizes)
    return Bundle(Path("run.bundle"), RUN, [case], {"stuck": problem})


def test_residuals_at_rounding_level_agree() -> None:
    other = SOLUTION * (1.0 + 0.5 * ROUNDING * np.array([1.0, -1.0, -1.0]))
    assert judge(PROBLEM, other).residual > 10.0 * judge(PROBLEM, SOLUTION).residual
    assert rejudge_bundle(bundle_that_says(SOLUTION, SOLUTION)).n_identical == 2
    found = rejudge_bundle(bundle_that_says(other, SOLUTION))
    assert found.disagreements == []
    assert (found.n_residuals, found.n_identical) == (2, 0)


def test_rounding_of_terms_that_cancel_agrees_however_small_their_sum_is() -> None:
    """In a ring of contacts (G Λ)_i = Λ_i - (1/2 - δ) (Λ_{i-1} + Λ_{i+1}) is 2 δ where all Λ_i are 1."""
    count, small = 8, 1e-6
    neighbour = np.roll(np.eye(count), 1, axis=0)
    delassus = np.eye(count) - (0.5 - small) * (neighbour + neighbour.T)
    ring = ContactProblem.from_delassus(delassus, np.full(count, -2.0 * small), dim=1, name="stuck")
    impulses = np.ones(count)
    other = impulses * (1.0 + 0.5 * ROUNDING * (-1.0) ** np.arange(count))
    assert judge(ring, other).residual > 1e5 * ROUNDING
    found = rejudge_bundle(bundle_that_says(other, impulses, ring))
    assert found.disagreements == []
    assert found.n_identical == 0


def test_a_case_that_measured_nothing_has_nothing_to_judge() -> None:
    crashed = case_record(problem="stuck", digest=PROBLEM.digest, outcome=Outcome.CRASHED, points=[])
    found = rejudge_bundle(Bundle(Path("run.bundle"), RUN, [crashed], {"stuck": PROBLEM}))
    assert (found.n_cases, found.n_judged, found.disagreements) == (1, 0, [])


@pytest.mark.parametrize("part", [1e-9, 1e-6])
def test_rejudge_reports_a_residual_too_small_by_more_than_rounding(part: float) -> None:
    (sentence,) = rejudge_bundle(bundle_that_says(SOLUTION, SOLUTION * (1.0 + part))).disagreements
    assert sentence.startswith("S on stuck: the bundle reports residual ")


def test_rejudge_reports_a_problem_with_changed_numbers() -> None:
    bundle = bundle_that_says(SOLUTION, SOLUTION)
    other = with_changes(PROBLEM, free_velocity=2.0 * PROBLEM.free_velocity)
    (sentence,) = rejudge_bundle(with_changes(bundle, carried={"stuck": other})).disagreements
    assert "a problem with other numbers" in sentence


def test_the_verdict_of_a_relaxed_answer_is_that_under_coulombs_law() -> None:
    """The contact slides, and lifts off under the convex model, whose residual is zero there."""
    problem = ContactProblem.from_delassus(2.0 * np.eye(3), (-1.0, 3.0, 0.0), 0.5, name="stuck")
    impulses = np.array([1.0, -0.5, 0.0])
    own, coulomb = judge(problem, impulses, Model.CONVEX), judge(problem, impulses)
    measured = measured_in(
        [timed_round(0, 1.0)],
        residual=coulomb.residual,
        model_residual=own.residual,
        verdict=coulomb.numeric_fields(),
        impulses=[Impulses.of(impulses, own, coulomb)],
    )
    point = Point(tolerance=1e-6, outcome=Outcome.RELAXED, status="solved", reason="", measured=measured)
    case = case_record(problem="stuck", digest=problem.digest, model="convex", points=[point])
    assert rejudge_bundle(Bundle(Path("run.bundle"), RUN, [case], {"stuck": problem})).disagreements == []
    own_verdict = replace(point, measured=replace(measured, verdict=own.numeric_fields()))
    told = Bundle(Path("run.bundle"), RUN, [replace(case, points=[own_verdict])], {"stuck": problem})
    assert len(rejudge_bundle(told).disagreements) == 1


def test_the_summary_counts_the_residuals_that_agree_to_the_bit() -> None:
    other = SOLUTION * (1.0 + 0.5 * ROUNDING * np.array([1.0, -1.0, -1.0]))
    for judged, share in ((SOLUTION, "all"), (other, "0")):
        sentence = rejudge_bundle(bundle_that_says(judged, SOLUTION)).sentence
        assert sentence.startswith(f"1 of 1 cases judged again: 2 residuals, {share} bit-identical;")


@pytest.mark.parametrize("place", range(12))
def test_rounding_of_a_single_impulse_is_not_a_disagreement(place: int) -> None:
    """One contact is a million times stiffer than the others, so that its rounding alone decides the residual."""
    stiffness = np.ones(12)
    stiffness[place] = 1e6
    problem = ContactProblem.from_delassus(np.diag(stiffness), -stiffness, dim=1, name="stuck")
    other = np.ones(12)
    other[place] += ROUNDING
    assert judge(problem, other).residual > 2.0 * judge(problem, np.ones(12)).residual
    assert rejudge_bundle(bundle_that_says(other, np.ones(12), problem)).disagreements == []


def test_the_summary_counts_the_cases_that_disagree() -> None:
    assert rejudge_bundle(bundle_that_says(SOLUTION, SOLUTION)).sentence.endswith("; no case disagrees")
    assert rejudge_bundle(bundle_that_says(SOLUTION, SOLUTION * (1.0 + 1e-6))).sentence.endswith("; 1 cases disagree")
