"""The structures and constants of ``proxbench.h`` for ctypes."""

import ctypes
from ctypes import c_char_p, c_double, c_int32, c_int64, c_uint32, c_void_p
from pathlib import Path
from typing import Any

from ...problems.contact.solver import Status

INTERFACE = 1
"""Version of the interface."""

STATUSES = tuple(Status)
"""Statuses in the order of ``pb_status``."""

MODELS = ("coulomb", "convex", "pyramid", "frictionless")
"""Kinds of models in the order of ``pb_model``."""

SCALES, DENSE, SPARSE, BLOCKS, FACTORS = (1 << bit for bit in range(5))
"""Bits of ``pb_form``."""

SHOWS_ITERATES, IS_RANDOMISED = 1, 2
"""Bits of ``pb_flags``."""

LAWS = (
    "contacts",
    "joints",
    "planar friction",
    "spatial friction",
    "rolling friction",
    "friction bounds other than μ Λ_N of the contact itself",
    "an asymmetric G",
)
"""Meanings of the bits of ``pb_laws``."""

FUNCTIONS = ("proxbench_describe", "proxbench_prepare", "proxbench_solve", "proxbench_free")
"""Functions that a shared library exports."""

OBSERVER = ctypes.CFUNCTYPE(None, c_void_p, c_int64, c_void_p)
"""Type of the field ``observe`` of ``pb_request``."""

SIZES = ("n_rows", "n_laws", "n_dofs", "n_blocks", "width", "infeasible_law")
"""Integer fields of ``pb_problem``, after its size and forms."""

ARRAYS = {
    "free_velocity": "d",
    "set": "i",
    "row_count": "i",
    "first_row": "i",
    "friction": "d",
    "fixed_bound": "d",
    "partner": "i",
    "alpha": "d",
    "weight": "d",
    "dense": "d",
    "row_starts": "i",
    "columns": "i",
    "values": "d",
    "diagonal": "d",
    "block_starts": "i",
    "block_columns": "i",
    "block_values": "d",
    "slot": "i",
    "w_starts": "i",
    "w_dofs": "i",
    "w_values": "d",
    "mass_starts": "i",
    "mass_columns": "i",
    "mass_values": "d",
    "free_motion": "d",
}
"""Arrays of ``pb_problem`` in the order of its fields, with "d" for doubles and "i" for int32."""


class Description(ctypes.Structure):
    """``pb_description``: the description of a solver."""

    _fields_ = (
        ("interface_version", c_uint32),
        ("size", c_uint32),
        ("name", c_char_p),
        ("version", c_char_p),
        ("model", c_int32),
        ("sides", c_int32),
        ("forms", c_uint32),
        ("laws", c_uint32),
        ("flags", c_uint32),
        ("reserved", c_uint32),
    )


class Problem(ctypes.Structure):
    """``pb_problem``: sizes and addresses of arrays."""

    _fields_ = (
        ("size", c_uint32),
        ("forms", c_uint32),
        *((name, c_int64) for name in SIZES),
        *((name, c_void_p) for name in ARRAYS),
    )


class Request(ctypes.Structure):
    """``pb_request``: limits, start and observer of a solve."""

    _fields_ = (
        ("size", c_uint32),
        ("threads", c_uint32),
        ("tolerance", c_double),
        ("max_iterations", c_int64),
        ("max_seconds", c_double),
        ("start", c_void_p),
        ("observe", OBSERVER),
        ("context", c_void_p),
    )


class Result(ctypes.Structure):
    """``pb_result``: the impulses, iterations and message of a solve."""

    _fields_ = (
        ("size", c_uint32),
        ("reserved", c_uint32),
        ("impulses", c_void_p),
        ("iterations", c_int64),
        ("message", c_char_p),
    )


def include_folder() -> Path:
    """Return the folder of ``proxbench.h``, for the option ``-I`` of a C compiler."""
    return Path(__file__).parent


def text_of(content: bytes | None, length: int = 200) -> str:
    """Return the text of a C string of a solver in one line, truncated to ``length`` characters; empty for NULL.

    Control characters, which could end a row of a table or change a terminal, are replaced.
    """
    text = (content or b"").decode(errors="replace")[:length]
    return " ".join(
        "".join(
            character if character.isprintable() or character.isspace() else "\N{REPLACEMENT CHARACTER}"
            for character in text
        ).split()
    )


def sized(kind: Any) -> Any:
    """Return an empty structure of a kind with its ``size`` set, as solvers require."""
    return kind(size=ctypes.sizeof(kind))
