"""``proxbench info``, ``import`` and ``export``: tables, files without loss of data, and one sentence for a mistake."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from handmade_fclib import W, local_data, rolling_data, write_data
from proxbench.bench.cli.main import run_command
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.problems import load, read_fclib, save_problem

SHIPPED = Path(__file__).parents[2] / "problems" / "exchange" / "fclib" / "files"
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two valid files, one of them in a subfolder, and two broken ones."""
    made = tmp_path / "library"
    (made / "deep").mkdir(parents=True)
    shutil.copy(SHIPPED / "local-rows.hdf5", made)
    shutil.copy(SHIPPED / "global-triplets.hdf5", made / "deep")
    (made / "cut.hdf5").write_bytes((SHIPPED / "local-rows.hdf5").read_bytes()[:3000])
    (made / "text.h5").write_text("no HDF5")
    return made


def test_info_shows_a_line_for_each_file_and_a_reason_for_each_broken_one(folder: Path, capsys: Capture) -> None:
    assert run_command(["info", str(folder)]) == 1
    printed = capsys.readouterr()
    lines = printed.out.splitlines()
    heads = [
        "form",
        "contacts",
        "joints",
        "rows",
        "rank",
        "μ",
        "μ_r",
        "[m]",
        "asymmetry",
        "cond.",
        "guesses",
        "solution",
        "file",
    ]
    assert lines[0].split() == heads
    assert lines[1].split()[:9] == ["factors", "2", "0", "6", "6", "0.25…0.5", "–", "0", "1"]
    assert lines[2].split()[:9] == ["G", "2", "0", "6", "6", "0.25…0.5", "–", "0", "1"]
    assert [line.startswith("proxbench: ") for line in printed.err.splitlines()] == [True, True]
    assert "cut.hdf5 is damaged or not an FCLIB file" in printed.err
    assert run_command(["info", "--json", str(SHIPPED / "global-rows.hdf5")]) == 0
    (row,) = json.loads(capsys.readouterr().out)["files"]
    assert (row["contacts"], row["dofs"], row["rank"], row["friction"]) == (2, 6, 6, [0.25, 0.5])


@pytest.mark.parametrize("command", ["info", "import plain --output out"])
def test_a_named_file_that_is_broken_does_not_hide_the_others(
    command: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("good.npz", G=np.eye(3), c=np.ones(3), mu=0.5)
    np.savez("bad.npz", G=np.full((3, 3), np.nan), c=np.ones(3), mu=0.5)
    assert run_command([*command.split(), "bad.npz", "good.npz"]) == 2
    printed = capsys.readouterr()
    assert "good.npz" in printed.out
    assert printed.err == "proxbench: bad.npz: G[0, 0] = nan must be finite.\n"


def test_info_counts_joints_and_shows_rolling_friction(tmp_path: Path, capsys: Capture) -> None:
    assert run_command(["info", str(write_data(tmp_path / "p.hdf5", rolling_data()))]) == 0
    assert capsys.readouterr().out.splitlines()[1].split()[:7] == ["factors", "2", "1", "11", "10", "0.5", "0.125…0.25"]


def test_json_has_no_infinity_for_a_singular_block(tmp_path: Path, capsys: Capture) -> None:
    path = write_data(tmp_path / "p.hdf5", local_data(matrix=np.diag([1.0, 1.0, 0.0, 1.0, 1.0, 1.0])))
    assert run_command(["info", "--json", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "Infinity" not in printed
    assert json.loads(printed)["files"][0]["conditioning"] is None


def test_import_preserves_the_folder_structure_and_lists_broken_files(
    folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    out = tmp_path / "out"
    assert run_command(["import", "fclib", str(folder), "--output", str(out)]) == 1
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 2
    made = sorted(file.relative_to(out) for file in out.rglob("*") if file.is_file())
    assert made == [Path("deep/global-triplets.npz"), Path("local-rows.npz")]
    for file, source in zip(made, ("deep/global-triplets.hdf5", "local-rows.hdf5"), strict=True):
        assert load(out / file).digest == read_fclib(folder / source).digest
        assert re.search(rf"{out / file} +problem digest {load(out / file).digest[:16]}", printed.out)


@pytest.mark.slow
def test_exported_problem_can_be_imported_and_run(tmp_path: Path, capsys: Capture) -> None:
    there, back = tmp_path / "there.hdf5", tmp_path / "back.npz"
    assert run_command(["export", "fclib", "hard-sticking-box", "--output", str(there)]) == 0
    assert run_command(["import", "fclib", str(there), "--output", str(back)]) == 0
    assert load(back).digest == load("hard-sticking-box").digest
    capsys.readouterr()
    line = (
        f"run --problem {there} --solver SORprox --tolerance 1e-2 --output {tmp_path} --run-id one --quiet --no-charts"
    )
    assert run_command(line.split()) == 0
    assert run_command(f"matrix --problem {there} --solver SORprox --tolerance 1e-4".split()) == 0
    assert "there" in capsys.readouterr().out


def test_a_problem_with_the_name_of_a_path_is_exported_under_the_name_of_its_file(tmp_path: Path) -> None:
    save_problem(load("hard-sticking-box").renamed("../../elsewhere"), tmp_path / "deep" / "mine.npz")
    assert run_command(["export", "fclib", f"{tmp_path}/deep/mine.npz", "--output", f"{tmp_path}/deep/out"]) == 0
    assert {file.name for file in tmp_path.rglob("*.hdf5")} == {"mine.hdf5"}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("info none.hdf5", "there is no problem file none.hdf5"),
        (
            "info funnel-100",
            "funnel-100 is a problem by name, not a file; show it by: proxbench list problems funnel-100",
        ),
        ("info {folder}/cut.hdf5", "cut.hdf5 is damaged or not an FCLIB file"),
        ("info {folder}/deep/../empty", "empty"),
        ("import nosuch {folder}", "'nosuch'"),
        ("info", "FILE|FOLDER"),
        ("import fclib {folder}/text.h5", "text.h5 is damaged or not an FCLIB file"),
        ("import fclib {folder} --output all.npz", "is one file for 4 problems"),
        ("import fclib {folder}/local-rows.hdf5 {folder}/other/local-rows.hdf5", "would both be written to"),
        ("import fclib {folder}/crooked.hdf5", "crooked.hdf5 --symmetry lower"),
        ("import fclib {folder}/local-rows.hdf5 --symmetry twist", "--symmetry 'twist' is unknown"),
        ("import fclib {folder}/local-rows.hdf5 --output taken.npz", "taken.npz exists already"),
        (
            "import fclib {folder}/local-rows.hdf5 --output y.txt",
            "y.txt is neither a .npz file nor a folder that exists",
        ),
        ("import fclib {folder}/local-rows.hdf5 --output y.json", "y.json is neither a .npz file"),
        (
            "export json hard-sticking-box --output y.npz",
            "name a file that ends in .json, or a folder without a suffix",
        ),
        ("export fclib no-such-problem", "'no-such-problem'"),
        ("export fclib hard-sticking-box hard-tresca-joint --output out", "fixed friction bound"),
        ("export fclib hard-sticking-box --output taken.hdf5", "taken.hdf5 exists already"),
        ("export fclib hard-sticking-box funnel-100 --output all.hdf5", "is one file for 2 problems"),
        ("run --problem none.hdf5", "there is no problem file none.hdf5"),
        ("record {folder}/cut.hdf5 --solver NSGS --output a.rrd", "cut.hdf5 is damaged or not an FCLIB file"),
    ],
)
def test_errors_are_reported_in_one_sentence_with_exit_code_2_and_write_nothing(
    line: str, words: str, folder: Path, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "crooked" in line:
        crooked = W.copy()
        crooked[0, 1] = 0.3
        write_data(folder / "crooked.hdf5", local_data(matrix=crooked))
    if "other" in line:
        (folder / "other").mkdir()
        shutil.copy(SHIPPED / "local-rows.hdf5", folder / "other")
    if "empty" in line:
        (folder / "empty").mkdir()
    here = tmp_path / "here"
    here.mkdir()
    for name in ("taken.npz", "taken.hdf5"):
        (here / name).write_text("mine")
    monkeypatch.chdir(here)
    assert run_command(line.format(folder=folder).split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("proxbench: ")
    assert printed.err.count("\n") == 1
    assert words in printed.err
    assert {file.name: file.read_text() for file in here.iterdir()} == {"taken.npz": "mine", "taken.hdf5": "mine"}


def test_an_existing_file_is_replaced_with_force(tmp_path: Path) -> None:
    target = tmp_path / "p.npz"
    target.write_text("old")
    assert run_command(["import", "fclib", str(SHIPPED / "local-rows.hdf5"), "--output", str(target), "--force"]) == 0
    assert load(target).n_contacts == 2


def test_a_file_of_another_program_is_imported_by_the_name_of_its_format(tmp_path: Path, capsys: Capture) -> None:
    np.savez(tmp_path / "cube.npz", G=np.eye(3), g=np.array([0.0, 0.0, -1.0]), mus=np.array([0.5]))
    assert run_command(f"import contactbench {tmp_path}/cube.npz --output {tmp_path}/ours.npz".split()) == 0
    assert load(tmp_path / "ours.npz").name == "cube"
    assert run_command(f"import kamino {tmp_path}/cube.npz --output {tmp_path}/no.npz".split()) == 2
    error = capsys.readouterr().err
    assert "is not a file of the format 'kamino', which has D and v_f; its arrays are G, g, mus, as in" in error
    assert error.endswith("the format 'contactbench'.\n")


@pytest.mark.parametrize("name", ["existing.d", "version-1.2", "plain"])
def test_a_folder_may_have_a_dot_in_its_name(name: str, tmp_path: Path) -> None:
    if name == "existing.d":
        (tmp_path / name).mkdir()
    assert run_command(["export", "json", "hard-sticking-box", "--output", str(tmp_path / name)]) == 0
    assert [file.name for file in (tmp_path / name).iterdir()] == ["hard-sticking-box.json"]


def test_a_file_of_rigid_bodies_that_is_named_plain_gets_the_name_of_its_format(
    tmp_path: Path, capsys: Capture
) -> None:
    vectors = {name: np.zeros((1, 3)) for name in ("inertia", "position", "velocity", "angular_velocity")}
    np.savez(tmp_path / "step.npz", mass=np.ones(1), mu=np.array(0.5), **vectors)
    assert run_command(f"import plain {tmp_path}/step.npz --output {tmp_path}/no.npz".split()) == 2
    error = capsys.readouterr().err
    assert "step.npz is not a file of the format 'plain', which has c, mu, and G or W; its arrays are" in error
    assert error.endswith("velocity, as in the format 'bodies'.\n")


def test_problem_round_trips_through_json(tmp_path: Path) -> None:
    assert run_command(f"export json funnel-30 --output {tmp_path}".split()) == 0
    assert load(tmp_path / "funnel-30.json").digest == load("funnel-30").digest


def test_info_shows_the_residual_of_stored_impulses(tmp_path: Path, capsys: Capture) -> None:
    arrays = {"G": np.eye(3), "c": np.array([-1.0, 0.0, 0.0]), "mu": np.array([0.5])}
    np.savez(tmp_path / "p.npz", **arrays, impulses=np.array([0.5, 0.0, 0.0]))
    assert run_command(["info", str(tmp_path / "p.npz")]) == 0
    assert capsys.readouterr().out.splitlines()[1].split()[-2] == "5.0e-01"


@pytest.mark.slow
def test_quiet_commands_print_only_the_paths_of_their_files(tmp_path: Path, capsys: Capture) -> None:
    problem, exported = tmp_path / "made" / "funnel-30.npz", tmp_path / "hard.json"
    assert run_command(["generate", "funnel-30", "--output", str(problem.parent), "--quiet"]) == 0
    assert capsys.readouterr() == (f"{problem}\n", "")
    assert run_command(["export", "json", "hard-groove", "--output", str(exported), "--quiet"]) == 0
    assert capsys.readouterr() == (f"{exported}\n", "")
    imported = tmp_path / "copy.npz"
    assert run_command(["import", "plain", str(problem), "--output", str(imported), "--quiet"]) == 0
    assert capsys.readouterr() == (f"{imported}\n", "")


def test_info_on_a_simulation_suggests_the_report_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "ball.npz"
    simulate(make_simulation_plan("bouncing_ball", duration=0.05), file)
    assert run_command(["info", str(file)]) == 2
    assert f"holds a simulation, not a problem; show it by: proxbench report {file}" in capsys.readouterr().err
