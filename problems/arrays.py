"""Array types, read-only copies, and sparse matrices as labelled arrays."""

import contextlib
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from itertools import chain
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ProblemError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Scalar = TypeVar("Scalar", bound=np.generic)

MAX_DOUBLE = sys.float_info.max
"""Largest finite number of double precision."""

MAX_ROWS = 2**31 - 1
"""Largest number of rows; 32-bit indices of matrices can number them."""

MAX_DEPTH = 3
"""Largest depth of nested lists in which masked entries are searched."""

NUMBER_TYPES = {int, float, np.float64}
"""Usual types of the items of lists of numbers, which contain no masked entries."""


def real_numbers(values: ArrayLike, name: str) -> NDArray[Any]:
    """Return ``values``, called ``name`` in error messages, as an array of any real type.

    Raises:
        ProblemError: if ``values`` are complex numbers, strings or other objects, or an entry is masked.
    """
    check_no_mask(values, name)
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        raise ProblemError(f"{name} must be an array of real numbers, got {type(values).__name__}.") from None
    if array.dtype.kind not in "fiub":
        raise ProblemError(f"{name} must be an array of real numbers, got an array of {array.dtype}.")
    return array


def real_vector(values: ArrayLike, name: str, length: int) -> FloatArray:
    """Return ``values``, called ``name``, as a vector of doubles with one entry for each of ``length`` rows.

    Raises:
        ProblemError: if ``values`` are not real numbers, or have another shape.
    """
    vector = np.asarray(real_numbers(values, name), dtype=np.float64)
    if vector.shape != (length,):
        raise ProblemError(f"{name} must have shape ({length},), one entry per row; got {vector.shape}.")
    return vector


def finite_vector(values: ArrayLike, name: str, length: int) -> FloatArray:
    """Return ``real_vector`` of finite numbers; raise ``ProblemError`` that names the first other one."""
    vector = real_vector(values, name, length)
    if not np.isfinite(vector).all():
        row = int(np.flatnonzero(~np.isfinite(vector))[0])
        raise ProblemError(f"{name}[{row}] = {vector[row]} must be finite.")
    return vector


def check_number(name: str, value: object, lowest: float = -MAX_DOUBLE) -> None:
    """Raise ``ProblemError`` unless ``value``, called ``name``, is a real number, finite and at least ``lowest``."""
    number = np.nan
    if isinstance(value, int | float | np.integer | np.floating):
        with contextlib.suppress(OverflowError):  # of an integer
            number = float(value)
    if not lowest <= number <= MAX_DOUBLE:
        requirement = "a finite number that is not negative" if lowest == 0.0 else "a finite number"
        raise ProblemError(f"{name} must be {requirement}, got {value!r:.60}.")


def check_count(name: str, value: object) -> None:
    """Raise ``ProblemError`` unless ``value``, called ``name``, is a number of rows or contacts."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= value <= MAX_ROWS:
        raise ProblemError(f"{name} must be a whole number from 0 to {MAX_ROWS}, got {value!r:.60}.")


def check_no_mask(values: object, name: str) -> None:
    """Raise ``ProblemError`` if an entry of ``values``, called ``name``, is masked, in an array or a nested list."""
    if type(values) is np.ndarray:  # the usual case
        return
    if isinstance(values, list | tuple):
        entry = _first_masked(values, MAX_DEPTH) if _may_be_masked(values) else None
    else:
        entry = _first_masked(values, 0)
    if entry is not None:  # NumPy would use the number behind the mask
        place = f"{name}[{', '.join(map(str, entry))}]" if entry else name
        raise ProblemError(f"{place} is masked; fill it with a number, as by values.filled(0.0), or omit it.")


def _may_be_masked(values: Iterable[object]) -> bool:
    """Return whether a nested list contains a masked array, at the cost of reading the types of its items."""
    for _ in range(MAX_DEPTH):
        kinds = set(map(type, values := list(values)))
        if kinds <= NUMBER_TYPES:
            return False
        if any(issubclass(kind, np.ma.MaskedArray) for kind in kinds):
            return True
        if not any(issubclass(kind, list | tuple) for kind in kinds):
            return False
        values = chain.from_iterable(value for value in values if isinstance(value, list | tuple))
    return False


def _first_masked(values: object, depth: int) -> tuple[int, ...] | None:
    """Return the index of the first masked entry of an array, or of lists within lists down to a depth, or None."""
    if isinstance(values, np.ma.MaskedArray):
        return tuple(map(int, np.argwhere(np.ma.getmaskarray(values))[0])) if np.ma.is_masked(values) else None
    for index, value in enumerate(values if depth > 0 and isinstance(values, list | tuple) else ()):
        entry = _first_masked(value, depth - 1)
        if entry is not None:
            return index, *entry
    return None


def frozen(values: ArrayLike, dtype: Any, name: str = "values") -> NDArray[Any]:
    """Return a contiguous read-only copy of ``values`` of type ``dtype``; error messages call it ``name``.

    Raises:
        ProblemError: if ``values`` are not real numbers, or an integer ``dtype`` cannot represent one of them.
    """
    source = real_numbers(values, name)
    if source.dtype != dtype and np.dtype(dtype).kind in "iu":
        array = _whole_numbers(source, dtype, name)
    else:
        array = np.array(source, dtype=dtype, order="C", copy=True)
    read_only(array)
    return array


def _whole_numbers(source: NDArray[Any], dtype: Any, name: str) -> NDArray[Any]:
    """Return a contiguous copy of an array as integers; raise ``ProblemError`` if that changes a number."""
    with np.errstate(invalid="ignore"):  # NaN and infinity are reported below
        array = np.array(source, dtype=dtype, order="C", copy=True)
    changed = np.flatnonzero(np.ravel(array != source))
    if len(changed):
        limits, value = np.iinfo(dtype), np.ravel(source)[changed[0]]
        raise ProblemError(f"{name}[{changed[0]}] = {value} must be a whole number from {limits.min} to {limits.max}.")
    return array


def read_only(*arrays: NDArray[Any]) -> None:
    """Make arrays read-only."""
    for array in arrays:
        array.setflags(write=False)


def sealed(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return a new array, after making it read-only."""
    read_only(array)
    return array


@dataclass(frozen=True, eq=False)
class ReadOnlyRecord:
    """Base class of records whose arrays are read-only, in copies and pickles too; these hold the fields alone."""

    def __getstate__(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in fields(self)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        for name, value in state.items():
            read_only(*_arrays_in(value))  # a pickle does not store the flag
            object.__setattr__(self, name, value)


def _arrays_in(value: Any) -> list[NDArray[Any]]:
    """Return an array, the arrays of a CSR or CSC matrix, or those of a tuple; nothing for other values."""
    if isinstance(value, tuple):
        return [array for part in value for array in _arrays_in(part)]
    parts = (value, *(getattr(value, part, None) for part in ("data", "indices", "indptr")))
    return [part for part in parts if isinstance(part, np.ndarray)]


def compressed_arrays(label: str, matrix: Any) -> dict[str, NDArray[Any]]:
    """Return the arrays of a CSR or CSC matrix by name, with 64-bit indices; the inverse of ``compressed_matrix``."""
    indices = {f"{label}.{part}": getattr(matrix, part).astype(np.int64) for part in ("indices", "indptr")}
    return {f"{label}.data": matrix.data, **indices, f"{label}.shape": np.array(matrix.shape)}


def compressed_matrix(kind: Any, content: Mapping[str, NDArray[Any]], label: str) -> Any:
    """Return the matrix whose arrays ``compressed_arrays`` returned.

    Its indices are checked, because compiled code relies on them.

    Args:
        kind: ``scipy.sparse.csr_array`` or ``scipy.sparse.csc_array``.
        content: arrays by name, which may include those of other matrices.
        label: prefix of the array names.

    Raises:
        KeyError: if an array is missing.
        ValueError: if the arrays do not form a valid matrix.
    """
    parts = tuple(content[f"{label}.{part}"] for part in ("data", "indices", "indptr"))
    if any(part.dtype.kind != kind_of_part for part, kind_of_part in zip(parts, "fii", strict=True)):
        raise ValueError(f"{label} is not a numeric matrix")
    matrix = kind(parts, shape=tuple(int(length) for length in content[f"{label}.shape"]))
    matrix.check_format(full_check=True)
    return matrix
