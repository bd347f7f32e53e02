"""Messages between a run and the process of a case.

The process may write arbitrary data, and stop in the middle of a message. Reading ends at a deadline, allocates
memory only for data that have arrived, and creates no objects that could run code.
"""

import json
import math
import os
import select
import struct
import time
from typing import Any

_HEADER = struct.Struct("!Q")
"""Format of the header of a message, which is the size of its content [bytes]."""

_MAX_CHUNK_BYTES = 2**20
"""Largest number of bytes that are read at a time."""


class NoMessageError(Exception):
    """The received data are not a message; the text gives the reason."""


def write_message(descriptor: int, content: bytes) -> None:
    """Write one message.

    Raises:
        OSError: if the reader has ended.
    """
    remaining = memoryview(_HEADER.pack(len(content)) + content)
    while remaining:
        remaining = remaining[os.write(descriptor, remaining) :]


def read_message(
    descriptor: int, max_bytes: int = 2**63, deadline: float = math.inf, exit_descriptor: int | None = None
) -> bytes:
    """Read one message.

    Args:
        descriptor: descriptor to read from.
        max_bytes: maximum size of the message [bytes].
        deadline: value of ``time.monotonic`` at which waiting ends.
        exit_descriptor: a descriptor that becomes readable when the writer has ended; processes that the writer has
            started may keep ``descriptor`` itself open.

    Raises:
        TimeoutError: if the message is incomplete at the deadline.
        EOFError: if the writer ends before the message is complete.
        NoMessageError: if the message is larger than ``max_bytes``.
    """
    (length,) = _HEADER.unpack(_read(descriptor, _HEADER.size, deadline, exit_descriptor))
    if length > max_bytes:
        raise NoMessageError(f"a message of {length} bytes exceeds the limit of {max_bytes}")
    return _read(descriptor, length, deadline, exit_descriptor)


def read_object(descriptor: int, max_bytes: int, deadline: float, exit_descriptor: int | None = None) -> dict[str, Any]:
    """Read one message that is a JSON object; arguments and errors as in ``read_message``."""
    content = read_message(descriptor, max_bytes, deadline, exit_descriptor)
    try:
        decoded = json.loads(content)
    except (ValueError, RecursionError):
        raise NoMessageError("a message that is not JSON") from None
    if not isinstance(decoded, dict):
        raise NoMessageError("a message that is not a JSON object")
    return decoded


def is_readable(descriptor: int, seconds: float) -> bool:
    """Wait up to ``seconds`` until data have arrived or the writer has ended, and return whether either happened."""
    return descriptor in _readable([descriptor], seconds)


def _readable(descriptors: list[int], seconds: float) -> list[int]:
    """Wait up to ``seconds``, and return the descriptors that are readable or closed by the writer."""
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    milliseconds = None if math.isinf(seconds) else max(seconds, 0.0) * 1e3
    return [descriptor for descriptor, _ in poll.poll(milliseconds)]


def _read(descriptor: int, length: int, deadline: float, exit_descriptor: int | None) -> bytes:
    """Read ``length`` bytes; arguments and errors as in ``read_message``."""
    watched = [descriptor] if exit_descriptor is None else [descriptor, exit_descriptor]
    content = bytearray()
    while len(content) < length:
        ready = _readable(watched, deadline - time.monotonic())
        if not ready:
            raise TimeoutError
        if descriptor not in ready:
            raise EOFError
        chunk = os.read(descriptor, min(length - len(content), _MAX_CHUNK_BYTES))
        if not chunk:
            raise EOFError
        content += chunk
    return bytes(content)
