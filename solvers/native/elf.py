"""Detect ELF files that cannot be loaded.

Loading a truncated file kills the process, because the loader reads beyond its end. For a library that is built for
another processor, the loader of glibc misleadingly reports a missing file.
"""

import struct
from pathlib import Path

_HEADER_LENGTH = 64
_LOADED = 1
"""Type of a segment that is mapped into memory (PT_LOAD of elf(5))."""

_MACHINES = {
    3: "x86 (32 bits)",
    8: "MIPS",
    20: "PowerPC (32 bits)",
    21: "PowerPC (64 bits)",
    22: "s390",
    40: "ARM (32 bits)",
    62: "x86-64",
    183: "AArch64",
    243: "RISC-V",
    258: "LoongArch",
}
"""Processors by the machine number of an ELF header (e_machine of elf(5))."""

OWN_PROGRAM = Path("/proc/self/exe")
"""The program of this process, on Linux."""


def processor_of(file: Path) -> str:
    """Return the processor that an ELF file is built for; empty for other files."""
    with file.open("rb") as stream:
        header = stream.read(_HEADER_LENGTH)
    if header[:4] != b"\x7fELF" or len(header) < _HEADER_LENGTH:
        return ""
    (number,) = struct.unpack_from("<H" if header[5:6] == b"\x01" else ">H", header, 18)
    return _MACHINES.get(number, f"the processor with ELF machine number {number}")


def own_processor() -> str:
    """Return the processor that this process is built for; empty if the system has no ELF files."""
    try:
        return processor_of(OWN_PROGRAM)
    except OSError:
        return ""


def elf_length(file: Path) -> int:
    """Return the offset of the end of the loaded segments of a 64-bit ELF file [bytes]; 0 for other files.

    If the file ends within its header or its table of segments, return the file size plus one.
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
