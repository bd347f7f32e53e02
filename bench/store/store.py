"""Results on disk: one folder a run, one JSON file a case, each written as a whole or not at all.

RUN/run.json            what was planned, the machine, the drift
RUN/cases/*.json        one finished case each, with a checksum of its content
"""

import fcntl
import hashlib
import json
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from ...problems.catalog.atomic_file import PART, replacing
from ..errors import BenchError
from .records import case_fault, info_fault, printable

FORMAT = 1
"""Version of the files."""

LARGEST_FILE = 2**28
"""Bytes that a file of a run may have."""


@dataclass(frozen=True)
class Store:
    """The folder of one run."""

    folder: Path
    _written: dict[Path, bytes] = field(default_factory=dict, compare=False, repr=False)

    @staticmethod
    def create(folder: Path) -> "Store":
        """Make the folder of a new run; one in which a run was killed before it began is taken.

        Raises:
            BenchError: if there is a run in it already, or it cannot be written.
        """
        store = Store(folder)
        try:
            store._cases.mkdir(parents=True, exist_ok=True)
            store.refuse_second()
        except OSError as error:
            raise BenchError(f"cannot write {folder}: {error.strerror}; choose another --results folder.") from None
        return store

    @staticmethod
    def open(folder: Path) -> "Store":
        """Open the folder of a stored run.

        Raises:
            BenchError: if it is none.
        """
        if not (folder / "run.json").is_file():
            raise BenchError(f"{folder} is no stored run (it has no run.json); name the folder of a run.")
        return Store(folder)

    def refuse_second(self) -> None:
        """Raise ``BenchError`` if the folder holds more than an empty folder for cases."""
        if any(entry != self._cases and entry.suffix != PART for entry in self.folder.iterdir()):
            raise BenchError(f"{self.folder} exists already; resume it with --resume, or choose another --run-id.")

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other processes from writing to the run meanwhile, and remove what a killed one had half written.

        The lock is one of the system's on the folder, which goes with the process however that ends.

        Raises:
            BenchError: if another process is writing to it.
        """
        try:
            folder = os.open(self._cases, os.O_RDONLY)
        except OSError as error:
            raise BenchError(f"cannot read {self._cases}: {error.strerror}; the run is damaged.") from None
        try:
            try:
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BenchError(f"another process is writing to {self.folder}; wait until it has ended.") from None
            except OSError:
                pass  # a file system without locks
            for part in (*self.folder.glob(f".*{PART}"), *self._cases.glob(f".*{PART}")):
                with suppress(OSError):
                    part.unlink()
            yield
        finally:
            os.close(folder)

    @property
    def _cases(self) -> Path:
        return self.folder / "cases"

    def write_info(self, info: dict[str, Any]) -> None:
        """Write run.json."""
        self._write(self.folder / "run.json", info)

    def read_info(self) -> dict[str, Any]:
        """Return run.json.

        Raises:
            BenchError: if it is damaged.
        """
        info = _read(self.folder / "run.json")
        fault = info_fault(info)
        if fault:
            raise BenchError(f"{self.folder / 'run.json'} is damaged (its {fault} makes no sense); begin a new run.")
        return info

    def write_case(self, case: dict[str, Any]) -> None:
        """Write one finished case, its names and texts as they can be shown anywhere."""
        case = printable(case)
        self._write(self._case_file(case["problem"], case["solver"]), case)

    def restore(self) -> None:
        """Write again what was written before and is gone or another now: a plugin may do what its user may.

        Raises:
            BenchError: if it cannot be written.
        """
        for path, content in self._written.items():
            if not _holds(path, content):
                _put(path, content)

    def _write(self, path: Path, content: dict[str, Any]) -> None:
        self._written[path] = _text(content)
        _put(path, self._written[path])

    def read_cases(self) -> tuple[list[dict[str, Any]], list[str]]:
        """Return all readable cases, and one sentence for each damaged file; stray parts of writes are ignored."""
        cases, damaged = [], []
        for file in sorted(self._cases.glob("*.json")):
            try:
                case = _read(file)
                fault = case_fault(case)
                if fault:
                    raise BenchError(f"{file.name} is damaged (its {fault} makes no sense); resume the run.")
                if self._case_file(case["problem"], case["solver"]) != file:
                    raise BenchError(f"{file.name} holds another case than its name says.")
                cases.append(case)
            except BenchError as error:
                damaged.append(f"{file.name} is left out: {error}")
        return cases, damaged

    def _case_file(self, problem: str, solver: str) -> Path:
        """Return the file of a case: readable, safe as a file name, and unique."""
        return self._cases / f"{plain_name(problem)}--{plain_name(solver)}.json"


def plain_name(name: str) -> str:
    """Return ``name`` reduced to what is safe in a file name anywhere; different names stay different."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._")
    if plain == name and len(plain) <= 60:
        return plain
    return f"{plain[:51]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def _text(content: dict[str, Any]) -> bytes:
    """Return content as JSON with its checksum."""
    body = {"format": FORMAT, **content}
    return json.dumps({**_plain(body), "checksum": _checksum(_plain(body))}, indent=1, ensure_ascii=False).encode()


def _put(path: Path, content: bytes) -> None:
    """Write to a temporary file beside ``path``, then put it in place; a folder that is gone is made again."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write(content)
    except OSError as error:
        raise BenchError(
            f"cannot write {path}: {error.strerror}; make room or choose another --results folder."
        ) from None


def _holds(path: Path, content: bytes) -> bool:
    try:
        return path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content
    except OSError:
        return False


def _read(path: Path) -> dict[str, Any]:
    try:
        if not path.is_file() or path.stat().st_size > LARGEST_FILE:
            raise BenchError(f"{path.name} is no file that a run writes; remove it.")
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror}.") from None
    except (ValueError, RecursionError):
        raise BenchError(f"{path.name} is damaged (no JSON); resume the run to measure it again.") from None
    if not isinstance(content, dict) or content.pop("checksum", None) != _checksum(content):
        raise BenchError(f"{path.name} is damaged (its checksum does not match); resume the run to measure it again.")
    if content.pop("format", None) != FORMAT:
        raise BenchError(f"{path.name} is of another format than {FORMAT}; measure it again with this version.")
    return cast(dict[str, Any], printable(content))


def _checksum(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _plain(value: Any) -> Any:
    """Return ``value`` with numbers that JSON cannot write (NaN, ±inf) as null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
