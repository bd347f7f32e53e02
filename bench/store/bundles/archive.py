"""The zip file that a bundle is: written the same for the same content, and read as if an attacker had made it.

The first member, ``manifest.json``, has the version of the format and the SHA-256 of every other one. Checksums find
damage; who changes a bundle on purpose computes them anew, which is what judging again is for.
"""

import hashlib
import io
import json
import re
import stat
import struct
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import IO

import msgspec

from ....problems.exchange.atomic_file import replacing
from ...errors import BenchError
from ..fields import Record
from ..store import CASES, MAX_FILE_BYTES, PROBLEMS, RUN_FILE

FORMAT = 1
"""Version of bundles."""

LARGEST = 2**30
"""Bytes that all members of a bundle may have, unpacked."""

_MANIFEST = "manifest.json"

_MOST_MEMBERS = 2**16 - 2
"""What a directory without the extension for large files can have."""

_NAMES = re.compile(
    rf"{re.escape(RUN_FILE)}|{CASES}/[A-Za-z0-9_-][A-Za-z0-9._-]{{0,199}}\.json|{PROBLEMS}/[0-9a-f]{{64}}\.npz"
)

_END = struct.Struct("<4s4H2LH")
_END_MARK, _LARGE_MARK = b"PK\5\6", b"PK\6\7"
_LARGE_LOCATOR = 20
_LARGEST_DIRECTORY = 2**25

_UNPACKING = (zipfile.BadZipFile, zlib.error, struct.error, ValueError, LookupError, RuntimeError, EOFError)

_AGAIN = "get it again from where it comes"


class _Manifest(Record, frozen=True, kw_only=True):
    """What a bundle consists of: the SHA-256 of each member, by name."""

    bundle: int
    files: dict[str, str]


def write_members(path: Path, members: Mapping[str, bytes]) -> None:
    """Write a bundle as a whole or not at all; members that are equal give equal files.

    Raises:
        BenchError: if it cannot be written, or is larger than what can be read again.
    """
    size = sum(map(len, members.values()))
    if size > LARGEST or len(members) > _MOST_MEMBERS:
        raise BenchError(
            f"{len(members)} files of {size / 2**20:.0f} MB are more than a bundle holds; measure in several runs."
        )
    manifest = _Manifest(bundle=FORMAT, files={name: _sha256(content) for name, content in sorted(members.items())})
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in ((_MANIFEST, msgspec.json.encode(manifest)), *sorted(members.items())):
            entry = zipfile.ZipInfo(name)  # of 1980, so that equal runs are equal files
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, (stat.S_IFREG | 0o644) << 16
            archive.writestr(entry, content)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write(buffer.getbuffer())
    except OSError as error:
        raise BenchError(f"cannot write {path}: {error.strerror}; name another file.") from None


def read_members(path: Path) -> dict[str, bytes]:
    """Return what a bundle holds by the names of its files; nothing is written, and no name in it is a path here.

    Raises:
        BenchError: if it is none, of another version, damaged, or has a member that no bundle has.
    """
    try:
        if not path.is_file():
            said = f"{path} is a folder and no bundle" if path.is_dir() else f"there is no bundle {path}"
            raise BenchError(f"{said}; name a file of proxbench bundle.")
        with path.open("rb") as file:
            members = _unpacked(file, path)
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror}; name a file that can be read.") from None
    except _UNPACKING as error:
        raise BenchError(f"{path} is damaged or no bundle ({type(error).__name__}); {_AGAIN}.") from None
    _check(members, path)
    return members


def _unpacked(file: IO[bytes], path: Path) -> dict[str, bytes]:
    _check_directory(file)
    names: set[str] = set()
    with zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        size = sum(entry.file_size for entry in entries)
        if size > LARGEST:
            raise BenchError(f"{path} is refused: unpacked it would take {size / 2**20:.0f} MB; {_AGAIN}.")
        for entry in entries:
            fault = _fault(entry, names)
            if fault:
                raise BenchError(f"{path} is refused: its member {_shown(entry.orig_filename)} {fault}; {_AGAIN}.")
            names.add(entry.orig_filename)
        return {entry.filename: archive.read(entry) for entry in entries}


def _check_directory(file: IO[bytes]) -> None:
    """Raise ``ValueError`` unless the file ends as ours do, with a directory that is small enough to be read."""
    end = file.seek(0, io.SEEK_END)
    file.seek(max(end - _END.size - _LARGE_LOCATOR, 0))
    tail = file.read()
    mark, *_, size, _, comment = _END.unpack(tail[-_END.size :])
    is_large = tail[: -_END.size].endswith(_LARGE_MARK) or tail.startswith(_LARGE_MARK)
    if mark != _END_MARK or comment or is_large or size > _LARGEST_DIRECTORY:
        raise ValueError
    file.seek(0)


def _fault(entry: zipfile.ZipInfo, names: Collection[str]) -> str:
    """Return what is wrong with a member; empty if nothing is."""
    name, kind = entry.orig_filename, stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG):
        return "is a link" if kind == stat.S_IFLNK else "is no plain file"
    if name.startswith(("/", "\\")) or ".." in re.split(r"[/\\]", name) or name[1:2] == ":":
        return "leads out of it"
    if name != _MANIFEST and not _NAMES.fullmatch(name):
        return "is no file of a run"
    if name in names:
        return "stands in it twice"
    if entry.file_size > MAX_FILE_BYTES:
        return f"would take {entry.file_size / 2**20:.0f} MB"
    if entry.flag_bits & 1 or entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "is packed in a way that no bundle is"
    return ""


def _check(members: dict[str, bytes], path: Path) -> None:
    """Take the manifest away, and see that it is about the other members."""
    content = members.pop(_MANIFEST, None)
    if content is None:
        raise BenchError(f"{path} is no bundle (it has no {_MANIFEST}); name a file of proxbench bundle.")
    try:
        version = json.loads(content).get("bundle")
        if type(version) is int and version != FORMAT:
            raise BenchError(
                f"{path} is a bundle of version {version}, this is version {FORMAT}; pack the run with this version."
            )
        files = msgspec.json.decode(content, type=_Manifest).files
    except (ValueError, AttributeError, RecursionError):
        raise BenchError(f"{path} is damaged ({_MANIFEST} makes no sense); {_AGAIN}.") from None
    odd = sorted({*files} ^ {*members})
    if odd:
        missing = "misses" if odd[0] in files else "has, beside what it lists,"
        raise BenchError(f"{path} is damaged (it {missing} {_shown(odd[0])}); {_AGAIN}.")
    for name, content in members.items():
        if _sha256(content) != files[name]:
            raise BenchError(f"{path} is damaged (the checksum of {name} does not match); {_AGAIN}.")


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _shown(name: str) -> str:
    return repr(name[:80])
