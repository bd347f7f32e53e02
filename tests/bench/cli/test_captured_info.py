"""``proxbench info`` of captured steps: the engine's forces judged in its own model and under Coulomb's law."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.bench.cli.main import run_command
from proxbench.problems import ContactProblem, save_problem
from proxbench.problems.capture import mujoco_import
from proxbench.problems.capture.files import has_step, read_step, save_step
from proxbench.problems.capture.step import CapturedStep
from proxbench.problems.engine_model import EngineModel, EngineSet

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A contact that its engine regularises: half the impulse of Coulomb's law solves the model of the engine."""
    monkeypatch.setattr(mujoco_import, "find_spec", lambda name: None)  # captured files need no engine
    forces = np.array([0.5, 0.0, 0.0])
    engine = EngineModel(
        matrix=sp.csr_array(np.eye(3)),
        regularisation=np.ones(3),
        offset=np.array([-1.0, 0.0, 0.0]),
        scale=1.0,
        kind=np.array([EngineSet.ELLIPTIC_CONE], dtype=np.int8),
        first_row=np.array([0]),
        coefficient=np.array([1.0, 0.5, 0.5]),
        bound=np.zeros(3),
        combination=sp.csr_array(np.eye(3)),
        time_step=1.0,
        name="MuJoCo 4.0.0",
    )
    c = np.array([-1.0, 0.0, 0.0])
    problem = ContactProblem.from_delassus(np.eye(3), c, 0.5, keys=("floor | ball",), engine=engine)
    path = tmp_path / "ball-000000.npz"
    save_step(CapturedStep(problem, forces, "NEWTON", 2, np.zeros((1, 2, 3))), path)
    return path


def test_the_table_shows_both_residuals_where_a_file_has_them(file: Path, capsys: Capture) -> None:
    plain = file.with_name("plain.npz")
    save_problem(read_step(file).problem, plain)
    assert (has_step(file), has_step(plain)) == (True, False)
    assert run_command(["info", str(file), str(plain)]) == 0
    heads, captured, other, *_, legend = capsys.readouterr().out.splitlines()
    assert heads.split()[-4:] == ["own", "model", "Coulomb", "file"]
    assert captured.split()[-3:] == ["0.0e+00", "5.0e-01", str(file)]
    assert other.split()[-3:] == ["–", "–", str(plain)]
    assert legend.startswith("own model: residual of the engine's forces")
    assert run_command(["info", str(plain)]) == 0
    assert "Coulomb" not in capsys.readouterr().out


def test_json_holds_the_verdict_of_the_engine(file: Path, capsys: Capture) -> None:
    assert run_command(["info", str(file), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["files"]
    assert row["engine"] == {
        "name": "MuJoCo 4.0.0",
        "own model": 0.0,
        "Coulomb": 0.5,
        "separation": 0.0,
        "solver": "NEWTON",
        "iterations": 2,
    }


def test_file_without_captured_data_lists_no_engine(file: Path, capsys: Capture) -> None:
    save_problem(read_step(file).problem, file)
    assert run_command(["info", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"][0]["engine"] is None


def test_forces_that_are_not_finite_have_no_number_in_json_and_inf_in_the_table(file: Path, capsys: Capture) -> None:
    step = read_step(file)
    lost = np.full(3, np.nan)
    save_step(replace(step, forces=lost), file)
    assert run_command(["info", str(file)]) == 0
    assert capsys.readouterr().out.splitlines()[1].split()[-3:-1] == ["inf", "inf"]
    assert run_command(["info", str(file), "--json"]) == 0
    engine = json.loads(capsys.readouterr().out)["files"][0]["engine"]
    assert (engine["own model"], engine["Coulomb"]) == (None, None)


@pytest.mark.parametrize("damage", ["missing", "short"])
def test_damaged_capture_data_are_reported_in_one_sentence(file: Path, damage: str, capsys: Capture) -> None:
    with np.load(file) as content:
        arrays = dict(content)
    forces = arrays.pop("capture.forces")
    np.savez(file, **arrays, **({"capture.forces": forces[:-1]} if damage == "short" else {}))
    assert run_command(["info", str(file)]) == 2
    assert capsys.readouterr().err == f"proxbench: the captured data of {file} are damaged; capture it again.\n"


def test_a_file_with_the_own_model_of_an_engine_shows_both_residuals_of_its_impulses(
    tmp_path: Path, capsys: Capture
) -> None:
    """A contact of Kamino with compliance 1 carries half the impulse of a hard one."""
    path = tmp_path / "soft.npz"
    arrays = {"D": np.diag([1.0, 1.0, 2.0]), "v_f": np.array([0.0, 0.0, -1.0]), "mu": np.array([0.5])}
    np.savez(path, **arrays, compliance=np.array([0.0, 0.0, 1.0]), lambdas=np.array([0.0, 0.0, 0.5]))
    assert run_command(["info", str(path)]) == 0
    heads, row, *_ = capsys.readouterr().out.splitlines()
    assert heads.split()[-4:] == ["own", "model", "Coulomb", "file"]
    assert row.split()[-3:] == ["0.0e+00", "5.0e-01", str(path)]
    assert run_command(["info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"][0]["engine"] == {"own model": 0.0, "Coulomb": 0.5}


def test_import_keeps_the_forces_of_the_engine(file: Path, tmp_path: Path) -> None:
    target = tmp_path / "copy.npz"
    assert run_command(["import", "plain", str(file), "--output", str(target)]) == 0
    copy, step = read_step(target), read_step(file)
    assert copy.problem.digest == step.problem.digest
    assert (copy.solver, copy.iterations) == ("NEWTON", 2)
    assert copy.forces.tolist() == step.forces.tolist() == [0.5, 0.0, 0.0]
