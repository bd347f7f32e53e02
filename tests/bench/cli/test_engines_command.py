"""``proxbench engines``: one table per scene with the best setting in bold, its JSON data, and error messages."""

import json
from importlib import metadata
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.measure.trajectories.engines import run
from proxbench.bench.measure.trajectories.engines.engine import ENGINES
from proxbench.bench.measure.trajectories.engines.measurement import Measurement

ERRORS = {"lift [mm]": 52.4, "speed [%]": 1.5}


def measured(scene: str, engine: str, setting: str) -> Measurement:
    if setting == "200 iterations":
        return Measurement(scene=scene, engine=engine, setting=setting, time_step=0.002, failure="no | memory")
    seconds = 1e-3 if setting == "50 iterations" else 2e-3
    return Measurement(
        scene=scene,
        engine=engine,
        setting=setting,
        time_step=0.002,
        wall_seconds=seconds,
        processor_seconds=3.0 * seconds,
        errors=ERRORS,
        own_residual=1e-14,
        residual=0.2,
        solved_residual=1e-9,
    )


@pytest.fixture
def no_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {kind.distribution: f"{kind.tested_version}.7" for kind in ENGINES.values()}
    monkeypatch.setattr(metadata, "version", lambda name: versions.get(name, "1.0"))
    monkeypatch.setattr(run, "_measure_in_subprocess", measured)


@pytest.mark.usefixtures("no_processes")
def test_the_table_marks_the_best_setting_and_names_versions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "engines.md"
    assert run_command(["engines", "thrown-cube", "--engine", "pybullet", "--output", str(file)]) == 1  # one failed
    printed = capsys.readouterr()
    assert file.read_text() == printed.out.removesuffix("\n")
    assert "| pybullet | **50 iterations** | 2 | 1 | 3 | 52.4 | 1.5 | 1.0e-14 | 2.0e-01 | 1.0e-09 |" in printed.out
    assert "| pybullet | 200 iterations | 2 | – | – | – | – | – | – | no \\| memory |" in printed.out
    assert "Versions: pybullet 3.2.7. Rounds: 1." in printed.out
    assert "* pybullet: sequential impulses" in printed.out
    assert "thrown-cube: pybullet, 50 iterations: 1 ms per simulated second" in printed.err


@pytest.mark.usefixtures("no_processes")
def test_one_document_holds_all_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "engines.json"
    assert run_command(["engines", "thrown-cube", "--engine", "rapier", "--json", "--output", str(file)]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert printed.err == ""
    assert found == json.loads(file.read_text())
    assert found["versions"] == {"rapier": "0.36.7"}
    assert [run["errors"] for run in found["measurements"]] == 5 * [ERRORS]


@pytest.mark.usefixtures("no_processes")
def test_an_interrupted_comparison_keeps_its_finished_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(scene: str, engine: str, setting: str) -> Measurement:
        if setting == "Coulomb":
            raise KeyboardInterrupt
        return measured(scene, engine, setting)

    monkeypatch.setattr(run, "_measure_in_subprocess", interrupted)
    file = tmp_path / "engines.json"
    assert run_command(["engines", "thrown-cube", "--engine", "rapier", "--output", str(file)]) == 130
    printed = capsys.readouterr()
    assert "proxbench: interrupted; 2 settings measured." in printed.err
    assert "Interrupted: some runs are missing." in printed.out
    found = json.loads(file.read_text())
    assert [one["setting"] for one in found["measurements"]] == ["default", "16 iterations"]

    monkeypatch.setattr(run, "_measure_in_subprocess", measured)
    assert run_command(["engines", "thrown-cube", "--engine", "rapier", "--resume", str(file)]) == 0
    printed = capsys.readouterr()
    assert printed.err.count("per simulated second") == 3
    found = json.loads(file.read_text())
    assert len(found["measurements"]) == 5
    assert not found["is_interrupted"]


def test_without_an_engine_the_command_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    assert run_command(["engines", "stack", "--engine", "mujoco"]) == 2
    sentence = "proxbench: the engine mujoco is not installed; run pip install"
    assert capsys.readouterr().err.startswith(sentence)


def test_output_must_end_in_md_or_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["engines", "stack", "--output", "engines.csv"]) == 2
    assert "--output engines.csv must end in .md (tables) or .json (data)." in capsys.readouterr().err
