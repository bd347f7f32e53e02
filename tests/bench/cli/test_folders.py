"""A folder is measured like a suite: readable files are measured, and unreadable ones are reported with the reason."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from proxbench.bench import load, run
from proxbench.bench.cli.main import run_command
from proxbench.problems import ContactProblem, save_problem, write_fclib

LADDER = "--solver SORprox --tolerance 1e-2 --passes 1 --no-charts --no-progress"


def box(weight: float) -> ContactProblem:
    return ContactProblem.from_delassus(np.eye(3), (-weight, 0.5, 0.0), 0.3)


def collection(folder: Path, boxes: int, rocks: int) -> Path:
    """A folder of boxes (.npz) and rocks (.hdf5), and three broken files."""
    folder.mkdir()
    for number in range(boxes):
        save_problem(box(1.0 + number), folder / f"boxes-{number}.npz")
    for number in range(rocks):
        write_fclib(box(1.0 + number), folder / f"rocks-{number}.hdf5")
    (folder / "boxes-damaged.npz").write_bytes(b"no zip")
    (folder / "boxes-empty.npz").write_bytes(b"")
    (folder / "rocks-cut.hdf5").write_bytes((folder / "rocks-0.hdf5").read_bytes()[:3000])
    return folder


def check_run(folder: Path, results: Path, captured: pytest.CaptureFixture[str], count: int) -> None:
    """Run a folder with three broken files; check that they are named, in a report too, and the others measured."""
    line = f"run --suite {folder} --output {results} --run-id it {LADDER}"
    for command in (line.split(), ["report", str(results / "it"), "--no-charts"]):
        assert run_command(command) == 1
        printed = captured.readouterr()
        broken = [sentence for sentence in printed.err.splitlines() if str(folder) in sentence]
        assert [Path(sentence.split()[1]).name for sentence in broken] == [
            "boxes-damaged.npz",
            "boxes-empty.npz",
            "rocks-cut.hdf5",
        ]
        assert all(sentence.startswith("proxbench: ") and sentence.endswith(".") for sentence in broken)
        assert f"all {count} problems of {folder.name}" in printed.out
        assert "by family, to 1e-02" in printed.out
    made = load(results / "it")
    assert (len(made.cases), len(made.info.carried)) == (count, count)
    failed = made.cases[made.cases["outcome"] != "measured"]
    assert failed[["problem", "outcome", "reason"]].to_numpy().tolist() == []


@pytest.mark.weekly
def test_broken_files_of_a_folder_are_listed_and_the_others_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    check_run(collection(tmp_path / "mine", 3, 2), tmp_path / "results", capsys, 5)
    table = pd.read_csv(tmp_path / "results" / "it" / "tables" / "results.csv")
    assert table["family"].tolist() == ["boxes"] * 3 + ["rocks"] * 2


@pytest.mark.slow
def test_a_run_of_a_folder_is_finished_where_the_folder_is_gone(tmp_path: Path) -> None:
    folder = collection(tmp_path / "mine", 2, 1)
    made = run(suite=folder, solvers="SORprox", results=tmp_path, tolerances=1e-2, passes=1, sample=3, seed=1)
    shutil.rmtree(folder)
    next((made.folder / "cases").iterdir()).unlink()
    again = load(made).resume()
    assert again.is_finished
    assert again.info.plan == made.info.plan
    assert again.problem("boxes-1").digest == box(2.0).digest


@pytest.mark.slow
def test_one_problem_of_a_run_can_be_printed(finished_run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["report", str(finished_run), "--problem", "hard-immovable"]) == 1
    printed = capsys.readouterr().out
    assert "hard-immovable · " in printed
    assert "funnel-30" not in printed
    assert run_command(["report", str(finished_run), "--problem", "funnel-30", "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert [row["problem"] for row in document["problems"]] == ["funnel-30"]
    assert {row["solver"] for row in document["results"]} == set(load(finished_run).info.plan.solvers)


@pytest.mark.slow
def test_matrix_accepts_a_folder_of_problems(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = collection(tmp_path / "mine", 1, 1)
    assert run_command(f"matrix --suite {folder} --solver SORprox --no-progress".split()) == 1
    printed = capsys.readouterr()
    assert "2 problems, 1 solver, 2 cells" in printed.out
    assert printed.err.count("proxbench: ") == 3


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("run --suite no/folder", "there is no folder no/folder"),
        ("run --suite /dev", "there is no problem in /dev"),
        ("run --suite all --sample 0", "--sample must be at least 1, got 0; omit it to take all problems."),
        ("run --resume here --sample 3", "--sample is stored with the run"),
        ("report here.npz --problem funnel-30", "--problem applies to runs, but here.npz is a simulation"),
        ("report here --problem funnel-30 --quiet", "--problem and --quiet are mutually exclusive"),
    ],
)
def test_errors_are_reported_in_one_sentence(line: str, words: str, mistake: Callable[[str], str]) -> None:
    assert words in mistake(line)
