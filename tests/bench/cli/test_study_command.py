"""``proxbench simulate --study``: mistakes get one sentence; a study is started, resumed and reported like a run."""

import io
import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from proxbench.bench import load, study
from proxbench.bench.cli.main import run_command
from proxbench.bench.cli.progress import RunProgress
from proxbench.bench.measure.execution.events import Event, PointFinished, ProblemStarted, RunStarted
from proxbench.bench.measure.trajectories import defaults
from proxbench.bench.report.studies import motion_warning
from rich.console import Console
from simulated_runs import store_run
from stored_cases import case_record


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished study of one short motion."""
    ladder, results = {"Moreau with SORprox": (2e-3, 1e-3)}, tmp_path_factory.mktemp("results")
    return study("sliding_sphere", results=results, run_id="it", duration=0.01, members=[1.0], methods=ladder).folder


@pytest.fixture
def folder(finished: Path, tmp_path: Path) -> Path:
    """A copy of the study that may be changed."""
    return Path(shutil.copytree(finished, tmp_path / "it"))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--study", "name a scene"),
        ("funel --study", "'funnel'"),
        ("woodpecker --study --stepper Moreau(step=1e-4)", "--stepper"),
        ("funnel --study --tolerance 1e-4", "--tolerance"),
        ("funnel(balls=0) --study", "balls"),
        ("funnel --study --duration 1e-9", "step of Moreau"),
        ("funnel --study --recording a.rrd", "--recording"),
        ("funnel --study --chart a", "--chart"),
        ("funnel --study --force", "--force"),
        ("funnel --study --states 5", "--states is for a single simulation"),
        ("funnel --study --step-seconds 3", "--step-seconds is for a single simulation"),
        ("funnel --study --output a.json", "name a folder"),
        ("funnel --study --case-seconds 0", "--case-seconds must be positive and finite, got 0; omit it"),
        ("funnel --study --solver SORprx", "'SORprox'"),
        ("funnel --study --start hot", "there is no start 'hot'"),
        ("funnel --solver SORprox --solver Jprox", "one solver"),
        ("funnel --solve-seconds 3", "--solve-seconds limits a study"),
        ("--study --resume nowhere.npz", "is not a study; omit --study"),
        ("--study --quiet --json funnel", "are mutually exclusive"),
    ],
)
def test_errors_are_reported_in_one_sentence_and_leave_no_file(
    line: str, words: str, mistake: Callable[[str], str]
) -> None:
    assert words in mistake(f"simulate {line}")


@pytest.mark.slow
def test_a_study_is_a_run_in_a_folder_with_tables_and_charts(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    little = {
        "STEPS": (10, 20),
        "FIXED_STEPS": 10,
        "STEPPERS": {"Extrapolated": (3,)},
        "SOLVERS": ("NSGS",),
        "TOLERANCES": (1e-8,),
    }
    for name, value in little.items():
        monkeypatch.setattr(defaults, name, value)
    line = f"simulate sliding_sphere --study --duration 0.002 --solver Jprox --output {tmp_path} --no-progress --json"
    assert run_command(line.split()) == 0
    document = json.loads(capsys.readouterr().out)
    (folder,) = tmp_path.iterdir()
    assert folder.name.startswith("sliding_sphere-study-")
    assert document["run"] == str(folder)
    assert document["is_finished"]
    solvers = {row["solver"] for row in document["results"]}
    assert {"Moreau with SORprox", "Extrapolated with SORprox"} <= solvers
    assert any(solver.startswith("Jprox in Extrapolated") for solver in solvers)
    assert {path.name for path in folder.iterdir()} == {"run.json", "cases", "tables", "charts"}


@pytest.mark.slow
@pytest.mark.parametrize("line", ["report {}", "run --resume {} --no-progress", "simulate --resume {} --no-progress"])
def test_commands_that_show_runs_show_studies(line: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {file: file.read_bytes() for file in (folder / "cases").iterdir()}
    assert run_command(line.format(folder).split()) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "sliding_sphere · 0.01 s · warm starts · error of the last position" in printed
    assert {"Moreau", "with", "SORprox"} <= set(printed.split())  # a narrow table wraps names at spaces
    assert "least median time of a simulation, to that error" in printed
    assert (folder / "tables" / "points.csv").is_file()
    assert (folder / "charts" / "sliding_sphere.svg").is_file()
    assert {file: file.read_bytes() for file in (folder / "cases").iterdir()} == before


@pytest.mark.slow
def test_what_is_stored_with_a_study_cannot_be_changed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for given in ("--duration 3", "--solver NSGS", "--case-seconds 9", "--start cold", "woodpecker"):
        assert run_command(f"simulate --resume {folder} {given}".split()) == 2
        assert "is stored with the study and cannot be changed" in capsys.readouterr().err


@pytest.mark.slow
def test_a_damaged_curve_is_measured_again(folder: Path) -> None:
    (file,) = (folder / "cases").iterdir()
    file.write_bytes(file.read_bytes()[:-40])
    assert not load(folder).is_finished
    assert run_command(f"run --resume {folder} --retry-failed --no-progress --quiet".split()) == 0
    assert load(folder).is_finished


def test_a_run_over_contact_problems_is_no_simulation_to_resume(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = store_run(tmp_path / "run", [case_record()])
    before = sorted(folder.rglob("*"))
    assert run_command(f"simulate --resume {folder} --no-progress".split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "is a run over contact problems, not a simulation" in printed.err
    assert f"proxbench run --resume {folder}" in printed.err
    assert printed.err.count("\n") == 1
    assert sorted(folder.rglob("*")) == before


@pytest.mark.slow
def test_a_study_in_which_nothing_moves_warns(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    ladder = {"Moreau with SORprox": (2e-3,)}
    for scene, moves in (("stack", False), ("sliding_sphere", True)):
        made = study(scene, results=tmp_path, duration=0.01, members=[1.0], methods=ladder)
        assert run_command(["report", str(made.folder), "--no-charts"]) == 0
        assert ("changes within 0.01 s, so errors" in " ".join(capsys.readouterr().out.split())) is not moves


@pytest.mark.slow
def test_a_motion_that_returns_to_its_start_is_no_rest(tmp_path: Path) -> None:
    """A ball that falls 1 m and bounces without loss is back after twice the time of the fall."""
    scene, back = "bouncing_ball(restitution=0.999999999)", 2.0 * math.sqrt(2.0 / 9.81)
    made = study(scene, results=tmp_path, duration=back, members=[1.0], methods={"Moreau with SORprox": (2e-3,)})
    (trajectory,) = made.info.plan.trajectories
    assert trajectory.displacement == pytest.approx(1.0, rel=0.02)
    assert trajectory.scale == pytest.approx(0.1)
    assert not motion_warning(trajectory)


@pytest.mark.parametrize("hidden", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_study_in_which_nothing_moves_warns_before_anything_is_measured(hidden: bool, tmp_path: Path) -> None:
    text, printed = io.StringIO(), []
    with RunProgress(hidden, Console(file=text, width=80)) as shown:

        def on_event(event: Event) -> None:
            shown(event)
            if isinstance(event, ProblemStarted):
                printed.append("no coordinate of stack changes within 0.01 s" in text.getvalue())

        methods = {"Moreau with SORprox": (2e-3,)}
        study("stack", results=tmp_path, duration=0.01, members=[1.0], methods=methods, on_event=on_event)
    assert printed == [True]
    assert text.getvalue().count("no coordinate of stack changes") == 1


@pytest.mark.slow
def test_a_study_says_what_it_has_to_do_and_counts_its_points(tmp_path: Path) -> None:
    events: list[Event] = []
    ladder = {"Moreau with SORprox": (2e-3, 1e-3), "Extrapolated with SORprox": (1e-3,)}
    study("sliding_sphere", results=tmp_path, duration=0.01, members=[1.0, 2.0], methods=ladder, on_event=events.append)
    started = events[0]
    assert isinstance(started, RunStarted)
    assert started.points == sum(isinstance(event, PointFinished) for event in events) == 3
    assert started.work == "3 points, 6 simulations"
