"""The messages between Proxbench and an executable: their format, and the checks of answers.

A message consists of a header and a body. The header has 16 bytes: the length of the body [bytes] (uint64), the kind
of the message (uint32) and a code (int32). Numbers are in the byte order of the machine, doubles and int64 at
multiples of 8 bytes from the beginning of the body.

    to the executable       body
    1 describe              nothing; the code is the version of the interface
    2 prepare               pb_problem, with offsets from the beginning of the body instead of addresses, and its arrays
    3 solve                 tolerance, max_seconds (double), max_iterations (int64), threads, is_observed (uint32),
                            start [n_rows]

    from the executable     body
    1 description           interface, model, sides, forms, laws, flags (int32), then name, line feed, version
    2 prepared              seconds (double), then text; the code is a pb_status, PB_SOLVED on success
    3 solution              iterations, n_rows (int64), seconds (double), impulses [n_rows], then text; the code is a
                            pb_status
    4 iterate               iteration (int64), impulses [n_rows]; after each iteration of an observed solve

Seconds are measured by the executable. Results use the clock of Proxbench, and also show these seconds.
"""

import struct
from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from .native_solver import BrokenInterfaceError, SolverFacts, check_interface
from .structures import text_of

DESCRIBE, PREPARE, SOLVE, ITERATE = 1, 2, 3, 4
"""Kinds of messages."""

HEADER = struct.Struct("=QIi")
"""Length of the body, kind and code."""

LIMITS = struct.Struct("=ddqII")
"""Tolerance, seconds, iterations, threads, and whether iterates are requested; the start follows."""

MAX_TEXT = 4096
"""Largest number of bytes of text in a message."""

_DESCRIPTION = struct.Struct("=6i")
_SECONDS = struct.Struct("=d")
_COUNTS = struct.Struct("=qqd")
_ITERATION = struct.Struct("=q")


@dataclass(frozen=True)
class Message:
    """One message: its kind, code and body."""

    kind: int
    code: int
    body: bytes


@dataclass(frozen=True)
class Answer:
    """The result of a solve: status, iterations, seconds by the executable's clock, impulses [N s], and text."""

    code: int
    iterations: int
    seconds: float
    impulses: FloatArray
    text: str


def max_body(n_rows: int) -> int:
    """Return the largest body that an executable may send about a problem of ``n_rows`` [bytes]."""
    return _COUNTS.size + 8 * n_rows + MAX_TEXT


def read_description(source: str, message: Message) -> SolverFacts:
    """Return an executable's description of itself.

    Raises:
        SolverError: if the message is too short, the interface has another version, or the model is invalid.
    """
    if len(message.body) < _DESCRIPTION.size:
        raise BrokenInterfaceError(
            f"{source} sent a description of {len(message.body)} bytes; send six numbers and a name."
        )
    interface, model, sides, forms, laws, flags = _DESCRIPTION.unpack_from(message.body)
    check_interface(source, interface)
    name, _, version = message.body[_DESCRIPTION.size :].partition(b"\n")
    return SolverFacts.checked(source, text_of(name), text_of(version), model, sides, masks=(forms, laws, flags))


def read_prepared(source: str, message: Message) -> tuple[int, float, str]:
    """Return the status, the seconds and the text of an executable that has prepared a problem.

    Raises:
        BrokenInterfaceError: if the message is too short.
    """
    if len(message.body) < _SECONDS.size:
        raise BrokenInterfaceError(
            f"{source} sent {len(message.body)} bytes as the answer to prepare; send seconds and a string."
        )
    (seconds,) = _SECONDS.unpack_from(message.body)
    return message.code, seconds, text_of(message.body[_SECONDS.size :])


def read_answer(source: str, message: Message) -> Answer:
    """Return the result of a solve, with the declared number of impulses.

    Raises:
        BrokenInterfaceError: if the message is too short for the declared number of impulses.
    """
    size = len(message.body) - _COUNTS.size
    iterations, count, seconds = _COUNTS.unpack_from(message.body) if size >= 0 else (0, -1, 0.0)
    if not 0 <= 8 * count <= size:
        raise BrokenInterfaceError(
            f"{source} sent {len(message.body)} bytes as a solution; send iterations, n_rows, seconds and impulses."
        )
    impulses = np.frombuffer(message.body, np.float64, count, _COUNTS.size).copy()
    return Answer(message.code, iterations, seconds, impulses, text_of(message.body[_COUNTS.size + 8 * count :], 2000))


def read_iterate(source: str, message: Message, n_rows: int) -> tuple[int, FloatArray]:
    """Return an iteration number and its impulses [N s], read-only, shape (n_rows,).

    Raises:
        BrokenInterfaceError: if the message does not have the length of an iterate.
    """
    if len(message.body) != _ITERATION.size + 8 * n_rows:
        raise BrokenInterfaceError(
            f"{source} sent {len(message.body)} bytes as an iterate; send the iteration and {n_rows} impulses."
        )
    return _ITERATION.unpack_from(message.body)[0], np.frombuffer(message.body, np.float64, n_rows, _ITERATION.size)
