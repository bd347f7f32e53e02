"""Convert records to JSON files with a checksum and back; text is printable, and nonfinite numbers are null."""

import hashlib
import json
import math
import re
import zlib
from typing import Any, TypeVar

import msgspec

from ..errors import BenchError
from .fields import Record

_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that control a terminal, reverse text, or cannot be encoded."""

FORMAT = 3
"""Version of the file format."""

R = TypeVar("R", bound=Record)


def printable(value: Any) -> Any:
    """Return a JSON value with printable text, and None for numbers that are not finite."""
    if isinstance(value, str):
        return value if value.isprintable() else _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {printable(key): printable(item) for key, item in value.items()}
    if isinstance(value, list):
        return list(value) if _are_numbers(value) else [printable(item) for item in value]
    return value


def _are_numbers(values: list[Any]) -> bool:
    """Return whether a list, such as a convergence curve, has only integers or only finite floats."""
    kinds = set(map(type, values))
    return kinds <= {int} or (kinds == {float} and all(map(math.isfinite, values)))


def content_of(record: Record) -> dict[str, Any]:
    """Return a record as a JSON object, with its values converted by ``printable``."""
    content: dict[str, Any] = printable(msgspec.to_builtins(record))
    return content


def record_of(content: dict[str, Any], kind: type[R]) -> R:
    """Convert a JSON object to a record.

    Raises:
        ValueError: if a field is missing or out of range; the message names the field.
    """
    try:
        return msgspec.convert(printable(content), kind)
    except msgspec.ValidationError as error:
        raise ValueError(_field(str(error))) from None
    except BenchError:
        raise ValueError("limits") from None


def encode_record(record: Record) -> bytes:
    """Return the file content of a record: JSON with the version of the format and a checksum."""
    body = {"format": FORMAT, **content_of(record)}
    return msgspec.json.format(msgspec.json.encode({**body, "checksum": checksum(body)}), indent=1)


def decode_record(text: bytes, kind: type[R], name: str, remedy: str) -> R:
    """Return the record in the content of a file.

    Args:
        text: content of the file.
        kind: class of the record.
        name: name of the file in messages.
        remedy: last clause of error messages, which states what to do.

    Raises:
        BenchError: if the file is damaged or has another format.
    """
    try:
        content = msgspec.json.decode(text)
        has_valid_checksum = isinstance(content, dict) and content.pop("checksum", None) == checksum(content)
    except (msgspec.DecodeError, ValueError, RecursionError):
        raise BenchError(f"{name} is damaged (it is not JSON); {remedy}.") from None
    if not has_valid_checksum:
        raise BenchError(f"{name} is damaged (its checksum does not match); {remedy}.")
    version = content.pop("format", None)
    if version != FORMAT:
        raise BenchError(
            f"{name} has format {version!r:.20}, and this version reads format {FORMAT}; measure it again with this "
            "version of Proxbench."
        )
    try:
        return record_of(content, kind)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        field = error if isinstance(error, ValueError) else "content"
        raise BenchError(f"{name} is damaged (the value of its {field} is invalid); {remedy}.") from None


def checksum(content: dict[str, Any]) -> str:
    """Return the SHA-256 of a JSON object, which detects damage but not forgery."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def decompress(content: bytes, limit: int) -> bytes:
    """Decompress zlib or gzip data to at most ``limit`` bytes.

    Raises:
        ValueError: if the data are damaged or larger.
    """
    decompressor = zlib.decompressobj(zlib.MAX_WBITS | 32)
    try:
        text = decompressor.decompress(content, limit + 1)
    except zlib.error:
        raise ValueError("the compressed data are damaged") from None
    if len(text) > limit:
        raise ValueError(f"the data exceed {limit} bytes")
    if not decompressor.eof or decompressor.unused_data:
        raise ValueError("the compressed data are damaged")
    return text


def _field(message: str) -> str:
    """Return the field that an error message of msgspec names, such as ``"points[...].tolerance"``."""
    path = re.search(r"at `\$\.?(.*)`$", message)
    missing = re.search(r"missing required field `(\w+)`", message)
    names = [match.group(1) for match in (path, missing) if match]
    return ".".join(name for name in names if name) or "content"
