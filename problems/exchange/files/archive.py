"""Reading of .npz files from untrusted sources, without pickle and with limits on their size."""

import math
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

MAX_ARCHIVE_BYTES = 2**30
"""Largest size of the unpacked arrays of one file [bytes]."""

MAX_ARRAYS = 64
"""Largest number of arrays in one file."""

DAMAGE_ERRORS = (ValueError, TypeError, LookupError, AttributeError, RuntimeError, OverflowError)
"""Exceptions that libraries raise when they read damaged content."""

_UNPACKING_ERRORS = (
    *(*DAMAGE_ERRORS, EOFError, MemoryError, zipfile.BadZipFile, zlib.error, struct.error),
    tokenize.TokenError,  # in the header of an array
)


class ArchiveError(ValueError):
    """A file is not a readable .npz file; the message is a clause that states the reason."""


def read_arrays(source: Path | IO[bytes]) -> dict[str, NDArray[Any]]:
    """Return the arrays of a .npz file by their names.

    Nothing is unpacked until the sizes in the directory of the file have been checked against the limits.

    Raises:
        ArchiveError: if the file is damaged, contains objects, or exceeds ``MAX_ARCHIVE_BYTES`` or ``MAX_ARRAYS``.
        OSError: if the file cannot be read.
    """
    try:
        with zipfile.ZipFile(source) as archive:
            members = archive.infolist()
            size = sum(member.file_size for member in members)
            if size > MAX_ARCHIVE_BYTES or len(members) > MAX_ARRAYS:
                raise ArchiveError(f"{len(members)} arrays of {size / 2**20:.0f} MB exceed the limits of problem files")
            arrays = {}
            for member in members:
                with archive.open(member) as file:
                    arrays[member.filename.removesuffix(".npy")] = _read_member(file, member.file_size)
    except ArchiveError:
        raise
    except zipfile.BadZipFile:
        raise ArchiveError("it is not an .npz archive, or it is cut off") from None
    except _UNPACKING_ERRORS as error:
        raise ArchiveError(f"it cannot be unpacked ({type(error).__name__})") from None
    if len(arrays) != len(members):
        raise ArchiveError("two of its arrays have the same name")
    return arrays


def _read_member(file: IO[bytes], size: int) -> NDArray[Any]:
    """Return the array of an open member of ``size`` bytes, whose header is checked before its data are read."""
    version = npy.read_magic(file)
    read_header = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
    if read_header is None:
        raise ArchiveError("an array has an unsupported format version")
    shape, is_fortran, dtype = read_header(file)
    if dtype.hasobject:
        raise ArchiveError("an array contains objects, which could run code")
    if any(length < 0 for length in shape) or math.prod(shape) * dtype.itemsize != size - file.tell():
        raise ArchiveError("an array does not have its declared size")
    content = bytearray(file.read())
    return np.frombuffer(content, dtype).reshape(shape, order="F" if is_fortran else "C")
