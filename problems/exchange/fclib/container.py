"""Reading of HDF5 files from untrusted sources: plain data sets, without links to other files.

HDF5 allows links to other files, data kept in other files, virtual data sets, filters loaded at run time, and sizes
that have no data behind them. FCLIB needs none of these, because its library writes contiguous arrays. So an array is
read only if all its bytes are in the file itself, and never takes more memory than the size of the file.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import FloatArray
from ..files.archive import DAMAGES

LARGEST_FILE = 2**30
"""Largest size of a file in bytes."""

LONGEST_TEXT = 10_000
"""Number of characters to which texts are truncated."""

REPACK = "write it again with: h5repack -l CONTI -f NONE"


class ContainerError(ValueError):
    """A file is not an HDF5 file, or has unsupported content; the text gives the reason."""


@contextmanager
def opened(path: Path) -> Iterator["Group"]:
    """Open an HDF5 file for reading; yield its root.

    Raises:
        ContainerError: if it is not an HDF5 file, damaged, too large, or has unsupported content.
        FileNotFoundError: if there is no such file.
    """
    import h5py  # import takes 0.1 s

    if not path.exists():
        raise FileNotFoundError(path)
    if not path.is_file():
        raise ContainerError("it is not a regular file")
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ContainerError(f"its {size / 2**20:.0f} MB exceed the limit of {LARGEST_FILE / 2**20:.0f} MB")
    try:
        with h5py.File(path, "r") as file:
            yield Group(h5py, file.id, size, "")
    except (ContainerError, FileNotFoundError):
        raise
    except (OSError, EOFError, MemoryError, *DAMAGES) as error:
        raise ContainerError(f"it is not an HDF5 file, or is damaged ({type(error).__name__})") from None


class Group:
    """A group of an open file."""

    def __init__(self, h5py: Any, identity: Any, file_size: int, path: str) -> None:
        self._h5py, self._id, self._file_size, self.path = h5py, identity, file_size, path

    def __contains__(self, name: str) -> bool:
        return bool(self._id.links.exists(name.encode()))

    def group(self, name: str) -> "Group":
        """Return a group in this one."""
        member = self._member(name)
        if not isinstance(member, self._h5py.h5g.GroupID):
            raise ContainerError(f"{self.path}/{name} is not a group")
        return Group(self._h5py, member, self._file_size, f"{self.path}/{name}")

    def floats(self, name: str) -> FloatArray:
        """Return a vector of double precision, shape (n,).

        Raises:
            ContainerError: if it is missing, of another type or shape, or has no data in the file.
        """
        types = self._h5py.h5t
        return self._array(name, (types.IEEE_F64LE, types.IEEE_F64BE), np.dtype(np.float64), "64-bit numbers")

    def integers(self, name: str) -> NDArray[np.signedinteger[Any]]:
        """Return a vector of integers, with 32 or 64 bits as stored, shape (n,); raise as ``floats`` does."""
        types, what = self._h5py.h5t, "integers of 32 or 64 bits"
        if self._dataset(name).get_type().get_size() == 4:
            return self._array(name, (types.STD_I32LE, types.STD_I32BE), np.dtype(np.int32), what)
        return self._array(name, (types.STD_I64LE, types.STD_I64BE), np.dtype(np.int64), what)

    def integer(self, name: str) -> int:
        """Return a single integer, which FCLIB stores as an array of one entry; raise as ``floats`` does."""
        found = self.integers(name)
        if len(found) != 1:
            raise ContainerError(f"{self.path}/{name} must be one number, got {len(found)}")
        return int(found[0])

    def text(self, name: str) -> str:
        """Return a text as one line; empty if there is none."""
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
        line = "".join(letter for letter in " ".join(words)[:LONGEST_TEXT] if letter.isprintable())
        return line

    def flag(self, name: str) -> bool:
        """Whether the group has an attribute or a data set of that name with a nonzero value."""
        attributes = self._h5py.h5a
        if attributes.exists(self._id, name.encode()):
            value = self._h5py.Group(self._id).attrs[name]
            return bool(np.any(value))
        return name in self and self.integer(name) != 0

    def is_written(self, name: str) -> bool:
        """Whether the data set exists and was written; libraries reserve some that they never write."""
        return name in self and self._has_data(self._dataset(name), name)

    def _member(self, name: str) -> Any:
        label = name.encode()
        if name not in self:
            raise ContainerError(f"{self.path}/{name} is missing")
        if self._id.links.get_info(label).type != self._h5py.h5l.TYPE_HARD:
            raise ContainerError(f"{self.path}/{name} is a link, and links are not followed; copy its target")
        return self._h5py.h5o.open(self._id, label)

    def _dataset(self, name: str) -> Any:
        member = self._member(name)
        if not isinstance(member, self._h5py.h5d.DatasetID):
            raise ContainerError(f"{self.path}/{name} is not a data set")
        return member

    def _array(self, name: str, stored: tuple[Any, ...], dtype: np.dtype[Any], what: str) -> NDArray[Any]:
        data = self._dataset(name)
        found, space = data.get_type(), data.get_space()
        if not any(found.equal(one) for one in stored):
            raise ContainerError(f"{self.path}/{name} must contain {what}")
        is_simple = space.get_simple_extent_type() in (self._h5py.h5s.SIMPLE, self._h5py.h5s.SCALAR)
        if not is_simple or space.get_simple_extent_ndims() > 1:
            raise ContainerError(f"{self.path}/{name} must be a vector")
        length = space.get_simple_extent_npoints()
        if not length:
            return np.zeros(0, dtype)
        if not self._has_data(data, name):
            raise ContainerError(f"{self.path}/{name} was reserved and never written")
        array = np.empty(length, dtype)
        data.read(self._h5py.h5s.ALL, self._h5py.h5s.ALL, array)
        return array

    def _has_data(self, data: Any, name: str) -> bool:
        """Whether all bytes of a data set are in the file, unpacked; False if none are.

        Raises:
            ContainerError: if they are elsewhere, packed, in chunks, or fewer than its declared size.
        """
        layouts, plist = self._h5py.h5d, data.get_create_plist()
        where = f"{self.path}/{name}"
        if plist.get_layout() == layouts.VIRTUAL or plist.get_external_count():
            raise ContainerError(f"{where} keeps its data in other files, which are not read; copy them into this one")
        if plist.get_layout() not in (layouts.CONTIGUOUS, layouts.COMPACT) or plist.get_nfilters():
            raise ContainerError(f"{where} is chunked or compressed, and FCLIB files are not; {REPACK}")
        if plist.get_layout() == layouts.COMPACT:
            return True
        offset, stored, kind = data.get_offset(), data.get_storage_size(), data.get_type()
        if offset is None:
            return False
        is_reference = isinstance(kind, self._h5py.h5t.TypeStringID) and kind.is_variable_str()
        claimed = stored if is_reference else data.get_space().get_simple_extent_npoints() * kind.get_size()
        if claimed != stored or offset + stored > self._file_size:
            raise ContainerError(f"{where} is larger than the file; the file is truncated or damaged")
        return True
