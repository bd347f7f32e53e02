"""Invalid names are refused before any work, files get default permissions, and a failed picture loses no result."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.report.layout.output_file import check_pictures_writable, draw_pictures, output_file, picture_files
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.problems.exchange.files.atomic_file import replacing


@pytest.fixture(params=[0o022, 0o077], ids=oct)
def mask(request: pytest.FixtureRequest) -> Iterator[int]:
    """Set the umask of this process."""
    wanted = int(request.param)
    before = os.umask(wanted)
    yield wanted
    assert os.umask(before) == wanted


def written_simulation(file: Path) -> None:
    simulate(make_simulation_plan("woodpecker", stepper="Moreau(step=1e-3)", duration=1e-3), file)


def test_results_have_the_permissions_of_any_new_file(mask: int, tmp_path: Path) -> None:
    written_simulation(tmp_path / "a.npz")
    assert stat.S_IMODE((tmp_path / "a.npz").stat().st_mode) == 0o666 & ~mask


def test_a_replaced_result_has_the_permissions_of_any_new_file(mask: int, tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"old")
    file.chmod(0o600)
    with replacing(file) as opened:
        opened.write(b"new")
    assert stat.S_IMODE(file.stat().st_mode) == 0o666 & ~mask
    assert file.read_bytes() == b"new"


@pytest.mark.parametrize("name", ["a.npz", "x.txt", "runs-1.5", "a.json.gz"])
def test_an_output_with_another_suffix_is_refused_and_makes_nothing(name: str, tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"ends in \.\w+, but this result is a \.json file; name a file"):
        output_file(tmp_path / name, "pile", ".json", force=True)
    assert not list(tmp_path.iterdir())


def test_a_folder_may_have_any_name_if_it_exists(tmp_path: Path) -> None:
    folder = tmp_path / "runs-1.5"
    folder.mkdir()
    assert output_file(folder, "pile", ".npz", force=False).parent == folder
    assert output_file(tmp_path / "new" / "runs", "pile", ".npz", force=False).parent == tmp_path / "new" / "runs"
    assert output_file(tmp_path / "a.npz", "pile", ".npz", force=False) == tmp_path / "a.npz"


@pytest.mark.parametrize("name", ["a", "a.svg", "a.png", "a.SVG"])
def test_a_picture_has_two_files_whatever_its_ending(name: str) -> None:
    assert picture_files(Path("there", name)) == (Path("there/a.svg"), Path("there/a.png"))


def test_another_ending_is_part_of_the_name() -> None:
    assert picture_files(Path("step-1e-3.5")) == (Path("step-1e-3.5.svg"), Path("step-1e-3.5.png"))


@pytest.mark.parametrize("suffix", [".pdf", ".PDF", ".jpg", ".jpeg", ".gif", ".eps", ".html", ".webp", ".tif", ".bmp"])
def test_another_format_is_refused(suffix: str, tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=rf"charts are written as \.svg and \.png, not as \{suffix}; leave"):
        check_pictures_writable(tmp_path / f"a{suffix}", force=True)


@pytest.mark.parametrize("name", ["", ".", "..", "there/..", "/"])
def test_an_output_path_without_a_file_name_is_refused(name: str) -> None:
    with pytest.raises(BenchError, match="name a file"):
        picture_files(Path(name))


@pytest.mark.parametrize("taken", ["a.svg", "a.png"])
def test_a_picture_that_exists_is_refused_unless_it_may_be_replaced(taken: str, tmp_path: Path) -> None:
    (tmp_path / taken).write_text("mine")
    with pytest.raises(BenchError, match=rf"{taken} exists already; .*force=True"):
        check_pictures_writable(tmp_path / "a", force=False)
    check_pictures_writable(tmp_path / "a", force=True)
    assert (tmp_path / taken).read_text() == "mine"


def test_unwritable_outputs_are_rejected_and_the_check_leaves_no_file(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    (tmp_path / "folder.svg").mkdir()
    for name in ("plain/a", "plain/deeper/a", "folder", "a" * 300):
        with pytest.raises(BenchError, match=r"cannot write .* choose another folder"):
            check_pictures_writable(tmp_path / name, force=True)
    check_pictures_writable(tmp_path / "new" / "deeper" / "a", force=False)
    assert {path.name for path in tmp_path.iterdir()} == {"plain", "folder.svg"}


@pytest.mark.parametrize("error", [BenchError("no space left."), ValueError("no\nspace left"), MemoryError()])
def test_failed_drawing_reports_where_the_result_is_kept(error: Exception) -> None:
    def draw() -> list[Path]:
        raise error

    with pytest.raises(BenchError, match=r"^a\.npz is kept, but its chart is missing: .*--resume a\.npz") as caught:
        draw_pictures(draw, Path("a.npz"))
    assert "\n" not in str(caught.value)
    assert caught.value.__cause__ is error
