"""The last line of captured output: from which position it is read, and how much of it is shown."""

import os
from pathlib import Path

import pytest
from proxbench.solvers.native.captured_output import MAX_LINE_LENGTH, last_line, output_size


@pytest.mark.parametrize(
    ("written", "line"),
    [
        (b"", ""),
        (b"\n \n", ""),
        (b"one\ntwo\n\n  \n", "two"),
        (b"without an end", "without an end"),
        (b"a\tbell \x07 and \xff\n", "a bell \ufffd and \ufffd"),
        (b"x" * 5000 + b"\n" + b"y" * 300, "y" * MAX_LINE_LENGTH),
    ],
)
def test_only_what_was_written_since_the_start_counts(tmp_path: Path, written: bytes, line: str) -> None:
    file = tmp_path / "output"
    file.write_bytes(b"of another program\n")
    descriptor = os.open(file, os.O_RDWR | os.O_APPEND)
    start = output_size(descriptor)
    os.write(descriptor, written)
    assert last_line(descriptor, start) == line
    os.close(descriptor)


def test_unreadable_output_has_no_last_line(tmp_path: Path) -> None:
    file = tmp_path / "output"
    file.write_text("written")
    descriptor, (reading, writing) = os.open(file, os.O_WRONLY), os.pipe()
    os.write(writing, b"piped\n")
    assert [last_line(one, 0) for one in (descriptor, reading)] == ["", ""]
    for one in (descriptor, reading, writing):
        os.close(one)
    assert output_size(descriptor) == 0
    assert last_line(descriptor, 0) == ""
