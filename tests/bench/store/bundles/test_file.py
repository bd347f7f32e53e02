"""An invalid or changed bundle is refused in one sentence, and is never unpacked beyond the size limit."""

import gzip
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from proxbench.bench.errors import BenchError
from proxbench.bench.store.bundles import bundle as bundle_file
from proxbench.bench.store.bundles.bundle import Bundle, read_bundle, write_bundle


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "is not a bundle; name a file"),
        (b"hello", "is not a bundle; name a file"),
        (b"PK\5\6" + bytes(18), "is not a bundle; name a file"),
        (gzip.compress(b"{}", mtime=0)[:-1], "is damaged .the compressed data are damaged"),
        (gzip.compress(b"{}", mtime=0) + b"x", "the compressed data are damaged"),
        (gzip.compress(b"hello", mtime=0), "it is not JSON"),
        (gzip.compress(b"[" * 200_000, mtime=0), "it is not JSON"),
        (gzip.compress(b"[]", mtime=0), "its checksum does not match"),
        (gzip.compress(b"{}", mtime=0), "its checksum does not match"),
    ],
)
def test_a_file_that_is_not_a_bundle_is_refused_with_the_reason(content: bytes, reason: str, tmp_path: Path) -> None:
    (tmp_path / "a.bundle").write_bytes(content)
    with pytest.raises(BenchError, match=reason) as refused:
        read_bundle(tmp_path / "a.bundle")
    assert str(refused.value).isprintable()


def test_a_path_that_is_not_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="is a folder, not a bundle"):
        read_bundle(tmp_path)
    with pytest.raises(BenchError, match="there is no bundle"):
        read_bundle(tmp_path / "b")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=30)
@given(place=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
def test_a_changed_byte_is_found_or_changes_nothing(
    place: float, flip: int, file: Path, honest: Bundle, tmp_path: Path
) -> None:
    content = bytearray(file.read_bytes())
    content[int(place * len(content))] ^= flip
    (tmp_path / "a").write_bytes(content)
    try:
        found = read_bundle(tmp_path / "a")
    except BenchError:
        return
    assert (found.run, found.cases) == (honest.run, honest.cases)


def test_another_version_is_refused(honest: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("proxbench.bench.store.conversion.FORMAT", 99)
    write_bundle(honest, tmp_path / "new.bundle")
    monkeypatch.undo()
    with pytest.raises(BenchError, match=r"new\.bundle has format 99, and this version reads format 3"):
        read_bundle(tmp_path / "new.bundle")


def test_no_more_than_the_limit_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bomb.bundle").write_bytes(gzip.compress(bytes(2**26)))
    monkeypatch.setattr(bundle_file, "MAX_BYTES", 2**16)
    tracemalloc.start()
    with pytest.raises(BenchError, match=f"the data exceed {2**16} bytes"):
        read_bundle(tmp_path / "bomb.bundle")
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2**22


def test_a_bundle_that_could_not_be_read_again_is_not_written(
    honest: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bundle_file, "MAX_BYTES", 10)
    with pytest.raises(BenchError, match="too large for a bundle"):
        write_bundle(honest, tmp_path / "a.bundle")
    assert list(tmp_path.iterdir()) == []
