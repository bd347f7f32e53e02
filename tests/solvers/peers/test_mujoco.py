"""MuJoCo's constraint solvers solve the convex program of a problem; for a captured step, that of its engine."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from proxbench.bench.measure.contacts.case_process import MeasuringTask
from proxbench.bench.measure.contacts.variants import perturbed_copy
from proxbench.bench.plugins.solver_specs import built_in
from proxbench.problems import ContactProblem, LawKind, Laws, Model, judge, load
from proxbench.problems.capture.files import read_step
from proxbench.problems.capture.sequence import CaptureOptions, capture
from proxbench.problems.capture.step import CapturedStep
from proxbench.problems.exchange.files.problem_file import problem_bytes
from proxbench.solvers import SolverError, Status, Stop, create
from proxbench.solvers.peers.mujoco_constraints import OWN_TOLERANCES, Algorithm, MuJoCo
from proxbench.solvers.peers.mujoco_problem import ConstraintStage
from proxbench.solvers.peers.mujoco_program import program_of

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

STACK = """
<mujoco><option cone="{cone}" integrator="implicitfast" iterations="100" tolerance="0"/>
<worldbody><geom type="plane" size="5 5 0.1" friction="0.5"/>
<body pos="0 0 0.099"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1" friction="0.5 0.01 0.002"/></body>
<body pos="0 0 0.298"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="10" friction="0.5" condim="4"/></body>
<body pos="0.5 0 0.3"><joint name="hinge" axis="0 1 0" damping="0.3" range="-20 20" limited="true" frictionloss="0.1"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.33" size="0.03"/></body>
</worldbody></mujoco>"""

ALGORITHMS: tuple[Algorithm, ...] = ("Newton", "CG", "PGS")


def solved(problem: ContactProblem, algorithm: Algorithm, impedance: float) -> np.ndarray:
    prepared = MuJoCo(algorithm, impedance).prepare(problem)
    return prepared.solve(Stop(1e-8, max_iterations=2000, max_seconds=10.0)).impulses


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("name", ["funnel-30", "hard-sticking-box", "hard-stack-10"])
def test_harder_contacts_come_nearer_to_the_convex_model(name: str, algorithm: Algorithm) -> None:
    problem = load(name)
    if MuJoCo().supports(problem) is not None:
        pytest.skip("unsupported")
    soft, hard = (
        judge(problem, solved(problem, algorithm, impedance), Model.CONVEX).residual for impedance in (0.95, 0.999)
    )
    assert hard < 0.05 < 3.0 * soft


def test_compliance_is_the_residual_of_one_contact() -> None:
    """With R = (1 − d)/d G the impulse is d times that of a hard contact."""
    problem = ContactProblem.from_delassus([[0.25]], [-3.0], dim=1)
    for algorithm in ALGORITHMS:
        assert solved(problem, algorithm, 0.8) == pytest.approx([0.8 * 12.0])


def test_rows_of_all_laws_are_mapped_to_the_order_of_mujoco() -> None:
    """Bilateral rows, bounded friction, and planar and spatial contacts, in another order than MuJoCo's."""
    kinds = [
        LawKind.UNILATERAL,
        LawKind.SPATIAL_FRICTION,
        LawKind.PLANAR_FRICTION,
        LawKind.UNILATERAL,
        LawKind.BILATERAL,
        LawKind.UNILATERAL,
        LawKind.PLANAR_FRICTION,
    ]
    laws = Laws.in_order(
        kinds,
        np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.3]),
        np.array([0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 0.0]),
        np.array([-1, 0, -1, -1, -1, -1, 5]),
    )
    c = np.array([-3.0, 0.2, -0.1, 5.0, -2.0, 4.0, -1.0, 9.0])
    problem = ContactProblem.from_delassus(np.eye(8), c, laws=laws)
    for algorithm in ALGORITHMS:
        found = solved(problem, algorithm, 0.999999)
        assert found[:6] == pytest.approx([3.0, -0.2, 0.1, -0.7, 2.0, -4.0], abs=1e-4)
        assert abs(found[7]) <= 0.3 * found[6] + 1e-9
        assert judge(problem, found, Model.CONVEX).residual < 1e-4


@pytest.mark.parametrize("algorithm", ["Newton", "CG"])  # PGS may stop before the solution, see docs/results-engines.md
def test_a_copy_in_other_units_with_permuted_contacts_is_solved_as_well(algorithm: Algorithm) -> None:
    copy = perturbed_copy(load("funnel-30"))
    assert judge(copy, solved(copy, algorithm, 0.999), Model.CONVEX).residual < 0.01


def test_a_residual_below_the_compliance_is_not_claimed() -> None:
    problem = load("funnel-30")
    solution = MuJoCo().prepare(problem).solve(Stop(1e-6, max_iterations=1000, max_seconds=10.0))
    assert solution.status == Status.STALLED
    assert "its own tolerance" in solution.message


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_answer_and_its_time_are_those_of_one_call_of_the_constraint_stage(
    captured: CapturedStep, algorithm: Algorithm
) -> None:
    problem = captured.problem
    prepared = MuJoCo(algorithm).prepare(problem)
    solution = prepared.solve(Stop(1e-6, max_iterations=5000, max_seconds=20.0))
    seconds = prepared.library_seconds
    stage = ConstraintStage(program_of(problem, 0.95), algorithm)
    for own in OWN_TOLERANCES:
        stage.start(np.zeros(problem.n_rows))
        alone = min(stage.run(own, 5000) for _ in range(3))
        if judge(problem, stage.impulses, Model.ENGINE).residual <= 1e-6:
            break
    assert np.array_equal(stage.impulses, solution.impulses)
    assert solution.iterations == max(stage.iterations, 1)
    assert seconds is not None
    assert 0.0 < seconds < 1.0
    assert alone < 1.0


def test_a_run_counts_the_time_of_the_constraint_stage_alone(captured: CapturedStep) -> None:
    data = problem_bytes(captured.problem)
    task = MeasuringTask(data, built_in("MuJoCo"))
    answer, _ = task.answer("round", (Stop(1e-6, max_iterations=5000, max_seconds=20.0), 0.0))
    (prepare,), (solve,), (uncounted,) = answer["prepare"], answer["solve"], answer["uncounted"]
    assert prepare == 0.0 < solve < uncounted  # judging alone takes longer than the solve
    carried = MeasuringTask(data, replace(built_in("MuJoCo"), source="a plugin"))
    answer, _ = carried.answer("round", (Stop(1e-6, max_iterations=5000, max_seconds=20.0), 0.0))
    assert answer["uncounted"] == []


def test_a_solve_ends_at_its_limits() -> None:
    prepared = MuJoCo("PGS", 0.999).prepare(load("funnel-30"))
    limited = prepared.solve(Stop(1e-12, max_iterations=3, max_seconds=10.0))
    assert (limited.status, limited.iterations) == (Status.ITERATION_LIMIT, 3)
    late = prepared.solve(Stop(1e-12, max_iterations=10**6, max_seconds=1e-9))
    assert late.status == Status.TIME_LIMIT


def test_the_same_start_gives_the_same_bits() -> None:
    prepared = MuJoCo("CG", 0.999).prepare(load("funnel-30"))
    stop = Stop(1e-3, max_iterations=200, max_seconds=10.0)
    assert np.array_equal(prepared.solve(stop).impulses, prepared.solve(stop).impulses)


def test_rolling_friction_and_large_problems_are_refused() -> None:
    laws = Laws.contacts(0.5, 3, 1).with_rolling(0.01, 1)
    rolling = ContactProblem.from_delassus(np.eye(4), np.zeros(4), laws=laws)
    assert MuJoCo().supports(rolling) == (
        "MuJoCo has one bound for sliding and rolling friction, but this problem has two"
    )
    assert "dense matrices" in str(MuJoCo().supports(load("funnel-1000")))


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(SolverError, match="algorithm"):
        create("MuJoCo", algorithm="LU")
    with pytest.raises(SolverError, match="impedance"):
        create("MuJoCo(impedance=1.0)")


@pytest.fixture(params=["elliptic", "pyramidal"])
def captured(request: pytest.FixtureRequest, tmp_path: Path) -> CapturedStep:
    """A step, read from a file, of two settling boxes and a pendulum with friction whose tip touches the floor."""
    (tmp_path / "stack.xml").write_text(STACK.format(cone=request.param))
    summary = capture(tmp_path / "stack.xml", tmp_path / "steps", CaptureOptions(duration=0.05, every=20))
    return read_step(summary.files[-1])


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_captured_step_is_solved_as_its_engine_posed_it(captured: CapturedStep, algorithm: Algorithm) -> None:
    problem = captured.problem
    solution = MuJoCo(algorithm).prepare(problem).solve(Stop(1e-8, max_iterations=5000, max_seconds=20.0))
    assert solution.status == Status.SOLVED
    assert judge(problem, solution.impulses, Model.ENGINE).residual <= 1e-8
    assert solution.impulses == pytest.approx(captured.impulses, abs=1e-5 * np.abs(captured.impulses).max())
    assert judge(problem, solution.impulses).residual > 1e-4


def test_the_solution_under_coulombs_law_does_not_solve_the_model_of_the_engine(captured: CapturedStep) -> None:
    problem = captured.problem
    solution = create("Robust").prepare(problem).solve(Stop(1e-8, max_iterations=5000, max_seconds=20.0))
    assert judge(problem, solution.impulses).residual <= 1e-8
    assert judge(problem, solution.impulses, Model.ENGINE).residual > 1e-4


def test_a_copy_of_a_captured_step_is_solved_too(captured: CapturedStep) -> None:
    copy = perturbed_copy(captured.problem)
    solution = MuJoCo("Newton").prepare(copy).solve(Stop(1e-8, max_iterations=1000, max_seconds=20.0))
    assert solution.status == Status.SOLVED
    assert judge(copy, solution.impulses, Model.ENGINE).residual <= 1e-8


def test_the_choice_of_the_impedance_does_not_change_a_captured_step(captured: CapturedStep) -> None:
    stop = Stop(1e-8, max_iterations=1000, max_seconds=20.0)
    soft, hard = (MuJoCo("Newton", d).prepare(captured.problem).solve(stop).impulses for d in (0.5, 0.999))
    assert np.array_equal(soft, hard)
