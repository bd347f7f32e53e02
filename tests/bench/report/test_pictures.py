"""Pictures are refused before any work, and one that fails costs nothing but itself."""

from pathlib import Path

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.report.pictures import drawn, picture_files, refuse_pictures


@pytest.mark.parametrize("name", ["a", "a.svg", "a.png", "a.SVG"])
def test_a_picture_has_two_files_whatever_its_ending(name: str) -> None:
    assert picture_files(Path("there", name)) == (Path("there/a.svg"), Path("there/a.png"))


def test_another_ending_is_part_of_the_name() -> None:
    assert picture_files(Path("step-1e-3.5")) == (Path("step-1e-3.5.svg"), Path("step-1e-3.5.png"))


@pytest.mark.parametrize("suffix", [".pdf", ".PDF", ".jpg", ".jpeg", ".gif", ".eps", ".html", ".webp", ".tif", ".bmp"])
def test_another_format_is_refused(suffix: str, tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=rf"charts are written as \.svg and \.png, not as \{suffix}; leave"):
        refuse_pictures(tmp_path / f"a{suffix}", force=True)


@pytest.mark.parametrize("name", ["", ".", "..", "there/..", "/"])
def test_what_names_no_file_is_refused(name: str) -> None:
    with pytest.raises(BenchError, match="name a file"):
        picture_files(Path(name))


@pytest.mark.parametrize("taken", ["a.svg", "a.png"])
def test_a_picture_that_exists_is_refused_unless_it_may_be_replaced(taken: str, tmp_path: Path) -> None:
    (tmp_path / taken).write_text("mine")
    with pytest.raises(BenchError, match=rf"{taken} exists already; .*--force"):
        refuse_pictures(tmp_path / "a", force=False)
    refuse_pictures(tmp_path / "a", force=True)
    assert (tmp_path / taken).read_text() == "mine"


def test_what_cannot_be_written_is_refused_and_what_can_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    (tmp_path / "folder.svg").mkdir()
    for name in ("plain/a", "plain/deeper/a", "folder", "a" * 300):
        with pytest.raises(BenchError, match=r"cannot write .* choose another place"):
            refuse_pictures(tmp_path / name, force=True)
    refuse_pictures(tmp_path / "new" / "deeper" / "a", force=False)
    assert {path.name for path in tmp_path.iterdir()} == {"plain", "folder.svg"}


@pytest.mark.parametrize("error", [BenchError("no space left."), ValueError("no\nspace left"), MemoryError()])
def test_a_drawing_that_fails_says_where_the_result_is(error: Exception) -> None:
    def draw() -> list[Path]:
        raise error

    with pytest.raises(BenchError, match=r"^a\.npz is kept, but its chart is missing: .*--resume a\.npz") as caught:
        drawn(draw, Path("a.npz"))
    assert "\n" not in str(caught.value)
    assert caught.value.__cause__ is error
