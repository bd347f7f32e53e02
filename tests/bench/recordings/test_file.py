"""A recording file is complete or absent, and never replaces another file."""

from pathlib import Path

import pytest
import rerun as rr
import rerun.blueprint as rrb
from proxbench.bench.errors import BenchError
from proxbench.bench.recordings.file import RecordingFile


def record_something(path: Path, force: bool = False, fail: bool = False) -> None:
    with RecordingFile(path, force) as recording:
        stream = recording.begin("solve", "a title", rrb.Blueprint(rrb.TimeSeriesView(origin="/")))
        stream.log("value", rr.Scalars([1.0]), static=True)
        if fail:
            raise RuntimeError("half-way")


def test_the_finished_file_stands_alone_in_its_folder(tmp_path: Path) -> None:
    record_something(tmp_path / "new" / "a.rrd")
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["a.rrd"]


def test_an_existing_file_is_refused_and_stays_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "a.rrd"
    file.write_text("precious")
    with pytest.raises(BenchError, match=r"exists.*force=True"):
        RecordingFile(file)
    assert file.read_text() == "precious"
    record_something(file, force=True)
    assert file.read_bytes()[:2] == b"RR"


@pytest.mark.parametrize("existing", [True, False])
def test_an_error_leaves_what_was_there_before(tmp_path: Path, existing: bool) -> None:
    file = tmp_path / "a.rrd"
    if existing:
        file.write_text("precious")
    with pytest.raises(RuntimeError, match="half-way"):
        record_something(file, force=True, fail=True)
    assert [path.name for path in tmp_path.iterdir()] == (["a.rrd"] if existing else [])
    assert not existing or file.read_text() == "precious"


def test_a_recording_that_was_never_begun_leaves_nothing(tmp_path: Path) -> None:
    with RecordingFile(tmp_path / "a.rrd"):
        pass
    assert list(tmp_path.iterdir()) == []


def begin_and_be_overtaken(recording: RecordingFile) -> None:
    recording.begin("solve", "a title", rrb.Blueprint(rrb.TimeSeriesView(origin="/")))
    recording.path.write_text("precious")


def test_a_file_that_appears_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "a.rrd"
    with pytest.raises(BenchError, match="exists"), RecordingFile(file) as recording:
        begin_and_be_overtaken(recording)
    assert file.read_text() == "precious"
    assert [path.name for path in tmp_path.iterdir()] == ["a.rrd"]


def test_impossible_path_is_rejected_immediately(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.rrd").mkdir()
    for path, words in (
        (tmp_path / "a.mp4", r"must end in \.rrd"),
        (tmp_path / "folder.rrd", "is a folder"),
        (tmp_path / "file" / "a.rrd", "cannot write"),
    ):
        with pytest.raises(BenchError, match=words):
            RecordingFile(path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.rrd"]
