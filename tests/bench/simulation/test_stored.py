"""A result file suffices for table, chart and recording, also if its last step failed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.recordings.replay import step_ending_at
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.starts import StepSolver
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Solution, Status, Stop, create

pytestmark = pytest.mark.usefixtures("blank_pictures")

FIXED = "simulate pile(balls=20) --duration 0.16 --stepper Moreau(step=1e-3) --no-progress --states 20"
VARIABLE = "simulate woodpecker(start='cycle') --duration 0.02 --no-progress"
SOLVERS = {FIXED: "MomentumFallback", VARIABLE: "SORprox"}
"""The default solver of each command."""

both = pytest.mark.parametrize("line", [FIXED, VARIABLE], ids=["fixed", "variable"])


class Broken:
    """A prepared solver whose impulses are NaN."""

    def __init__(self, rows: int) -> None:
        self._rows = rows

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        return Solution(np.full(self._rows, np.nan), Status.SOLVED, 1)


@pytest.fixture
def failing(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Make every solver fail from its fortieth problem on."""
    prepare, calls = StepSolver.prepare, []

    def fail(solver: StepSolver, problem: Any) -> Any:
        calls.append(problem)
        if len(calls) < 40:
            return prepare(solver, problem)
        if request.param == "nan":
            return Broken(problem.n_rows)
        raise RuntimeError("no more") if request.param == "raises" else SystemExit(3)

    monkeypatch.setattr(StepSolver, "prepare", fail)
    return monkeypatch


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "failing"),
    [
        pytest.param(FIXED, "raises", id="raises-fixed"),
        pytest.param(VARIABLE, "raises", marks=pytest.mark.weekly, id="raises-variable"),
        pytest.param(FIXED, "exits", marks=pytest.mark.weekly, id="exits-fixed"),
        pytest.param(VARIABLE, "nan", marks=pytest.mark.weekly, id="nan-variable"),
    ],
    indirect=["failing"],
)
def test_a_simulation_that_fails_shows_all_it_has_and_goes_on_with_another_solver(
    line: str, failing: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, film, chart = tmp_path / "a.npz", tmp_path / "a.rrd", tmp_path / "a.svg"
    assert run_command([*line.split(), "--output", f"{file}", "--recording", f"{film}", "--chart", f"{chart}"]) == 1
    printed = capsys.readouterr()
    assert "total  " in printed.out
    assert f"failed with {SOLVERS[line]}" in printed.out
    assert printed.err.count("\n") == 1
    assert ", from t = " in printed.err
    assert f"proxbench simulate --resume {file} --solver" in printed.err
    assert film.is_file()
    assert chart.is_file()
    assert run_command(["report", str(file)]) == 1
    again = capsys.readouterr()
    assert again == printed
    assert run_command(["report", str(file), "--json"]) == 1
    assert f"failed with {SOLVERS[line]}" in json.loads(capsys.readouterr().out)["summary"]["failure"]
    failing.undo()
    films = film.read_bytes()
    assert run_command(f"simulate --resume {file} --solver SORprox(relaxation=0.9) --no-progress".split()) == 0
    assert "failed" not in capsys.readouterr().out
    assert film.read_bytes() != films
    assert run_command(["report", str(file)]) == 0


@pytest.mark.parametrize(
    "line", [pytest.param(FIXED, id="fixed"), pytest.param(VARIABLE, marks=pytest.mark.slow, id="variable")]
)
def test_a_report_prints_what_the_simulation_printed(
    line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert run_command([*line.split(), "--output", f"{tmp_path}/a.npz"]) == 0
    printed = capsys.readouterr().out
    assert run_command(["report", f"{tmp_path}/a.npz"]) == 0
    assert capsys.readouterr().out == printed


@pytest.mark.slow
@both
def test_a_quiet_report_without_charts_prints_the_place_of_the_result_and_draws_nothing(
    line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, chart = tmp_path / "a.npz", tmp_path / "a.svg"
    assert run_command([*line.split(), "--output", f"{file}", "--chart", f"{chart}"]) in (0, 1)
    chart.unlink()
    capsys.readouterr()
    run_command(["report", f"{file}", "--quiet", "--no-charts"])
    assert capsys.readouterr().out == f"result  {file}\n"
    assert not chart.exists()
    run_command(["report", f"{file}", "--quiet"])
    assert f"chart   {chart}\n" in capsys.readouterr().out
    assert chart.exists()


def test_a_report_of_steps_that_are_not_solved_is_a_failure(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = [*FIXED.split(), "--max-iterations", "1", "--tolerance", "1e-10", "--output", f"{tmp_path}/a.npz"]
    assert run_command(line) == 1
    assert run_command(["report", f"{tmp_path}/a.npz"]) == 1
    assert "not solved to 1e-10" in capsys.readouterr().out


@pytest.mark.slow
@both
def test_a_recording_is_made_of_the_result_alone(line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    assert run_command([*line.split(), "--output", str(file)]) == 0
    assert run_command(["record", str(file)]) == 0
    assert f"rerun {tmp_path}/a.rrd" in capsys.readouterr().out
    assert run_command(["record", str(file)]) == 2
    assert "--force" in capsys.readouterr().err
    assert run_command(["record", str(file), "--force", "--output", f"{tmp_path}/b.rrd"]) == 0
    assert {"a.rrd", "b.rrd"} <= {path.name for path in tmp_path.iterdir()}
    assert run_command(["record", str(file), "--solver", "SORprox", "--force"]) == 2
    assert "omit --solver" in capsys.readouterr().err


def test_a_recording_has_curves_of_all_steps_and_bodies_where_states_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from rerun.chunk import RrdReader

    assert run_command([*FIXED.split(), "--output", f"{tmp_path}/a.npz", "--recording", f"{tmp_path}/a.rrd"]) == 0
    drawn: dict[str, set[int]] = {}
    for chunk in RrdReader(tmp_path / "a.rrd").stream():
        batch = chunk.to_record_batch().to_pydict()
        drawn.setdefault(chunk.entity_path, set()).update(batch.get("step", []))
    simulation = read_simulation(tmp_path / "a.npz")
    numbers = {round(state.time / 1e-3) for state in simulation.states}
    assert drawn["/scene/bodies/0"] == numbers
    assert drawn["/curves/iterations"] == set(range(simulation.n_steps + 1))
    assert drawn["/curves/contacts/stick"] == numbers


def test_the_step_that_led_to_a_state_has_its_contacts_and_impulses(pour: Callable[..., Any]) -> None:
    plan = pour(160)
    length = plan.stepper.shortest_step(plan.scene)
    stepper = MidpointRule(plan.scene.system, create("SORprox"), Stop(1e-6, 5000), length)
    *_, last = stepper.steps(plan.scene.start, 160)
    assert last.contacts is not None
    again = step_ending_at(plan.scene.system, last.state, length)
    assert again.contacts is not None
    np.testing.assert_array_equal(again.contacts.keys, last.contacts.keys)
    np.testing.assert_array_equal(again.impulses, last.impulses)
    np.testing.assert_allclose(again.contacts.gap, last.contacts.gap, atol=1e-12)
    forces = State(last.state.time, last.state.position, last.state.velocity, last.state.keys, last.state.impulses / 5)
    np.testing.assert_allclose(
        step_ending_at(plan.scene.system, forces, plan.stepper.shortest_step(plan.scene), 5.0).impulses, last.impulses
    )


@pytest.mark.parametrize(("line", "kind"), [("report none.npz", "result file"), ("record none.npz", "file")])
def test_missing_result_file_is_reported(
    line: str, kind: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(line.split()) == 2
    assert f"there is no {kind} none.npz" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_number_of_states_out_of_range_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for scene in ("pile", "woodpecker"):
        assert run_command(f"simulate {scene} --states 0 --output {tmp_path}".split()) == 2
        assert "states must be at least 1, got 0" in capsys.readouterr().err
