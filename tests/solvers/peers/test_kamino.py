"""Kamino's solver reaches small judged residuals, within single precision."""

import numpy as np
import pytest
from proxbench.bench.conformance import BRIEF_CHECKS
from proxbench.bench.conformance.run import run_checks
from proxbench.problems import ContactProblem, LawKind, Laws, judge, load
from proxbench.problems.contact.transformations import in_units
from proxbench.solvers import SolverError, Status, Stop, create

pytest.importorskip("newton", reason="the extra kamino is not installed")

SOLVERS = ["KaminoPADMM", "KaminoPADMM(acceleration=False)"]


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("problem", ["hard-sticking-box", "funnel-30", "funnel-frictionless-30"])
def test_the_judge_confirms_solutions_under_coulomb_friction(name: str, problem: str) -> None:
    posed = load(problem)
    solution = create(name).prepare(posed).solve(Stop(1e-4, max_seconds=60.0))
    assert solution.status is Status.SOLVED
    assert judge(posed, solution.impulses).residual <= 1e-4


def test_rows_of_all_laws_are_mapped_to_the_order_of_kamino() -> None:
    """Bilateral rows, bounded friction, a unilateral law and contacts, in another order than Kamino's."""
    kinds = [
        LawKind.UNILATERAL,
        LawKind.SPATIAL_FRICTION,
        LawKind.PLANAR_FRICTION,
        LawKind.UNILATERAL,
        LawKind.BILATERAL,
        LawKind.UNILATERAL,
        LawKind.SPATIAL_FRICTION,
    ]
    coefficients = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.3])
    bounds = np.array([0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 0.0])
    laws = Laws.in_order(kinds, coefficients, bounds, np.array([-1, 0, -1, -1, -1, -1, 5]))
    c = np.array([-3.0, 0.2, -0.1, 5.0, -2.0, 4.0, -1.0, 9.0, 0.0])
    problem = ContactProblem.from_delassus(np.eye(9), c, laws=laws)
    found = create("KaminoPADMM").prepare(problem).solve(Stop(1e-6)).impulses
    assert found == pytest.approx([3.0, -0.2, 0.1, -0.7, 2.0, -4.0, 1.0, -0.3, 0.0], abs=1e-4)


def test_units_of_mass_and_length_change_nothing() -> None:
    posed = load("funnel-30")
    copy = in_units(posed, mass=2.0**-20, length=2.0**-10).problem
    counts = [create("KaminoPADMM").prepare(one).solve(Stop(1e-4)).iterations for one in (posed, copy)]
    assert counts[0] == counts[1]


def test_a_second_solve_gives_the_same_bits() -> None:
    prepared = create("KaminoPADMM").prepare(load("funnel-30"))
    first, second = (prepared.solve(Stop(1e-4)).impulses for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_the_iterations_of_all_rounds_are_counted() -> None:
    solution = create("KaminoPADMM").prepare(load("funnel-30")).solve(Stop(1e-12, max_iterations=150))
    assert (solution.status, solution.iterations) == (Status.ITERATION_LIMIT, 150)


def test_a_problem_without_rows_is_solved() -> None:
    empty = ContactProblem.from_delassus(np.zeros((0, 0)), np.zeros(0), 0.5)
    assert create("KaminoPADMM").prepare(empty).solve(Stop(1e-6)).status is Status.SOLVED


@pytest.mark.parametrize(
    ("problem", "reason"),
    [("funnel-planar-30", "the laws are planar friction, unilateral"), ("funnel-1000", "rows, and the dense factors")],
)
def test_other_problems_are_declined_with_the_reason(problem: str, reason: str) -> None:
    assert reason in (create("KaminoPADMM").supports(load(problem)) or "")


@pytest.mark.parametrize(
    ("options", "words"), [("penalty=0.0", "penalty must be positive"), ("acceleration=2", "must be True or False")]
)
def test_options_out_of_range_are_refused(options: str, words: str) -> None:
    with pytest.raises(SolverError, match=words):
        create(f"KaminoPADMM({options})")


@pytest.mark.slow
def test_it_passes_the_conformance_tests_but_for_hard_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its kernels are compiled for each size of problem, and hard cases have many sizes."""
    monkeypatch.setattr("proxbench.bench.conformance.run.CHECKS", {"solver": BRIEF_CHECKS})
    assert all(subject["passed"] for subject in run_checks("KaminoPADMM"))
