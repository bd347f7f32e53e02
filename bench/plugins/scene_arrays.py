"""States, masses and contacts as named arrays: written in the process of a scene, and validated by the reader."""

import io
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.laws import Laws
from ...problems.contact.matrices.factors import InverseMass
from ...problems.contact.matrices.pieces import Pieces
from ...problems.errors import ProxbenchError
from ...problems.exchange.files.archive import read_arrays
from ...problems.motion.bodies.system import ActiveContacts
from ...problems.motion.state import State

Arrays = dict[str, NDArray[Any]]
"""Arrays by name."""

T = TypeVar("T")

MALFORMED_ANSWER_ERRORS = (KeyError, ValueError, TypeError, IndexError, OverflowError, AttributeError, ProxbenchError)
"""Exceptions that reading a malformed answer may raise."""

LAW_FIELDS = ("kind", "friction_coefficient", "fixed_bound", "partner")
"""Names of the arrays that represent laws."""

SPARSE_PARTS = ("data", "indices", "indptr")
"""Attributes of a sparse matrix in compressed format."""


def plain_copy(value: T, kind: type[T]) -> T:
    """Return a dataclass instance with plain numbers, as a ``kind`` rather than a subclass defined by a plugin."""
    values = {field.name: np.asarray(getattr(value, field.name)).tolist() for field in fields(kind)}  # type: ignore[arg-type]
    return kind(**values)


def state_arrays(state: State) -> Arrays:
    """Return a state as arrays, without its time."""
    return {
        "position": np.asarray(state.position, float),
        "velocity": np.asarray(state.velocity, float),
        "state_keys": state.keys.astype(np.int64),
        "state_impulses": state.impulses,
    }


def mass_arrays(inverse: InverseMass) -> Arrays:
    """Return M⁻¹ as arrays."""
    return {f"mass_{part}": getattr(inverse.matrix, part) for part in SPARSE_PARTS}


def contact_arrays(contacts: ActiveContacts) -> Arrays:
    """Return contacts and joints as arrays."""
    laws = contacts.laws
    arrays = {
        "keys": contacts.keys.astype(np.int64),
        "gap": contacts.gap,
        "restitution": contacts.restitution,
        "width": np.array([contacts.width]),
        **{name: getattr(laws, name) for name in LAW_FIELDS},
    }
    if isinstance(contacts.directions, Pieces):
        pieces = contacts.directions
        return arrays | {
            "starts": pieces.starts.astype(np.int64),
            "chunks": pieces.chunks.astype(np.int64),
            "values": pieces.values,
        }
    parts = {f"directions_{part}": getattr(contacts.directions, part) for part in SPARSE_PARTS}
    drive: Arrays = {} if contacts.drive is None else {"drive": contacts.drive}
    return {**arrays, "row_counts": contacts.row_counts, **drive, **parts}


def packed(arrays: Arrays) -> bytes:
    """Return arrays as bytes; empty if there are none."""
    if not arrays:
        return b""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def unpacked(content: bytes) -> Arrays:
    """Return the arrays that ``packed`` wrote."""
    return read_arrays(io.BytesIO(content)) if content else {}


def checked_array(values: NDArray[Any], shape: tuple[int, ...]) -> FloatArray:
    """Return an array, or raise ``ValueError`` if its shape or type is wrong."""
    if values.dtype != np.float64 or values.shape != shape:
        raise ValueError("an array has the wrong shape or type")
    return values


def finite_numbers(values: NDArray[Any], shape: tuple[int, ...]) -> FloatArray:
    """Return an array, or raise ``ValueError`` if its shape or type is wrong or a number is not finite."""
    if not np.isfinite(checked_array(values, shape)).all():
        raise ValueError("an array is not finite")
    return values


def checked_keys(values: NDArray[Any]) -> IntArray:
    """Return keys, or raise ``ValueError`` if they are not ascending integers."""
    if values.dtype != np.int64 or values.ndim != 1 or (np.diff(values) <= 0).any():
        raise ValueError("the keys are not ascending integers")
    return values


def read_state(time: float, arrays: Arrays, n_coordinates: int, n_dofs: int) -> State:
    """Return the state at ``time`` [s]; invalid arrays raise one of ``MALFORMED_ANSWER_ERRORS``."""
    position = finite_numbers(arrays["position"], (n_coordinates,))
    velocity = finite_numbers(arrays["velocity"], (n_dofs,))
    keys, impulses = checked_keys(arrays["state_keys"]), arrays["state_impulses"]
    return State(time, position, velocity, keys, finite_numbers(impulses, (len(keys), *impulses.shape[1:2])))


def read_inverse_mass(arrays: Arrays, n_dofs: int) -> InverseMass:
    """Return M⁻¹; invalid arrays raise one of ``MALFORMED_ANSWER_ERRORS``."""
    parts = tuple(arrays[f"mass_{part}"] for part in SPARSE_PARTS)
    matrix = sp.csr_array(parts, shape=(n_dofs, n_dofs))
    matrix.check_format(full_check=True)
    return InverseMass.create(matrix)


def _read_pieces(arrays: Arrays, n_dofs: int) -> Pieces:
    """Return pieces after checking that their indices are in range, as compiled code requires."""
    starts, chunks, values = arrays["starts"], arrays["chunks"], arrays["values"]
    if starts.dtype != np.int64 or chunks.dtype != np.int64 or starts.ndim != 1 or chunks.ndim != 1 or values.ndim != 3:
        raise ValueError("the pieces have the wrong shape or type")
    n_chunks, remainder = divmod(n_dofs, values.shape[2])
    fits = starts[0] == 0 and starts[-1] == len(chunks) and (np.diff(starts) >= 0).all() and not remainder
    if not fits or (chunks < 0).any() or (chunks > n_chunks).any() or values[chunks == n_chunks].any():
        raise ValueError("the pieces do not fit the system")
    return Pieces(starts, chunks, finite_numbers(values, (len(chunks), *values.shape[1:])), n_chunks)


def read_contacts(arrays: Arrays, n_dofs: int) -> ActiveContacts:
    """Return contacts and joints after checking their indices for compiled code.

    Raises one of ``MALFORMED_ANSWER_ERRORS`` if an array is missing or invalid.
    """
    keys, laws = checked_keys(arrays["keys"]), Laws.in_order(*(arrays[name] for name in LAW_FIELDS))
    count, (width,) = len(keys), arrays["width"].tolist()
    gap, restitution = finite_numbers(arrays["gap"], (count,)), finite_numbers(arrays["restitution"], (laws.n_rows,))
    if "row_counts" not in arrays:
        pieces = _read_pieces(arrays, n_dofs)
        if pieces.n_blocks != count or pieces.width != width or laws.n_rows != count * width:
            raise ValueError("the directions do not fit the contacts")
        return ActiveContacts(keys, gap, laws, pieces, restitution, width)
    counts = arrays["row_counts"]
    if counts.dtype != np.int64 or counts.shape != (count,) or (counts < 1).any() or (counts > width).any():
        raise ValueError("the row counts do not fit the contacts")
    data, indices, starts = (arrays[f"directions_{part}"] for part in SPARSE_PARTS)
    directions = sp.csc_array((data, indices, starts), shape=(n_dofs, laws.n_rows))
    directions.check_format(full_check=True)
    finite_numbers(directions.data, directions.data.shape)
    if counts.sum() != laws.n_rows or not np.isin(np.cumsum(counts) - counts, laws.first_row).all():
        raise ValueError("the rows do not fit the contacts")
    drive = finite_numbers(arrays["drive"], (laws.n_rows,)) if "drive" in arrays else None
    return ActiveContacts(keys, gap, laws, directions, restitution, width, counts, drive)
