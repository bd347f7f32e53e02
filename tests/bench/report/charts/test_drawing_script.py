"""The script that draws charts is bundled once, and again if its stored file is damaged or cannot be written."""

from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest
import vl_convert
from proxbench.bench.report.charts.drawing_script import drawing_script


class Bundler:
    """A substitute for the bundling library that counts its calls."""

    calls = 0

    def __call__(self, program: str) -> str:
        self.calls += 1
        return f"// µ\r\n{program}\n"


@pytest.fixture
def bundler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bundler]:
    counted = Bundler()
    monkeypatch.setattr(vl_convert, "javascript_bundle", counted)
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path / "cache"))
    drawing_script.cache_clear()
    yield counted
    drawing_script.cache_clear()


def asked_again() -> str:
    """Return the script as another process would get it."""
    drawing_script.cache_clear()
    return drawing_script()


def test_another_process_reads_the_same_script_from_the_cache_folder(bundler: Bundler) -> None:
    assert drawing_script() == asked_again() == bundler("window.vegaEmbed = vegaEmbed;")
    assert bundler.calls == 2  # the second call is the one in the line above


@pytest.mark.parametrize("spoiled", [b"", b"// 1\nalert(1);", b"\xff\xfe"])
def test_a_damaged_file_is_written_again(spoiled: bytes, bundler: Bundler, tmp_path: Path) -> None:
    script = drawing_script()
    (file,) = (path for path in tmp_path.rglob("*") if path.is_file())
    whole = file.read_bytes()
    file.write_bytes(spoiled)
    assert asked_again() == script
    assert file.read_bytes() == whole
    assert bundler.calls == 2


def test_a_shortened_file_is_written_again(bundler: Bundler, tmp_path: Path) -> None:
    script = drawing_script()
    (file,) = (path for path in tmp_path.rglob("*") if path.is_file())
    file.write_bytes(file.read_bytes()[:-1])
    assert asked_again() == script
    assert bundler.calls == 2


def test_new_library_version_rebuilds_the_bundle(bundler: Bundler, monkeypatch: pytest.MonkeyPatch) -> None:
    drawing_script()
    monkeypatch.setattr(metadata, "version", lambda name: "0.0")
    asked_again()
    assert bundler.calls == 2


def test_charts_are_drawn_without_a_writable_cache_folder(bundler: Bundler, tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("not a folder")
    assert asked_again() == asked_again()
    assert bundler.calls == 2
