"""A bundle is loaded, reported and compared like the folder from which it was packed."""

import shutil
from pathlib import Path

import pandas as pd
import pytest
from proxbench.bench import Run, compare, load
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.store.outcome import FAULTS


@pytest.fixture
def copy(file: Path, tmp_path: Path) -> Path:
    """A copy of the bundle in a separate folder."""
    return Path(shutil.copy(file, tmp_path / "it.bundle"))


def test_the_frames_of_a_bundle_are_those_of_its_folder(made: Run, file: Path) -> None:
    loaded = load(file)
    assert loaded.info == made.info
    for name in ("cases", "points", "rounds", "iterations", "errors"):
        pd.testing.assert_frame_equal(getattr(loaded, name), getattr(made, name))
    for name in made.info.plan.problems:
        assert loaded.problem(name).digest == made.problem(name).digest


@pytest.mark.slow
def test_a_report_of_a_bundle_is_written_into_the_folder_of_its_name(
    made: Run, copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = copy.read_bytes()
    code = int(made.cases["outcome"].isin(FAULTS).any())
    assert run_command(["report", str(copy), "--no-charts"]) == code
    assert f"results  {copy}" in capsys.readouterr().out
    assert (copy.with_suffix("") / "tables" / "results.csv").is_file()
    assert sorted(path.name for path in copy.parent.iterdir()) == ["it", "it.bundle"]
    assert copy.read_bytes() == before


def test_a_bundle_compares_with_its_folder_and_nothing_differs(made: Run, file: Path) -> None:
    found = compare(file, made)
    assert (found.before.folder, found.after.folder) == (file, made.folder)
    assert found.changes.empty
    assert len(found.before.cases) == len(found.after.cases) == len(made.cases)


def test_a_bundle_cannot_be_resumed(file: Path) -> None:
    with pytest.raises(BenchError, match=r"it is a bundle\); unpack it with: proxbench merge"):
        load(file).resume()


def test_a_folder_that_is_named_like_a_bundle_is_loaded_as_the_run_in_it(made: Run, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(made.folder, tmp_path / "it.bundle"))
    assert load(folder).info == made.info
