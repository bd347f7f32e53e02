"""What result files of simulations have in common: arrays without pickle, and JSON that says what they are.

    about     JSON: kind and format of the file, version of the framework, and what else the kind notes
    …         the arrays of the kind, compressed by nothing

Every write replaces the whole file, so whatever happens, the last complete one is there.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.catalog.archive import ArchiveError, read_arrays
from ...problems.catalog.atomic_file import replacing
from ...problems.errors import ProxbenchError
from ..errors import BenchError

SUFFIX = ".npz"

ABOUT = "about"
"""The name of the JSON among the arrays."""

FIXED_KIND, VARIABLE_KIND = "proxbench simulation", "proxbench simulation with variable steps"

READERS = {
    FIXED_KIND: ("a fixed step", "proxbench.bench.simulation.file.read_simulation"),
    VARIABLE_KIND: ("a variable step", "proxbench.bench.variable.file.read_variable"),
}
"""What simulations of each kind have, and the function that reads their files."""

_UNREADABLE = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError)
"""What content that nobody wrote may raise where it is read."""


@dataclass(frozen=True)
class ResultKind:
    """A kind of result files.

    Attributes:
        name: what a file says it is.
        format: version of its content.
        lacks: what messages say of a file of another kind: "is no …".
    """

    name: str
    format: int
    lacks: str

    def write(self, path: Path, about: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
        """Write a file as a whole or not at all.

        Raises:
            BenchError: if it cannot be written.
        """
        head = {"kind": self.name, "format": self.format, "version": metadata.version("proxbench"), **about}
        content = {ABOUT: np.frombuffer(json.dumps(head, ensure_ascii=False).encode(), dtype=np.uint8), **arrays}
        try:
            with replacing(path) as file:
                np.savez(file, **content)
        except OSError as error:
            raise BenchError(f"cannot write {path}: {error.strerror}; choose another --output.") from None

    def read(self, path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return what a file says of itself, and its arrays.

        Raises:
            BenchError: if it is missing, damaged, of another kind, or of another format.
        """
        content = _stored_arrays(path)
        about = _about(content)
        kind = about.get("kind")
        if kind != self.name:
            if kind in READERS:
                what, reader = READERS[kind]
                raise BenchError(f"{path} holds a simulation with {what}; read it with {reader}.")
            raise BenchError(f"{path} {self.lacks}; name a file that proxbench simulate wrote.")
        if about.get("format") != self.format:
            raise BenchError(
                f"{path} has format {about.get('format')}, this version reads format {self.format}; simulate anew."
            )
        return about, content

    def is_of(self, path: Path) -> bool:
        """Whether a file says that it is of this kind.

        Raises:
            BenchError: if it is missing or damaged, or no result file at all.
        """
        return bool(_about(_stored_arrays(path)).get("kind") == self.name)


@contextmanager
def taken_from(path: Path) -> Iterator[None]:
    """Turn what content of a file raises, where a simulation is made of it, into one sentence.

    Raises:
        BenchError: for any such error.
    """
    try:
        yield
    except ProxbenchError as error:
        raise BenchError(f"cannot go on from {path}: {error}") from None
    except _UNREADABLE:
        raise _damaged(path) from None


def _stored_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of any .npz file; zip holds a checksum of each, which reading compares."""
    try:
        with path.open("rb") as file:
            if file.read(2) != b"PK":
                raise BenchError(
                    f"{path} is no result file of a simulation; name a file that proxbench simulate wrote."
                )
            file.seek(0)
            return read_arrays(file)
    except FileNotFoundError:
        raise BenchError(f"there is no result file {path}.") from None
    except IsADirectoryError:
        raise BenchError(f"{path} is a folder; name a result file in it, ending in {SUFFIX}.") from None
    except ArchiveError:
        raise _damaged(path) from None
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror or error}.") from None


def _about(content: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return what a file says of itself, nothing if it does not."""
    try:
        about = json.loads(content[ABOUT].tobytes().decode())
    except _UNREADABLE:
        return {}
    return about if isinstance(about, dict) else {}


def _damaged(path: Path) -> BenchError:
    return BenchError(f"{path} is damaged; remove it and simulate anew.")
