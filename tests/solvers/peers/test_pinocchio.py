"""Pinocchio's solvers reach the judged residual that they claim."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest
from proxbench.bench import run
from proxbench.bench.conformance.run import run_checks
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.transformations import in_units
from proxbench.solvers import SolverError, Status, Stop, create

pytest.importorskip("pinocchio", reason="the extra peers is not installed")

SOLVERS = ["PinocchioADMM", "PinocchioADMM(anderson=5, lanczos=10)", "PinocchioPGS", "PinocchioPGS(relaxation=1.5)"]

BEST = SOLVERS[1]


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("problem", ["hard-sticking-box", "hard-duplicated-slider", "funnel-30", "funnel-100"])
def test_the_judge_confirms_solutions_under_coulomb_friction(name: str, problem: str) -> None:
    posed = load(problem)
    solution = create(name).prepare(posed).solve(Stop(1e-6, max_seconds=60.0))
    assert solution.status is Status.SOLVED
    assert judge(posed, solution.impulses).residual <= 1e-6


@pytest.mark.parametrize("name", SOLVERS[:3])  # over-relaxed sweeps cycle here, as those of SORprox do
def test_impulses_are_those_of_another_method_where_they_are_unique(name: str) -> None:
    posed = ContactProblem.from_delassus(np.diag([1.0, 2.0, 3.0]) + 0.1, (-1.0, 0.5, -0.2), 0.4)
    known = create("NSGS").prepare(posed).solve(Stop(1e-13)).impulses
    found = create(name).prepare(posed).solve(Stop(1e-11)).impulses
    np.testing.assert_allclose(found, known, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", SOLVERS)
def test_units_of_mass_and_length_change_nothing(name: str) -> None:
    posed = load("funnel-30")
    counts = [
        create(name).prepare(one).solve(Stop(1e-4)).iterations
        for one in (posed, in_units(posed, mass=2.0**-20, length=2.0**-10).problem)
    ]
    assert counts[0] == counts[1]


@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (
            "funnel-planar-30",
            "only contacts with spatial Coulomb friction, but the laws are planar friction, unilateral",
        ),
        ("funnel-frictionless-30", "only contacts with spatial Coulomb friction"),
        ("hard-tresca-joint", "Pinocchio"),
    ],
)
def test_other_laws_are_declined_with_the_reason(problem: str, reason: str) -> None:
    for name in SOLVERS:
        assert reason in (create(name).supports(load(problem)) or "")


def test_more_contacts_than_the_usual_stack_holds_are_solved() -> None:
    posed = load("funnel-300")
    assert posed.n_contacts > 341
    before = threading.stack_size()
    solution = create(BEST).prepare(posed).solve(Stop(1e-4))
    assert solution.status is Status.SOLVED
    assert threading.stack_size() == before


def test_the_time_limit_holds_on_thousands_of_rows_and_leaves_an_iterate() -> None:
    posed = load("funnel-1000")
    prepared, began = create("PinocchioADMM").prepare(posed), time.perf_counter()
    solution = prepared.solve(Stop(1e-10, 100_000, 0.5))
    assert time.perf_counter() - began < 5.0
    assert solution.status is Status.TIME_LIMIT
    assert solution.iterations > 0
    assert judge(posed, solution.impulses).residual < 0.1


@pytest.mark.parametrize("name", SOLVERS)
def test_a_start_that_solves_is_kept(name: str) -> None:
    posed = load("funnel-30")
    known = create("SORprox").prepare(posed).solve(Stop(1e-9)).impulses
    solution = create(name).prepare(posed).solve(Stop(1e-6), start=known)
    assert (solution.status, solution.iterations) == (Status.SOLVED, 0)
    np.testing.assert_array_equal(solution.impulses, known)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("PinocchioADMM(anderson=-1)", "anderson must be an integer, 0 or more"),
        ("PinocchioADMM(update='fast')", "update must be one of constant, linear, osqp, spectral"),
        ("PinocchioPGS(relaxation=2.0)", "relaxation must be between 0 and 2"),
    ],
)
def test_options_out_of_range_are_refused(name: str, words: str) -> None:
    with pytest.raises(SolverError, match=words):
        create(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [BEST, "PinocchioPGS(relaxation=1.5)"])
def test_external_solvers_pass_the_conformance_tests(name: str) -> None:
    assert all(subject["passed"] for subject in run_checks(name))


def test_a_run_measures_external_and_built_in_solvers(tmp_path: Path) -> None:
    made = run("funnel-30", ["SORprox", BEST], results=tmp_path, tolerances=1e-4, passes=1, solve_seconds=5.0)
    assert (made.points["outcome"] == Outcome.SOLVED).all()
