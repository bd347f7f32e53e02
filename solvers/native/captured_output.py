"""The last line that a program wrote to captured output, often the only explanation of why it ended."""

import os
import stat

from .structures import text_of

MAX_LINE_LENGTH = 200
"""Largest number of characters of a line that is shown."""

_MAX_BYTES = 4096
"""Largest number of bytes that are read from the end of the output."""


def output_size(descriptor: int) -> int:
    """Return the size of captured output [bytes]; 0 if the output is not a file, for example a terminal."""
    try:
        status = os.fstat(descriptor)
    except OSError:
        return 0
    return status.st_size if stat.S_ISREG(status.st_mode) else 0


def last_line(descriptor: int, start: int) -> str:
    """Return the last non-empty line of captured output, without control characters.

    It is empty if nothing was written, or if the output cannot be read, for example that of a terminal.

    Args:
        descriptor: the open output.
        start: size of the output before the program wrote to it [bytes].
    """
    begin = max(start, (end := output_size(descriptor)) - _MAX_BYTES)
    if begin >= end:
        return ""
    try:
        written = os.pread(descriptor, end - begin, begin)
    except OSError:  # the file is open for writing only
        return ""
    lines = (text_of(line, MAX_LINE_LENGTH) for line in reversed(written.splitlines()))
    return next(filter(None, lines), "")
