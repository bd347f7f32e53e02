"""Detect truncated ELF files before loading them: a read beyond the end of a mapped file kills the process."""

import struct
from pathlib import Path

_HEADER_LENGTH = 64
_LOADED = 1
"""Type of a segment that is mapped into memory (PT_LOAD of elf(5))."""


def elf_length(file: Path) -> int:
    """Return the end of the loaded segments of a 64-bit ELF file in bytes; 0 for other files.

    If the file ends within its header or its table of segments, it is the file size plus one.
    """
    with file.open("rb") as stream:
        header = stream.read(_HEADER_LENGTH)
        if header[:5] != b"\x7fELF\x02":
            return 0
        order = "<" if header[5:6] == b"\x01" else ">"
        try:
            (table,) = struct.unpack_from(f"{order}Q", header, 32)
            size, count = struct.unpack_from(f"{order}HH", header, 54)
            stream.seek(min(table, file.stat().st_size))
            entries = stream.read(size * count)
            segments = [struct.unpack_from(f"{order}IIQQQQ", entries, size * k) for k in range(count)]
        except struct.error:
            return file.stat().st_size + 1
    return max((start + length for kind, _, start, _, _, length in segments if kind == _LOADED), default=0)
