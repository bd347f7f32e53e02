"""A contact problem as the plain arrays of ``pb_problem``, copied into one block of memory.

Writing to these arrays does not change the problem. Executables receive a copy of this memory, with offsets instead of
addresses.
"""

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.contact.matrices.memory import to_dense
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from .structures import ARRAYS, BLOCKS, DENSE, FACTORS, SCALES, SPARSE, Problem, sized

ALIGNMENT = 64
"""Alignment of the address of each array in bytes."""

MAX_WEIGHT = 1e300
"""Weight of the laws [s/m] if the free velocity is zero, because the relative violation is then infinite."""

_TYPES: dict[str, np.dtype[Any]] = {"d": np.dtype(np.float64), "i": np.dtype(np.int32)}


@dataclass(frozen=True, eq=False)
class ProblemArrays:
    """The arrays of a problem, and ``pb_problem`` with their addresses."""

    structure: Problem
    memory: NDArray[np.uint8]

    @staticmethod
    def of(problem: ContactProblem, forms: int) -> "ProblemArrays":
        """Copy the arrays of the requested forms, without ``FACTORS`` if the problem has G only."""
        structure: Problem = sized(Problem)
        if problem.factors is None:
            forms &= ~FACTORS
        arrays = _common_arrays(problem, structure)
        for form, collect in _COLLECTORS.items():
            if forms & form:
                arrays |= collect(problem, structure)
        structure.forms = forms
        return ProblemArrays(structure, _copy(arrays, structure))

    def message(self) -> bytes:
        """Return ``pb_problem`` with offsets from its own beginning instead of addresses, followed by the arrays."""
        header = Problem.from_buffer_copy(self.structure)
        size = ctypes.sizeof(Problem)
        for name in ARRAYS:
            address = getattr(header, name)
            setattr(header, name, None if address is None else address - self.memory.ctypes.data + size)
        return bytes(header) + self.memory.tobytes()


def _common_arrays(problem: ContactProblem, structure: Problem) -> dict[str, Any]:
    laws = problem.laws
    structure.n_rows, structure.n_laws, structure.infeasible_law = problem.n_rows, laws.n_laws, -1
    return {
        "free_velocity": problem.free_velocity,
        "set": laws.sets,
        "row_count": laws.row_count,
        "first_row": laws.first_row,
        "friction": laws.friction_coefficient,
        "fixed_bound": laws.fixed_bound,
        "partner": laws.partner,
    }


def _scales(problem: ContactProblem, structure: Problem) -> dict[str, Any]:
    """Return α, and weights ℓ · ratio/scale with which the largest weighted violation is the judge's residual."""
    residual = Residual(problem)
    structure.infeasible_law = residual.stuck_law
    scale = residual.scale if residual.scale > 0.0 else 1.0 / MAX_WEIGHT
    return {"alpha": residual.alpha, "weight": residual.lengths * residual.ratios / scale}


def _dense(problem: ContactProblem, structure: Problem) -> dict[str, Any]:
    return {"dense": to_dense(problem.delassus(), "request a sparse form of the problem").reshape(-1)}


def _sparse(problem: ContactProblem, structure: Problem) -> dict[str, Any]:
    matrix = problem.delassus()
    arrays = {"row_starts": matrix.indptr, "columns": matrix.indices, "values": matrix.data}
    return {**arrays, "diagonal": matrix.diagonal()}


def _blocks(problem: ContactProblem, structure: Problem) -> dict[str, Any]:
    layout, blocks = problem.layout, problem.delassus_blocks()
    structure.n_blocks, structure.width = layout.n_blocks, layout.width
    return {
        "block_starts": blocks.starts,
        "block_columns": blocks.columns,
        "block_values": blocks.values.reshape(-1),
        "slot": layout.slot,
    }


def _factors(problem: ContactProblem, structure: Problem) -> dict[str, Any]:
    factors = problem.factors
    assert factors is not None
    directions, inverse, motion = factors.force_directions, factors.inverse_mass.matrix, factors.free_motion
    structure.n_dofs = factors.n_dofs
    arrays = {
        "w_starts": directions.indptr,
        "w_dofs": directions.indices,
        "w_values": directions.data,
        "mass_starts": inverse.indptr,
        "mass_columns": inverse.indices,
        "mass_values": inverse.data,
    }
    return arrays if motion is None else {**arrays, "free_motion": motion}


_COLLECTORS = {SCALES: _scales, DENSE: _dense, SPARSE: _sparse, BLOCKS: _blocks, FACTORS: _factors}
"""Functions that return the arrays of each form by name, and store its sizes in the structure."""


def _copy(arrays: dict[str, Any], structure: Problem) -> NDArray[np.uint8]:
    """Copy arrays into one block of memory, and store their addresses."""
    offsets, end = [], 0
    for name, source in arrays.items():
        dtype = _TYPES[ARRAYS[name]]
        offsets.append((name, source, dtype, end))
        end += -(-len(source) * dtype.itemsize // ALIGNMENT) * ALIGNMENT
    memory = np.zeros(max(end, 1) + ALIGNMENT, dtype=np.uint8)
    padding = -memory.ctypes.data % ALIGNMENT
    memory = memory[padding : padding + max(end, 1)]
    base = memory.ctypes.data
    for name, source, dtype, offset in offsets:
        memory[offset : offset + len(source) * dtype.itemsize].view(dtype)[:] = source
        setattr(structure, name, base + offset)
    return memory
