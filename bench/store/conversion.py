"""Records as JSON objects and as files, and back: texts that can be shown anywhere, numbers not finite as null."""

import hashlib
import json
import math
import re
from typing import Any, TypeVar

import msgspec

from ..errors import BenchError
from .fields import Record
from .records import CaseRecord, RunRecord

_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that steer a terminal, turn text around, or are halves that no file can hold."""

_DOUBTFUL = re.compile(rb"\\[ubfr]|\x7f")
"""What ASCII JSON has in place of some of these characters."""

FORMAT = 3
"""Version of the files. Times of versions 1 and 2 were modelled from those of a probe, not measured."""

MODELLED_FORMATS = (1, 2)

R = TypeVar("R", RunRecord, CaseRecord)


def printable(value: Any) -> Any:
    """Return a JSON value whose texts can be shown anywhere."""
    if isinstance(value, str):
        return _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", value)
    if isinstance(value, dict):
        return {printable(key): printable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [printable(item) for item in value]
    return value


def content_of(record: Record) -> dict[str, Any]:
    """Return a record as a JSON object whose texts can be shown anywhere, numbers that are not finite as null."""
    content: dict[str, Any]
    try:
        text = msgspec.json.encode(record)  # has null for numbers that are not finite
    except UnicodeEncodeError:
        text = b"\x7f"
    if text.isascii() and not _DOUBTFUL.search(text):
        content = msgspec.json.decode(text)
    else:
        content = _finite(printable(msgspec.to_builtins(record)))
    return content


def record_of(content: dict[str, Any], kind: type[R]) -> R:
    """Return the record that a JSON object is.

    Raises:
        ValueError: if it is none; the text names the field.
    """
    try:
        return msgspec.convert(printable(content), kind)
    except msgspec.ValidationError as error:
        raise ValueError(_field(str(error))) from None
    except BenchError:
        raise ValueError("limits") from None


def sealed(content: dict[str, Any]) -> bytes:
    """Return the file that holds content: JSON with its format and its checksum."""
    body = {"format": FORMAT, **content}
    return msgspec.json.format(msgspec.json.encode({**body, "checksum": checksum(body)}), indent=1)


def unsealed(text: bytes, kind: type[R], name: str, remedy: str) -> R:
    """Return the record that a file holds.

    Args:
        text: content of the file.
        kind: of the record.
        name: of the file in messages.
        remedy: how they end.

    Raises:
        BenchError: if it is damaged, or of another format.
    """
    try:
        content = json.loads(text.decode(), parse_constant=_refuse_constant)
        is_whole = isinstance(content, dict) and content.pop("checksum", None) == checksum(content)
    except (ValueError, RecursionError):
        raise BenchError(f"{name} is damaged (no JSON); {remedy}.") from None
    if not is_whole:
        raise BenchError(f"{name} is damaged (its checksum does not match); {remedy}.")
    version = content.pop("format", None)
    if version in MODELLED_FORMATS:
        raise BenchError(
            f"{name} has format {version}, whose times were corrected by a model and are no longer read; measure it "
            "again with this version."
        )
    if version != FORMAT:
        raise BenchError(f"{name} has another format than {FORMAT}; measure it again with this version.")
    try:
        return record_of(content, kind)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        field = error if isinstance(error, ValueError) else "content"
        raise BenchError(f"{name} is damaged (its {field} makes no sense); {remedy}.") from None


def checksum(content: dict[str, Any]) -> str:
    """Return the SHA-256 of a JSON object: it shows that a file is whole, not that it is honest."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return value


def _field(fault: str) -> str:
    """Return the field that a sentence of msgspec is about: ``"points[...].tolerance"``."""
    path = re.search(r"at `\$\.?(.*)`$", fault)
    missing = re.search(r"missing required field `(\w+)`", fault)
    names = [found.group(1) for found in (path, missing) if found]
    return ".".join(name for name in names if name) or "content"
