"""The step sizes r of the projected iterations, one for each law.

An array with one row per block holds r of the N lane, of the T lanes and, for problems with joints or rolling friction,
of the R lanes. Its shape is (n_blocks, 2) or (n_blocks, 3). The rules are

    diagonal [52]:   r_i = ω / α_i,      α_i = largest diagonal entry of the law's block of G
    row sum [53]:    r_i = ω / max_h Σ_k |G_hk|,      h over the rows of law i

(Studer & Glocker 2005). A law whose rows of G are zero has r = 0, because its impulses change no velocity.
"""

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
import scipy.sparse as sp
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.compilation.interpretation import interpretable
from ...problems.contact.blocks import BlockLayout, block_of
from ...problems.contact.coupling import row_lengths
from ...problems.contact.problem import ContactProblem
from ..iteration.method import check_option

StepSize = Literal["diagonal", "row_sum"]


def check_options(step_size: str, relaxation: float) -> None:
    """Raise ``SolverError`` unless both options are valid."""
    check_option("step_size", step_size, step_size in get_args(StepSize), "'diagonal' or 'row_sum'")
    check_relaxation(relaxation)


def check_relaxation(relaxation: float) -> None:
    """Raise ``SolverError`` unless ω is a positive number."""
    is_valid = isinstance(relaxation, int | float) and 0.0 < relaxation < np.inf
    check_option("relaxation", relaxation, is_valid, "a positive number")


def compute_step_sizes(
    problem: ContactProblem, step_size: StepSize, relaxation: float, row_sums: Callable[[ContactProblem], FloatArray]
) -> FloatArray:
    """Return r for the lanes of each block [kg] by one of the two rules.

    ``row_sums`` returns Σ_k |G_hk| of every row h [1/kg], shape (n_rows,), for the second rule.
    """
    if step_size == "diagonal":
        return diagonal_step_sizes(problem, relaxation)
    return _per_law(problem, row_sums(problem), relaxation)


def diagonal_step_sizes(problem: ContactProblem, relaxation: float) -> FloatArray:
    """Return r = ω/α for the lanes of each block [kg]."""
    return _per_law(problem, problem.delassus_diagonal, relaxation)


def _per_law(problem: ContactProblem, row_values: FloatArray, relaxation: float) -> FloatArray:
    """Return ω over the largest of ``row_values`` [1/kg] of each law, for the lanes of each block [kg]."""
    layout = problem.layout
    if not layout.has_contacts_only:
        parts = np.split(layout.pad(row_values), [1, 1 + layout.sliding], axis=1)
        return inverse(np.column_stack([part.max(axis=1, initial=0.0) for part in parts]), relaxation)
    step_sizes = np.zeros((layout.n_blocks, 2))
    write_step_sizes(layout.slot, layout.width, row_values, relaxation, step_sizes)
    return step_sizes


def inverse(curvature: FloatArray, relaxation: float) -> FloatArray:
    """Return ω/curvature, or 0 where the curvature is 0."""
    return np.divide(relaxation, curvature, out=np.zeros_like(curvature), where=curvature > 0.0)


def lane_weights(layout: BlockLayout, step_sizes: FloatArray) -> FloatArray:
    """Return 1/√r of each lane, padded and flat, or 0 if r is 0; norms of impulses are weighted with it."""
    group_weights = np.sqrt(inverse(step_sizes, 1.0))
    widths = (1, layout.sliding, layout.rolling)[: step_sizes.shape[1]]
    weights: FloatArray = np.repeat(group_weights, widths, axis=1).reshape(-1)
    return weights


def row_sums_of_blocks(problem: ContactProblem) -> FloatArray:
    """Return Σ_k |G_hk| of every row h [1/kg], shape (n_rows,), from the assembled matrix.

    Rolling rows are scaled by the lengths ℓ of their laws (``residual``): Σ_k |G_hk| ℓ_k/ℓ_h.
    """
    if problem.layout.rolling:
        length = row_lengths(problem)
        return np.asarray(abs(problem.delassus()) @ length / length)
    blocks = problem.delassus_blocks()
    block_sums = np.abs(blocks.values).sum(axis=2)
    sums = np.add.reduceat(block_sums, blocks.starts[:-1], axis=0) if len(block_sums) else block_sums
    return problem.layout.unpad(np.ascontiguousarray(sums))


def row_sums_of_factors(problem: ContactProblem) -> FloatArray:
    """Return the result of ``row_sums_of_blocks`` from the factors, computing one row of G at a time."""
    assert problem.factors is not None
    by_row, length = problem.factors.scaled_directions, None
    if problem.layout.rolling:
        length = row_lengths(problem)
        by_row = sp.csc_array(by_row @ sp.diags_array(length))
    by_dof = sp.csr_array(by_row)
    pattern = (by_row.indptr, by_row.indices, by_row.data, by_dof.indptr, by_dof.indices, by_dof.data)
    sums: FloatArray = _row_sums(*pattern, problem.n_rows)
    return sums if length is None else sums / length**2


@interpretable
@njit(cache=True, error_model="numpy")
def write_step_sizes(slot, width, row_values, relaxation, step_sizes):  # type: ignore[no-untyped-def]
    """Write ω over the largest number in ``row_values`` of each law's rows, or 0 if that is 0."""
    one = uint64(1)
    if width == 3 and len(slot) == 3 * len(step_sizes):  # every lane is a row
        for contact in range(len(step_sizes)):
            first = uint64(3) * uint64(contact)
            step_sizes[contact, 0] = row_values[first]
            step_sizes[contact, 1] = max(row_values[first + one], row_values[first + uint64(2)])
    else:
        for row in range(len(slot)):
            block = block_of(slot[row], width)
            lane = min(uint64(slot[row]) - uint64(width) * block, one)
            step_sizes[block, lane] = max(step_sizes[block, lane], row_values[row])
    for block in range(len(step_sizes)):
        for lane in range(2):
            step_sizes[block, lane] = relaxation / step_sizes[block, lane] if step_sizes[block, lane] > 0.0 else 0.0


@njit(cache=True)
def _row_sums(row_ptr, row_dof, row_value, dof_ptr, dof_row, dof_value, n_rows):  # type: ignore[no-untyped-def]
    """Return Σ_k |G_hk| of every row h from W̃ in compressed columns and in compressed rows."""
    sums = np.zeros(n_rows)
    entries = np.zeros(n_rows)  # the current row of G, dense
    touched = np.empty(n_rows, dtype=np.int64)
    last_row = np.full(n_rows, -1, dtype=np.int64)  # the last row that touched each column
    for row in range(n_rows):
        n_touched = 0
        for p in range(row_ptr[row], row_ptr[row + 1]):
            dof = row_dof[p]
            for q in range(dof_ptr[dof], dof_ptr[dof + 1]):
                column = dof_row[q]
                if last_row[column] != row:
                    last_row[column] = row
                    touched[n_touched] = column
                    n_touched += 1
                entries[column] += row_value[p] * dof_value[q]
        for k in range(n_touched):
            sums[row] += abs(entries[touched[k]])
            entries[touched[k]] = 0.0
    return sums
