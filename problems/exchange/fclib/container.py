"""Read plain data sets from untrusted HDF5 files.

HDF5 allows links to other files, data kept in other files, virtual data sets, filters loaded at run time, and data sets
whose declared size exceeds their data. FCLIB needs none of these, because its library writes contiguous arrays. An
array is therefore read only if all its bytes are in the file itself. Reading an array never takes more memory than the
size of the file.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import FloatArray
from ..files.archive import DAMAGE_ERRORS

MAX_FILE_BYTES = 2**30
"""Largest size of a file [bytes]."""

MAX_TEXT_LENGTH = 10_000
"""Largest number of characters of a text; longer texts are truncated."""

REPACK_REMEDY = "write it again with: h5repack -l CONTI -f NONE"
"""Remedy for chunked or compressed data sets, in error messages."""


class ContainerError(ValueError):
    """A file is not an HDF5 file, or has unsupported content; the message gives the reason."""


@contextmanager
def open_container(path: Path) -> Iterator["Group"]:
    """Open an HDF5 file for reading, and yield its root group.

    Raises:
        ContainerError: if the file is not an HDF5 file, is damaged or too large, or has unsupported content.
        FileNotFoundError: if the file does not exist.
    """
    import h5py  # import takes 0.1 s

    if not path.exists():
        raise FileNotFoundError(path)
    if not path.is_file():
        raise ContainerError("it is not a regular file")
    size = path.stat().st_size
    if size > MAX_FILE_BYTES:
        raise ContainerError(f"its {size / 2**20:.0f} MiB exceed the limit of {MAX_FILE_BYTES / 2**20:.0f} MiB")
    try:
        with h5py.File(path, "r") as file:
            yield Group(h5py, file.id, size, "")
    except (ContainerError, FileNotFoundError):
        raise
    except (OSError, EOFError, MemoryError, *DAMAGE_ERRORS) as error:
        raise ContainerError(f"it is not an HDF5 file, or is damaged ({type(error).__name__})") from None


class Group:
    """A group of an open file.

    Attributes:
        path: path of the group in the file, empty for the root.
    """

    def __init__(self, h5py: Any, group_id: Any, file_size: int, path: str) -> None:
        self._h5py, self._id, self._file_size, self.path = h5py, group_id, file_size, path

    def __contains__(self, name: str) -> bool:
        return bool(self._id.links.exists(name.encode()))

    def group(self, name: str) -> "Group":
        """Return a member of this group that is a group itself.

        Raises:
            ContainerError: if the member is missing, a link, or not a group.
        """
        member = self._member(name)
        if not isinstance(member, self._h5py.h5g.GroupID):
            raise ContainerError(f"{self.path}/{name} is not a group")
        return Group(self._h5py, member, self._file_size, f"{self.path}/{name}")

    def floats(self, name: str) -> FloatArray:
        """Return a vector in double precision, shape (n,).

        Raises:
            ContainerError: if the data set is missing, has the wrong type or shape, or has no data in the file.
        """
        types = self._h5py.h5t
        return self._read_vector(name, (types.IEEE_F64LE, types.IEEE_F64BE), np.dtype(np.float64), "64-bit numbers")

    def integers(self, name: str) -> NDArray[np.signedinteger[Any]]:
        """Return a vector of integers of 32 or 64 bits, as stored, shape (n,).

        Raises:
            ContainerError: in the same cases as ``floats``.
        """
        types = self._h5py.h5t
        expected = "integers of 32 or 64 bits"
        if self._dataset(name).get_type().get_size() == 4:
            return self._read_vector(name, (types.STD_I32LE, types.STD_I32BE), np.dtype(np.int32), expected)
        return self._read_vector(name, (types.STD_I64LE, types.STD_I64BE), np.dtype(np.int64), expected)

    def integer(self, name: str) -> int:
        """Return a single integer, which FCLIB stores as an array of one entry.

        Raises:
            ContainerError: in the same cases as ``floats``, or if there is not exactly one entry.
        """
        values = self.integers(name)
        if len(values) != 1:
            raise ContainerError(f"{self.path}/{name} must be one number, got {len(values)}")
        return int(values[0])

    def text(self, name: str) -> str:
        """Return a text as one line of at most ``MAX_TEXT_LENGTH`` printable characters; empty if there is no text.

        Raises:
            ContainerError: if the data set is a link or not a single string, or keeps its data outside the file, in
                chunks or compressed.
        """
        if name not in self:
            return ""
        data = self._dataset(name)
        if (
            not isinstance(data.get_type(), self._h5py.h5t.TypeStringID)
            or data.get_space().get_simple_extent_npoints() > 1
        ):
            raise ContainerError(f"{self.path}/{name} must be one string")
        if not self._has_data(data, name):
            return ""
        content = self._h5py.Dataset(data)[()]
        if isinstance(content, np.ndarray):
            content = content.ravel()[0] if content.size else b""
        words = content.decode("utf-8", "replace").split("\0")[0].split()
        return "".join(character for character in " ".join(words)[:MAX_TEXT_LENGTH] if character.isprintable())

    def is_set(self, name: str) -> bool:
        """Return whether an attribute or a data set of this name has a nonzero value; False if there is neither.

        Raises:
            ContainerError: if the data set is not a single integer.
        """
        if self._h5py.h5a.exists(self._id, name.encode()):
            return bool(np.any(self._h5py.Group(self._id).attrs[name]))
        return name in self and self.integer(name) != 0

    def is_written(self, name: str) -> bool:
        """Return whether the data set exists and has data; libraries may reserve data sets that they never write.

        Raises:
            ContainerError: if the data set is a link, or keeps its data outside the file, in chunks or compressed.
        """
        return name in self and self._has_data(self._dataset(name), name)

    def _member(self, name: str) -> Any:
        if name not in self:
            raise ContainerError(f"{self.path}/{name} is missing")
        label = name.encode()
        if self._id.links.get_info(label).type != self._h5py.h5l.TYPE_HARD:
            raise ContainerError(f"{self.path}/{name} is a link, and links are not followed; copy its target")
        return self._h5py.h5o.open(self._id, label)

    def _dataset(self, name: str) -> Any:
        member = self._member(name)
        if not isinstance(member, self._h5py.h5d.DatasetID):
            raise ContainerError(f"{self.path}/{name} is not a data set")
        return member

    def _read_vector(self, name: str, file_types: tuple[Any, ...], dtype: np.dtype[Any], expected: str) -> NDArray[Any]:
        """Return a vector whose type is one of ``file_types``, converted to ``dtype``."""
        data = self._dataset(name)
        file_type, space = data.get_type(), data.get_space()
        if not any(file_type.equal(allowed) for allowed in file_types):
            raise ContainerError(f"{self.path}/{name} must contain {expected}")
        is_simple = space.get_simple_extent_type() in (self._h5py.h5s.SIMPLE, self._h5py.h5s.SCALAR)
        if not is_simple or space.get_simple_extent_ndims() > 1:
            raise ContainerError(f"{self.path}/{name} must be a vector")
        length = space.get_simple_extent_npoints()
        if not length:
            return np.zeros(0, dtype)
        if not self._has_data(data, name):
            raise ContainerError(f"{self.path}/{name} has no data: its space was reserved, but not written")
        array = np.empty(length, dtype)
        data.read(self._h5py.h5s.ALL, self._h5py.h5s.ALL, array)
        return array

    def _has_data(self, data: Any, name: str) -> bool:
        """Return whether a data set was written, so that all its bytes are in the file.

        Raises:
            ContainerError: if its data are in other files, chunked or compressed, or smaller than their declared size.
        """
        layouts, properties = self._h5py.h5d, data.get_create_plist()
        layout = properties.get_layout()
        where = f"{self.path}/{name}"
        if layout == layouts.VIRTUAL or properties.get_external_count():
            raise ContainerError(f"{where} keeps its data in other files, which are not read; copy them into this one")
        if layout not in (layouts.CONTIGUOUS, layouts.COMPACT) or properties.get_nfilters():
            raise ContainerError(f"{where} is chunked or compressed, and FCLIB files are not; {REPACK_REMEDY}")
        if layout == layouts.COMPACT:
            return True
        offset, stored_size, data_type = data.get_offset(), data.get_storage_size(), data.get_type()
        if offset is None:
            return False
        n_entries = data.get_space().get_simple_extent_npoints()
        declared_size = n_entries * data_type.get_size()
        if isinstance(data_type, self._h5py.h5t.TypeStringID) and data_type.is_variable_str():
            declared_size = stored_size  # references to the heap differ in size from the type
        if declared_size != stored_size or offset + stored_size > self._file_size:
            raise ContainerError(f"{where} is larger than the file; the file is truncated or damaged")
        return True
