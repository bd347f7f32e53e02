"""A bundle is the same for the same content, and one that was made or changed by others is refused by name."""

import io
import json
import stat
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from proxbench.bench.errors import BenchError
from proxbench.bench.store.bundles import archive as archive_file
from proxbench.bench.store.bundles.archive import read_members, write_members

MEMBERS = {"run.json": b"{}", "cases/a--b.json": b"[1]", f"problems/{'0' * 64}.npz": bytes(range(256))}


def entry(name: str, kind: int = stat.S_IFREG) -> zipfile.ZipInfo:
    made = zipfile.ZipInfo("x" * len(name))
    made.filename = name  # past what the constructor would tidy up
    made.external_attr = (kind | 0o644) << 16
    return made


def with_member(path: Path, *entries: tuple[zipfile.ZipInfo, bytes]) -> Path:
    write_members(path, MEMBERS)
    with zipfile.ZipFile(path, "a") as archive:
        for one, content in entries:
            archive.writestr(one, content)
    return path


def test_what_is_written_is_read_and_equal_content_gives_equal_files(tmp_path: Path) -> None:
    write_members(tmp_path / "a", MEMBERS)
    write_members(tmp_path / "deep" / "b", dict(reversed(MEMBERS.items())))
    assert read_members(tmp_path / "a") == MEMBERS
    assert (tmp_path / "a").read_bytes() == (tmp_path / "deep" / "b").read_bytes()


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("/etc/passwd", "leads out of it"),
        ("../run.json", "leads out of it"),
        ("cases/../../x.json", "leads out of it"),
        ("cases\\..\\x.json", "leads out of it"),
        ("C:/x.json", "leads out of it"),
        ("\\\\host\\x.json", "leads out of it"),
        ("cases/deep/x.json", "is no file of a run"),
        ("cases/x.py", "is no file of a run"),
        ("cases/.hidden.json", "is no file of a run"),
        ("problems/x.npz", "is no file of a run"),
        ("cases/", "is no file of a run"),
        ("cases/\x1b]0;x\x07.json", "is no file of a run"),
        ("run.json", "stands in it twice"),
        ("manifest.json", "stands in it twice"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_member_that_no_bundle_has_is_refused_by_name(name: str, reason: str, tmp_path: Path) -> None:
    path = with_member(tmp_path / "odd", (entry(name), b"{}"))
    with pytest.raises(BenchError, match=reason) as refused:
        read_members(path)
    assert str(refused.value).isprintable()
    assert [file.name for file in tmp_path.iterdir()] == ["odd"]


@pytest.mark.parametrize(
    ("kind", "reason"), [(stat.S_IFLNK, "is a link"), (stat.S_IFIFO, "is no plain file"), (stat.S_IFDIR, "no plain")]
)
def test_a_member_that_is_no_plain_file_is_refused(kind: int, reason: str, tmp_path: Path) -> None:
    path = with_member(tmp_path / "odd", (entry("cases/x--y.json", kind), b"/etc/passwd"))
    with pytest.raises(BenchError, match=reason):
        read_members(path)


def test_sizes_beyond_limits_are_refused_before_anything_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bomb = entry("cases/x--y.json")
    bomb.compress_type = zipfile.ZIP_DEFLATED
    path = with_member(tmp_path / "bomb", (bomb, bytes(2**24)))
    assert path.stat().st_size < 2**16
    monkeypatch.setattr(zipfile.ZipFile, "read", None)
    monkeypatch.setattr(archive_file, "MAX_FILE_BYTES", 2**23)
    with pytest.raises(BenchError, match=r"'cases/x--y.json' would take 16 MB"):
        read_members(path)
    monkeypatch.setattr(archive_file, "LARGEST", 2**23)
    with pytest.raises(BenchError, match="unpacked it would take 16 MB"):
        read_members(path)


def test_a_member_that_is_larger_than_it_says_gives_no_more_than_it_says(tmp_path: Path) -> None:
    big = entry("cases/x--y.json")
    big.compress_type = zipfile.ZIP_DEFLATED
    path = with_member(tmp_path / "liar", (big, bytes(2**20)))
    content = path.read_bytes()
    path.write_bytes(content.replace(struct.pack("<L", 2**20), struct.pack("<L", 10)))
    with pytest.raises(BenchError, match="is damaged or no bundle"):
        read_members(path)


def test_a_directory_that_is_too_large_to_read_is_refused(tmp_path: Path) -> None:
    write_members(tmp_path / "a", MEMBERS)
    content = bytearray((tmp_path / "a").read_bytes())
    content[-10:-6] = struct.pack("<L", 2**31)
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(BenchError, match="is damaged or no bundle"):
        read_members(tmp_path / "a")


def changed_manifest(path: Path, change: Callable[[dict[str, object]], object]) -> Path:
    write_members(path, MEMBERS)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    manifest = json.loads(members["manifest.json"])
    members["manifest.json"] = json.dumps(change(manifest) or manifest).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda manifest: manifest.update(bundle=2), "is a bundle of version 2, this is version 1; pack the run"),
        (lambda manifest: manifest.update(bundle="1"), "manifest.json makes no sense"),
        (lambda manifest: [1], "manifest.json makes no sense"),
        (lambda manifest: manifest["files"].update({"run.json": "0"}), "the checksum of run.json does not match"),
        (lambda manifest: manifest["files"].pop("run.json") and None, "it has, beside what it lists, 'run.json'"),
        (lambda manifest: manifest["files"].update({"cases/c.json": ""}), "it misses 'cases/c.json'"),
    ],
)
def test_a_manifest_that_is_about_something_else_is_refused(
    change: Callable[[dict[str, object]], object], reason: str, tmp_path: Path
) -> None:
    with pytest.raises(BenchError, match=reason):
        read_members(changed_manifest(tmp_path / "a", change))


@pytest.mark.parametrize("content", [b"", b"PK", b"hello", b"\x1f\x8b" * 100, b"PK\5\6" + bytes(18)])
def test_a_file_that_is_no_bundle_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(BenchError, match="no bundle"):
        read_members(tmp_path / "a")
    with pytest.raises(BenchError, match="is a folder and no bundle"):
        read_members(tmp_path)
    with pytest.raises(BenchError, match="there is no bundle"):
        read_members(tmp_path / "b")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
def test_a_changed_byte_is_found_or_changes_nothing(place: float, flip: int, tmp_path: Path) -> None:
    write_members(tmp_path / "a", MEMBERS)
    content = bytearray((tmp_path / "a").read_bytes())
    content[int(place * len(content))] ^= flip
    (tmp_path / "a").write_bytes(content)
    try:
        found = read_members(tmp_path / "a")
    except BenchError:
        found = MEMBERS
    assert found == MEMBERS


def test_a_bundle_that_could_not_be_read_again_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive_file, "LARGEST", 10)
    with pytest.raises(BenchError, match="more than a bundle holds"):
        write_members(tmp_path / "a", MEMBERS)
    assert list(tmp_path.iterdir()) == []


def test_the_manifest_comes_first(tmp_path: Path) -> None:
    write_members(tmp_path / "a", MEMBERS)
    assert zipfile.ZipFile(io.BytesIO((tmp_path / "a").read_bytes())).namelist()[0] == "manifest.json"
