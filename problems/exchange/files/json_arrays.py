"""Named arrays as a JSON object: numbers, nested lists of numbers, and strings, for programs without NumPy."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .archive import MAX_ARCHIVE_BYTES, ArchiveError

SUFFIX = ".json"
"""Suffix of these files."""

_INTEGERS = (".indices", ".indptr", ".shape")
"""Suffixes of the names of integer arrays, which may be empty."""


def read_json(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the object ``about``, empty if there is none, and the arrays of a JSON file.

    Raises:
        ArchiveError: if the file exceeds ``MAX_ARCHIVE_BYTES`` or is not a JSON object, or a value is not an array of
            numbers or strings.
        OSError: if the file cannot be read.
    """
    if path.stat().st_size > MAX_ARCHIVE_BYTES:
        raise ArchiveError(f"more than {MAX_ARCHIVE_BYTES / 2**20:.0f} MB")
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise ArchiveError(f"it is not a JSON document ({error})") from None
    if not isinstance(content, dict):
        raise ArchiveError("it is not a JSON object of named arrays")
    about = content.pop("about", {})
    if not isinstance(about, dict):
        raise ArchiveError("'about' is not an object")
    return about, {name: _array(name, value) for name, value in content.items()}


def json_text(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the JSON text of a problem, one array per line; numbers have full precision."""
    lines = [f'"about": {json.dumps(dict(about), ensure_ascii=False)}']
    lines += [f"{json.dumps(name)}: {json.dumps(array.tolist())}" for name, array in arrays.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _array(name: str, value: Any) -> NDArray[Any]:
    try:
        array = np.array(value, dtype=np.int64 if name.endswith(_INTEGERS) else None)
    except (ValueError, TypeError, OverflowError):
        raise ArchiveError(f"{name!r} is not an array of numbers whose rows are equally long") from None
    if array.dtype.hasobject or array.dtype.kind not in "fiubU":
        raise ArchiveError(f"{name!r} is not an array of numbers whose rows are equally long")
    return array
