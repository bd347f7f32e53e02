"""Assembly of the Delassus matrix G = Wᵀ M⁻¹ W in block rows, from its factors or from a given matrix."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit

from .blocks import BlockLayout
from .factors import Factors
from .laws import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class DelassusBlocks:
    """G in compressed rows of the padded blocks of a ``BlockLayout``; the diagonal block stands first in its row.

    Attributes:
        starts: first stored block of each block row, shape (n_blocks + 1,).
        columns: block column of each stored block, shape (n_stored,).
        values: the blocks [1/kg], shape (n_stored, width, width).
    """

    starts: IntArray
    columns: np.ndarray[tuple[int], np.dtype[np.int32]]
    values: FloatArray

    def to_csr(self, layout: BlockLayout) -> sp.csr_array:
        """Return G over rows, shape (n_rows, n_rows), columns sorted, read-only."""
        size = layout.n_blocks * layout.width
        padded = sp.bsr_array((self.values, self.columns, self.starts), shape=(size, size)).tocsr()
        if not layout.is_dense:
            padded = padded[layout.slot][:, layout.slot]
        matrix = sp.csr_array(padded)
        matrix.sort_indices()
        for array in (matrix.data, matrix.indices, matrix.indptr):
            array.setflags(write=False)
        return matrix


def blocks_from_matrix(matrix: sp.csr_array, layout: BlockLayout) -> DelassusBlocks:
    """Return the block rows of a given G, shape (n_rows, n_rows)."""
    entries = matrix.tocoo()
    row, column = layout.slot[entries.row], layout.slot[entries.col]
    block_row, block_column = row // layout.width, column // layout.width
    # the diagonal is always stored, and first: its key precedes every other of its row
    n = layout.n_blocks
    diagonal = np.arange(n)
    key = block_row * (n + 1) + np.where(block_row == block_column, 0, block_column + 1)
    keys, position = np.unique(np.concatenate([diagonal * (n + 1), key]), return_inverse=True)
    values = np.zeros((len(keys), layout.width, layout.width))
    values[position[n:], row % layout.width, column % layout.width] = entries.data
    rows, columns = keys // (n + 1), keys % (n + 1) - 1
    columns = np.where(columns < 0, rows, columns).astype(np.int32)
    starts = np.searchsorted(rows, np.arange(n + 1))
    return _read_only(starts.astype(np.int64), columns, values)


def blocks_from_factors(factors: Factors, layout: BlockLayout) -> DelassusBlocks:
    """Return the block rows of W̃ᵀ W̃, W̃ = Sᵀ W, M⁻¹ = S Sᵀ."""
    scaled = factors.scaled_directions
    by_dof = sp.csr_array(scaled)
    slots = layout.slot
    starts, columns, values = _gustavson(
        scaled.indptr.astype(np.int64),
        scaled.indices.astype(np.int64),
        scaled.data,
        by_dof.indptr.astype(np.int64),
        slots[by_dof.indices],
        by_dof.data,
        slots,
        layout.n_blocks,
        layout.width,
    )
    return _read_only(starts, columns, values)


def _read_only(starts: IntArray, columns: np.ndarray, values: FloatArray) -> DelassusBlocks:  # type: ignore[type-arg]
    for array in (starts, columns, values):
        array.setflags(write=False)
    return DelassusBlocks(starts, columns, values)


@njit(cache=True)
def _gustavson(row_ptr, row_dof, row_value, dof_ptr, dof_slot, dof_value, slots, n_blocks, width):  # type: ignore[no-untyped-def]
    """Row-wise sparse product G = W̃ᵀ W̃ into blocks (Gustavson 1978), twice: to count the blocks, then to fill them."""
    place = np.full(n_blocks, -1, dtype=np.int64)  # where block column j of the current block row is stored
    starts = np.zeros(n_blocks + 1, dtype=np.int64)
    n_rows = len(slots)
    row_begin = np.zeros(n_blocks + 1, dtype=np.int64)  # rows of a block are adjacent
    for row in range(n_rows):
        row_begin[slots[row] // width + 1] += 1
    for block in range(n_blocks):
        row_begin[block + 1] += row_begin[block]

    for block in range(n_blocks):
        count = 1
        place[block] = block
        for row in range(row_begin[block], row_begin[block + 1]):
            for entry in range(row_ptr[row], row_ptr[row + 1]):
                dof = row_dof[entry]
                for other in range(dof_ptr[dof], dof_ptr[dof + 1]):
                    column = dof_slot[other] // width
                    if place[column] != block:
                        place[column] = block
                        count += 1
        starts[block + 1] = starts[block] + count

    columns = np.empty(starts[n_blocks], dtype=np.int32)
    values = np.zeros((starts[n_blocks], width, width))
    place[:] = -1
    for block in range(n_blocks):
        begin = starts[block]
        end = begin + 1
        columns[begin] = block
        place[block] = begin
        for row in range(row_begin[block], row_begin[block + 1]):
            lane = slots[row] % width
            for entry in range(row_ptr[row], row_ptr[row + 1]):
                dof = row_dof[entry]
                value = row_value[entry]
                for other in range(dof_ptr[dof], dof_ptr[dof + 1]):
                    slot = dof_slot[other]
                    column = slot // width
                    if place[column] < begin:
                        place[column] = end
                        columns[end] = column
                        end += 1
                    values[place[column], lane, slot % width] += value * dof_value[other]
    return starts, columns, values
