"""``proxbench capture``: problem files, both residuals of each step, and one sentence for a mistake."""

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from proxbench.bench import load as load_run
from proxbench.bench.cli.main import run_command
from proxbench.problems.capture import mujoco_import, rows, sequence, step

BALL = """<mujoco model="ball"><option cone="elliptic"/><worldbody><geom name="floor" type="plane" size="5 5 0.1"/>
<body name="ball" pos="0 0 0.099"><freejoint/><geom name="ball" size="0.1"/></body></worldbody></mujoco>"""

HELD = '</worldbody><equality><connect name="held" body1="ball" anchor="0 0 0.1"/></equality>'


@pytest.fixture
def ball(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "ball.xml"
    file.write_text(BALL)
    return file


def test_without_mujoco_the_command_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(mujoco_import, "find_spec", lambda name: None)
    assert run_command(["capture", "model.xml"]) == 2
    assert "capturing needs MuJoCo, which is not installed; run pip install" in capsys.readouterr().err


@pytest.mark.parametrize(("n_steps", "words"), [(0, "0 steps"), (1, "1 step"), (3, "3 steps")])
def test_an_interrupted_command_says_so(
    n_steps: int, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*arguments: object, on_step: Callable[[object], None], **options: object) -> None:
        for _ in range(n_steps):
            on_step(None)
        raise KeyboardInterrupt

    monkeypatch.setattr(sequence, "capture", interrupt)
    assert run_command(["capture", "model.xml"]) == 130
    assert capsys.readouterr().err == f"proxbench: interrupted; kept {words} in captured.\n"


@pytest.mark.parametrize("more", [[], ["--judge"], ["--json"]])
def test_an_interrupted_command_counts_the_steps_that_it_keeps(
    ball: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], more: list[str]
) -> None:
    take, taken = sequence.take_step, Counter[str]()

    def interrupted(*state: object) -> None:
        taken["steps"] += 1
        if taken["steps"] == 8:
            raise KeyboardInterrupt
        take(*state)

    monkeypatch.setattr(sequence, "take_step", interrupted)
    assert run_command(["capture", str(ball), "--duration", "0.1", "--every", "3", "--output", "steps", *more]) == 130
    assert capsys.readouterr().err == "proxbench: interrupted; kept 3 steps in steps.\n"
    assert len(list(Path("steps").glob("*.npz"))) == 3


def test_the_files_make_a_suite(ball: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["capture", str(ball), "--duration", "0.02", "--every", "5", "--output", "steps"]) == 0
    printed = capsys.readouterr().out
    assert "captured  2 steps into steps, at most 2 laws" in printed
    assert "rows      6 of 6 taken" in printed
    assert "proxbench run --suite steps" in printed
    assert len(list(Path("steps").glob("*.npz"))) == 2


def test_the_command_that_measures_the_folder_can_be_copied(ball: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["capture", str(ball), "--duration", "0.01", "--output", "my steps"]) == 0
    assert "proxbench run --suite 'my steps'\n" in capsys.readouterr().out


@pytest.mark.slow
def test_run_judges_mujoco_solvers_by_the_model_of_the_captured_step_and_can_be_rejudged(
    ball: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["capture", str(ball), "--duration", "0.02", "--every", "10", "--output", "steps"]) == 0
    solvers = ("--solver", "MuJoCo", "--solver", "MuJoCo(algorithm='PGS')")
    limits = ("--tolerance", "1e-6", "--passes", "1", "--no-page", "--run-id", "mine")
    assert run_command(["run", "--suite", "steps", *solvers, *limits]) == 0
    measured = load_run("results/mine").points
    assert set(measured["outcome"]) == {"relaxed"}
    assert measured["model_residual"].max() <= 1e-6 < 1e-3 < measured["residual"].min()
    assert run_command(["bundle", "results/mine", "--output", "mine.bundle"]) == 0
    assert run_command(["rejudge", "mine.bundle"]) == 0
    assert "4 residuals, all bit-identical" in capsys.readouterr().out


def test_judged_steps_show_both_residuals(ball: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["capture", str(ball), "--duration", "0.01", "--every", "2", "--judge"]) == 0
    heads, *rows = capsys.readouterr().out.splitlines()[:4]
    assert heads.split()[4:8] == ["own", "model", "Coulomb", "separation"]
    assert [row.split()[0] for row in rows] == ["0", "2", "4"]
    assert {row.split()[8] for row in rows} == {"NEWTON"}


def test_one_document_holds_files_and_verdicts(ball: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["capture", str(ball), "--duration", "0.01", "--judge", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["files"] == ["captured/ball-000000.npz"]
    assert (found["engine_rows"], found["refused"], found["error"]) == (3, {}, None)
    assert found["steps"][0]["own model"] < 1e-10 < found["steps"][0]["Coulomb"]


def test_the_largest_error_of_the_velocity_is_printed_and_in_json(
    ball: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = iter([1e-12, 3e-10, 2e-11] * 2)
    monkeypatch.setattr(step, "_velocity_error", lambda *velocities: next(errors))
    line = ["capture", str(ball), "--duration", "0.01", "--every", "2", "--judge", "--force"]
    assert run_command(line) == 0
    assert "velocity  largest error after a step 3.0e-10, relative; 1e-09 is allowed" in capsys.readouterr().out
    assert run_command([*line, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["velocity_error"] == 3e-10


def test_json_lists_each_refused_row_with_its_step_name_and_reason(
    ball: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ball.write_text(BALL.replace("</worldbody>", HELD))
    whole = rows._norms
    monkeypatch.setattr(rows, "_norms", lambda given, jacobian: whole(given, jacobian) * (np.arange(len(given)) != 2))
    assert run_command(["capture", str(ball), "--duration", "0.01", "--every", "2", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    reason = rows.IMMOBILE
    assert found["refused"] == {reason: 3}
    listed = [{"step": step, "row": 2, "name": "equality held", "reason": reason} for step in (0, 2, 4)]
    assert found["refused_rows"] == listed


def test_a_capture_that_fails_keeps_its_steps_and_returns_1(
    ball: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    mujoco = mujoco_import.mujoco()
    step, calls = mujoco.mj_step, []

    def failing(model: object, data: object) -> None:
        calls.append(1)
        if len(calls) > 4:
            raise mujoco.FatalError("out of memory")
        step(model, data)

    monkeypatch.setattr(mujoco, "mj_step", failing)
    assert run_command(["capture", str(ball), "--every", "1"]) == 1
    printed = capsys.readouterr()
    assert "captured  2 steps into captured" in printed.out
    assert "proxbench: MuJoCo failed in the step at 0.004 s: out of memory; correct the model, or stop" in printed.err


def test_existing_steps_are_replaced_only_with_force(ball: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["capture", str(ball), "--duration", "0.01"]) == 0
    assert run_command(["capture", str(ball), "--duration", "0.01"]) == 2
    assert "choose another --output, or replace them with --force" in capsys.readouterr().err
    assert run_command(["capture", str(ball), "--duration", "0.01", "--force"]) == 0
