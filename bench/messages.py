"""Messages from a case's process: JSON and raw numbers, read within a time and a size, whoever wrote them.

What such a process writes may be anything, and may stop in the middle: reading never waits past its deadline, takes
no more memory than has arrived, and never makes objects that could run code.
"""

import json
import os
import select
import struct
import time
from typing import Any

_HEADER = struct.Struct("!Q")

_CHUNK = 2**20


class NoMessageError(Exception):
    """What came is no message; the text says why."""


def write_message(descriptor: int, content: bytes) -> None:
    """Write one message, as a whole.

    Raises:
        OSError: if nobody reads any more.
    """
    waiting = memoryview(_HEADER.pack(len(content)) + content)
    while waiting:
        waiting = waiting[os.write(descriptor, waiting) :]


def read_message(descriptor: int, largest: int, deadline: float) -> bytes:
    """Read one message.

    Args:
        descriptor: where from.
        largest: number of bytes it may have.
        deadline: reading of ``time.monotonic`` at which waiting ends.

    Raises:
        TimeoutError: if it is not complete by then.
        EOFError: if the writer is gone before it is complete.
        NoMessageError: if it would be larger.
    """
    (length,) = _HEADER.unpack(_read(descriptor, _HEADER.size, deadline))
    if length > largest:
        raise NoMessageError(f"a message of {length} bytes where at most {largest} have a meaning")
    return _read(descriptor, length, deadline)


def read_object(descriptor: int, largest: int, deadline: float) -> dict[str, Any]:
    """Read one message that is a JSON object; arguments and errors as in ``read_message``."""
    content = read_message(descriptor, largest, deadline)
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        raise NoMessageError("a message that is no JSON") from None
    if not isinstance(found, dict):
        raise NoMessageError("a message that is no JSON object")
    return found


def _read(descriptor: int, length: int, deadline: float) -> bytes:
    content = bytearray()
    while len(content) < length:
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        if not poll.poll(max(deadline - time.monotonic(), 0.0) * 1e3):
            raise TimeoutError
        chunk = os.read(descriptor, min(length - len(content), _CHUNK))
        if not chunk:
            raise EOFError
        content += chunk
    return bytes(content)
