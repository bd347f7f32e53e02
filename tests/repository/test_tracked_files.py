"""Files in version control are finished and small."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAX_FILE_BYTES = 1_000_000
"""Largest size of a tracked file [bytes]; larger data are generated, or belong elsewhere."""
MAX_RUN_BYTES = 3_000_000
"""Largest size of a bundle [bytes], which contains the impulses from which a run is rejudged."""
MERGE_MARKER = re.compile(r"^(?:<{7}.*|>{7}.*|={7})$", re.MULTILINE)


@pytest.fixture(scope="module")
def tracked() -> list[Path]:
    """Return the existing files in version control; skip in an unpacked source distribution, and without git."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("this is no git checkout, or git is not installed")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [path for name in listed.split("\0") if name and (path := ROOT / name).is_file()]


def merge_markers(text: str) -> list[str]:
    """Return the conflict markers of a merge, and headings that look like them."""
    return MERGE_MARKER.findall(text.replace("\r\n", "\n"))


def test_no_merge_marker_is_left(tracked: list[Path]) -> None:
    left = {}
    for path in tracked:
        content = path.read_bytes()
        if b"\0" in content:
            continue
        markers = merge_markers(content.decode("utf-8", errors="replace"))
        if markers:
            left[str(path.relative_to(ROOT))] = markers
    assert left == {}


def test_no_file_is_larger_than_a_megabyte(tracked: list[Path]) -> None:
    sizes = {str(path.relative_to(ROOT)): path.stat().st_size for path in tracked}
    allowed = {name: MAX_RUN_BYTES if name.endswith(".bundle") else MAX_FILE_BYTES for name in sizes}
    assert {name: size for name, size in sizes.items() if size > allowed[name]} == {}


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_the_three_markers_of_a_conflict_are_found_wherever_they_stand(newline: str) -> None:
    markers = ["<" * 7 + " HEAD", "=" * 7, ">" * 7 + " branch"]
    assert merge_markers(newline.join([markers[0], "ours", markers[1], "theirs", markers[2]])) == markers


def test_lines_that_resemble_merge_markers_are_accepted() -> None:
    assert merge_markers("======\n========\n>>> 1\n  =======\na =======\n<<<<<<") == []
