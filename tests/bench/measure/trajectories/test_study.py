"""A study is a run: errors fall with the order of the method; results are stored, shown in tables and resumed."""

import io
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from proxbench.bench import Run, load, resume, study
from proxbench.bench.errors import BenchError, InterruptedRunError
from proxbench.bench.measure.execution.events import Event, PointFinished
from proxbench.bench.measure.trajectories import problems, task
from proxbench.bench.report.studies import print_points
from proxbench.bench.store.frames import read_frames
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.problems.motion.scenes.woodpecker import PERIOD
from proxbench.problems.motion.trajectories.pour import ENERGY, HEIGHT
from proxbench.problems.motion.trajectories.problem import Aggregates, TrajectoryProblem
from proxbench.solvers import create
from rich.console import Console

pytestmark = pytest.mark.slow

SLIDING: dict[str, Any] = {
    "scene": "sliding_sphere",
    "duration": 0.02,
    "members": (0.9, 1.0, 1.1),
    "methods": {"Moreau with SORprox": (4e-3, 2e-3, 1e-3), "SORprox in Moreau(step=1e-3)": (1e-2, 1e-6)},
}
"""Arguments of a study that takes one or two seconds."""


@pytest.fixture(scope="module")
def pour(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Return a study of fifteen balls."""
    return study(
        "funnel(balls=15, outlet=3.0)",
        results=tmp_path_factory.mktemp("pour"),
        duration=0.2,
        members=(0, 1),
        methods={"Moreau with SORprox": (8e-3, 4e-3), "SORprox in Moreau(step=8e-3)": (1e-4,)},
        tolerance=1e-4,
    )


def point(run: Run, solver: str, value: float) -> "pd.Series[Any]":
    """Return a point of a study of one problem."""
    points = run.points
    return points[(points["solver"] == solver) & (points["tolerance"] == value)].iloc[0]


def test_the_position_of_a_bouncing_ball_converges_with_first_order(tmp_path: Path) -> None:
    """An impact is found up to one step late, which delays the following flight by as much."""
    steps = (8e-3, 1e-3)
    run = study(
        "bouncing_ball", results=tmp_path, duration=0.7, methods={"Moreau with SORprox": steps}, tolerance=1e-10
    )
    coarse, fine = run.points["residual"]
    assert 0.5 < np.log(coarse / fine) / np.log(steps[0] / steps[1]) < 1.6
    assert (run.errors["low"] <= run.errors["error"]).all()
    assert (run.errors["error"] <= run.errors["high"]).all()


@pytest.mark.weekly
def test_errors_of_the_woodpecker_fall_with_first_order_and_with_the_tolerance_of_a_variable_step(
    tmp_path: Path,
) -> None:
    exponents = (3, 5, 7)
    ladders = {
        "Moreau with SORprox": (PERIOD / 200, PERIOD / 1600),
        "Extrapolated with SORprox": [10.0**-k for k in exponents],
    }
    run = study("woodpecker", results=tmp_path, methods=ladders)
    of_solvers = {str(solver): list(points["residual"]) for solver, points in run.points.groupby("solver")}
    coarse, fine = of_solvers["Moreau with SORprox"]
    assert 0.5 < np.log(coarse / fine) / np.log(8) < 1.6
    errors = of_solvers["Extrapolated with SORprox"]
    assert all(finer < 0.2 * coarser for coarser, finer in pairwise(errors))
    assert errors[-1] < 1e-6
    assert point(run, "Moreau with SORprox", PERIOD / 200)["iterations"] == 200


@pytest.mark.weekly
def test_aggregates_of_a_pour_are_compared_seed_by_seed_with_a_finer_step(pour: Run) -> None:
    (trajectory,) = pour.info.plan.trajectories
    assert [one.member for one in trajectory.known] == [0.0, 1.0]
    spreads = Aggregates({one.member: one.values for one in trajectory.known}).spreads()
    assert set(spreads) == set(pour.errors["quantity"]) == {"flow rate", HEIGHT, ENERGY}
    assert all(spreads[quantity][1] > 0.0 for quantity in (HEIGHT, ENERGY))
    energy = pour.errors[pour.errors["quantity"] == ENERGY].set_index(["solver", "tolerance"])["error"]
    assert 0.0 < energy["Moreau with SORprox", 4e-3] < energy["Moreau with SORprox", 8e-3] < 1.0
    coarse, fine = (point(pour, "Moreau with SORprox", size)["iterations"] for size in (8e-3, 4e-3))
    assert 1.8 * coarse < fine
    worst = pour.errors.groupby(["solver", "tolerance"])["error"].max()
    assert (pour.points.set_index(["solver", "tolerance"])["residual"].sort_index() == worst.sort_index()).all()


def test_the_same_setting_has_the_same_error_whatever_varies(pour: Run) -> None:
    first, second = (
        point(pour, *at) for at in (("Moreau with SORprox", 8e-3), ("SORprox in Moreau(step=0.008)", 1e-4))
    )
    assert first["residual"] == second["residual"]
    assert first["iterations"] == second["iterations"]


def test_a_study_reports_tables_points_and_charts_as_a_run_does(pour: Run) -> None:
    made = pour.report()
    assert {file.name for file in made.tables} == {
        f"{n}.{k}" for n in ("results", "points") for k in ("csv", "parquet", "md", "tex")
    }
    assert len(made.summary) == len(pour.errors) == 9
    assert [file.suffix for file in made.charts] == [".svg", ".png"]
    drawn = made.charts[0].read_text(encoding="utf-8")
    assert "one-step solves" in drawn
    assert all(f"error of {quantity}" in drawn for quantity in ("flow rate", HEIGHT, ENERGY))
    least = made.results.set_index("solver")["time_to_1e-01"]
    assert least.isna().all() == (pour.points["residual"] > 1e-1).all()
    assert "2 methods" in pour._repr_html_()


@pytest.mark.parametrize(("boxes", "is_crowded"), [(15, False), (40, True)])
def test_points_count_the_steps_whose_projection_leaves_overlaps(boxes: int, is_crowded: bool, tmp_path: Path) -> None:
    """Three passes do not separate forty boxes that fall onto each other; fifteen boxes hardly touch."""
    methods = {"Moreau with SORprox": (0.03, 0.01)}
    found = study(f"hopper(n_boxes={boxes})", results=tmp_path, duration=0.2, members=(1.0,), methods=methods)
    assert (found.points["overlapping_steps"] > 0).tolist() == [is_crowded, is_crowded]
    console = Console(file=io.StringIO(), width=200)
    print_points(read_frames(found.folder), found.info.plan.trajectories[0], console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    for step in methods["Moreau with SORprox"]:
        assert (f"Moreau with SORprox at {step:g}: bodies overlap too deeply after" in text) is is_crowded


def test_resuming_measures_only_what_is_left_after_the_last_point(tmp_path: Path) -> None:
    events: list[Event] = []

    def stop(event: Event) -> None:
        events.append(event)
        if sum(isinstance(one, PointFinished) for one in events) == 3:
            raise KeyboardInterrupt

    with pytest.raises(InterruptedRunError) as caught:
        study(**SLIDING, results=tmp_path, on_event=stop)
    begun = load(caught.value.run_dir)
    assert not begun.is_finished
    assert (begun.n_finished, len(begun.points)) == (0, 3)
    events.clear()
    done = begun.resume(on_event=events.append)
    assert done.is_finished
    measured = [(event.solver, event.tolerance) for event in events if isinstance(event, PointFinished)]
    assert measured == [("SORprox in Moreau(step=0.001)", 1e-6), ("Moreau with SORprox", 1e-3)]
    again = study(**SLIDING, results=tmp_path, run_id="again").points.set_index(["solver", "tolerance"])
    numbers = ["residual", "iterations", "unsolved_steps", "failed_members", "repeats"]
    pd.testing.assert_frame_equal(done.points.set_index(["solver", "tolerance"])[numbers], again[numbers])
    kept = begun.points.set_index(["solver", "tolerance"])
    assert (
        done.points.set_index(["solver", "tolerance"]).loc[kept.index, "total_seconds"] == kept["total_seconds"]
    ).all()


def test_points_of_a_changed_problem_are_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = study(**SLIDING, results=tmp_path).folder
    events: list[Event] = []
    resume(folder, on_event=events.append)
    assert not any(isinstance(event, PointFinished) for event in events)
    monkeypatch.setattr(TrajectoryProblem, "digest", property(lambda problem: "another"))
    resume(folder, on_event=events.append)
    assert sum(isinstance(event, PointFinished) for event in events) == 5


def test_a_reference_is_kept_as_far_as_it_is_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulated: list[float] = []
    simulate = problems._with_member

    def counted(record: Any, method: Any, worker: Any, member: float) -> Any:
        if len(simulated) == 1:
            simulated.append(-1.0)
            raise KeyboardInterrupt
        simulated.append(member)
        return simulate(record, method, worker, member)

    monkeypatch.setattr(problems, "_with_member", counted)
    wanted: dict[str, Any] = {"duration": 0.05, "members": (0, 1, 2), "methods": {"Moreau with SORprox": (8e-3,)}}
    with pytest.raises(InterruptedRunError) as caught:
        study("pile(balls=5)", results=tmp_path, **wanted)
    assert load(caught.value.run_dir).resume().is_finished
    assert simulated == [0.0, -1.0, 1.0, 2.0]


def test_a_simulation_that_takes_too_many_steps_is_given_up_and_reports_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(task.TrajectoryTask, "max_solves", 300)
    monkeypatch.setattr(task.TrajectoryTask.__init__, "__defaults__", (300,))
    run = study("woodpecker", results=tmp_path, members=[1.0], methods={"Extrapolated with SORprox": (1e-2, 1e-7)})
    good, given_up = run.points.to_dict("records")
    assert good["outcome"] == Outcome.SOLVED
    assert given_up["outcome"] == Outcome.ITERATION_LIMIT
    assert given_up["reason"].startswith("given up after 300 one-step solves, at ")
    assert np.isinf(given_up["residual"])
    assert given_up["failed_members"] == 1
    assert len(run.errors) == 1


def test_expired_time_limit_ends_the_ladder(tmp_path: Path) -> None:
    limits = Limits(solve_seconds=1.0, case_seconds=60.0)
    ladder = {"Moreau with SORprox": (1e-1, 1e-5, 1e-6)}
    run = study("sliding_sphere", results=tmp_path, methods=ladder, limits=limits)
    assert run.points["outcome"].tolist() == [Outcome.SOLVED, Outcome.TIME_LIMIT, Outcome.NOT_ATTEMPTED]
    assert "1e-05 already took longer than 1 s" in run.points["reason"].iloc[-1]


def test_a_solver_that_cannot_treat_a_step_is_unsupported(tmp_path: Path) -> None:
    methods = {"Moreau with SORprox": (0.1,)}
    run = study("sliding_sphere", create("Enumeration"), tmp_path, methods=methods, members=[1.0])
    outcomes = run.cases.set_index("solver")["outcome"]
    assert outcomes["Moreau with SORprox"] == Outcome.MEASURED
    (other,) = outcomes.drop("Moreau with SORprox")
    assert other == Outcome.UNSUPPORTED
    assert "friction" in run.cases["reason"].iloc[-1]


def test_existing_folder_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").write_text("mine")
    with pytest.raises(BenchError, match="exists already"):
        study(**SLIDING, results=tmp_path, run_id="mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["file"] or (tmp_path / "mine" / "cases").is_dir()
