"""Tricks by which a solver would seem faster or more accurate than it is, and their verdicts in a run."""

import pytest
from catalogue import measured
from cheating_solvers import Answering, Elsewhere, FewIterations, Honest, Jittering, Late
from proxbench.bench import run
from proxbench.bench.report.accuracy import times_to_accuracies
from proxbench.bench.report.tables import results_table
from proxbench.bench.store.notes import notes_of
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import load


@pytest.mark.parametrize("is_randomised", [False, pytest.param(True, marks=pytest.mark.weekly)])
def test_answers_that_differ_between_repeats_are_shown_unless_they_are_declared(is_randomised: bool) -> None:
    case = measured(Jittering(is_randomised), ladder=(1e-2, 1e-6))
    point = case.points[-1]
    assert point.outcome is Outcome.SOLVED
    assert point.measured is not None
    assert point.measured.answers > 1
    assert ("different answers" in notes_of(case, point)) is not is_randomised


def test_late_answers_reach_no_accuracy_in_tables(tmp_path: object) -> None:
    made = run("hard-sticking-box", [Late()], results=str(tmp_path), tolerances=1e-2, solve_seconds=0.02)
    assert times_to_accuracies(made.points, [1e-2]).empty
    assert list(results_table(made)["outcome"]) == ["time limit"]


def test_a_false_claim_of_infeasibility_is_refuted_by_another_solver_also_when_that_comes_later(
    tmp_path: object,
) -> None:
    problem = load("funnel-30")
    assert problem.answer is None
    alone = run(problem, [Answering("Hopeless")], results=str(tmp_path), run_id="alone", tolerances=1e-2)
    assert list(alone.points["outcome"]) == [Outcome.INFEASIBLE]
    both = run(problem, [Answering("Hopeless"), "SORprox"], results=str(tmp_path), run_id="both", tolerances=1e-9)
    assert list(both.points["outcome"]) == [Outcome.WRONG, Outcome.SOLVED]


@pytest.mark.weekly
def test_observed_iterations_replace_claimed_ones() -> None:
    honest, found = (measured(one, "funnel-30").points[-1].measured for one in (Honest(), FewIterations()))
    assert honest is not None
    assert found is not None
    assert honest.claimed_iterations is None
    assert found.claimed_iterations == honest.iterations // 10
    assert found.iterations == pytest.approx(honest.iterations, rel=0.2)


@pytest.mark.alone
@pytest.mark.weekly
def test_the_time_of_a_solve_includes_the_wait_for_asynchronous_work() -> None:
    points = measured(Elsewhere()).points
    assert {point.outcome for point in points} == {Outcome.SOLVED}
    assert all(point.measured is not None and point.measured.solve_seconds.min >= 0.02 for point in points)
