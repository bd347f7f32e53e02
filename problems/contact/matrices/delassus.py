"""Assembly of the Delassus matrix G = Wᵀ M⁻¹ W in block rows, from its factors or from a given matrix."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import NDArray

from ...arrays import FloatArray, IntArray, ReadOnlyRecord, read_only
from ...compilation.interpretation import interpretable
from ..blocks import BlockLayout
from .memory import SMALL_BYTES, available_bytes, named_allocation, require_memory
from .pieces import Pieces

REMEDY = "use a solver over the factors, such as SORprox(form='factors')"
"""What to do if the memory does not suffice for G."""


@dataclass(frozen=True, eq=False)
class DelassusBlocks(ReadOnlyRecord):
    """G in block CSR format over the padded blocks of a ``BlockLayout``; the diagonal block comes first in its row.

    Attributes:
        starts: first stored block of each block row, shape (n_blocks + 1,).
        columns: block column of each stored block, shape (n_stored,).
        values: the blocks [1/kg], shape (n_stored, width, width).
    """

    starts: IntArray
    columns: NDArray[np.int32]
    values: FloatArray

    def to_csr(self, layout: BlockLayout) -> sp.csr_array:
        """Return G without padding, shape (n_rows, n_rows), with sorted columns and read-only arrays.

        Raises:
            InsufficientMemoryError: if the available memory does not suffice.
        """
        size = layout.n_blocks * layout.width
        used_share = len(layout.slot) / max(size, 1)  # share of the lanes that are not padding
        copies = 1.0 if layout.is_dense else 1.0 + used_share + used_share**2
        require_memory(12.0 * copies * self.values.size, memory_purpose(layout.n_blocks), REMEDY)
        padded = sp.bsr_array((self.values, self.columns, self.starts), shape=(size, size)).tocsr()
        if not layout.is_dense:
            padded = padded[layout.slot][:, layout.slot]
        matrix = sp.csr_array(padded)
        matrix.sort_indices()
        read_only(matrix.data, matrix.indices, matrix.indptr)
        return matrix


def blocks_from_matrix(matrix: sp.csr_array, layout: BlockLayout) -> DelassusBlocks:
    """Return the block rows of a given G, shape (n_rows, n_rows); columns ascend after the diagonal block."""
    n_blocks, width = layout.n_blocks, layout.width
    if n_blocks == 1 and len(matrix.data) == width * width:  # one dense contact needs no kernel
        starts, columns = np.arange(2), np.zeros(1, dtype=np.int32)
        values = matrix.data.reshape(1, width, width).copy()
    else:
        starts, columns, values = gather_blocks(
            matrix.indptr, matrix.indices, layout.slot, n_blocks, width, matrix.data
        )
    read_only(starts, columns, values)
    return DelassusBlocks(starts, columns, values)


def blocks_from_pieces(pieces: Pieces) -> DelassusBlocks:
    """Return the block rows of G = W̃ᵀ W̃ from the pieces of W̃.

    Raises:
        InsufficientMemoryError: if the available memory does not suffice.
    """
    _require_memory_for(pieces)
    with named_allocation(memory_purpose(pieces.n_blocks), REMEDY):
        starts, columns, values = multiply_pieces(pieces.starts, pieces.chunks, pieces.values, pieces.n_chunks)
    read_only(starts, columns, values)
    return DelassusBlocks(starts, columns, values)


def _require_memory_for(pieces: Pieces) -> None:
    """Raise ``InsufficientMemoryError`` if the blocks of G and their columns exceed the memory.

    Counting the blocks takes a third of the time of the product, so it is done only if bounds are inconclusive.
    """
    n_blocks, bytes_of_block = pieces.n_blocks, 8 * pieces.width**2 + 4
    if bytes_of_block * n_blocks**2 < SMALL_BYTES:
        return
    lower, upper = _block_count_bounds(pieces)
    if bytes_of_block * upper < SMALL_BYTES:
        return
    purpose = memory_purpose(n_blocks)
    require_memory(bytes_of_block * lower, purpose, REMEDY)
    if bytes_of_block * upper > available_bytes():
        members = _pieces_of_chunks(pieces.starts, pieces.chunks, pieces.n_chunks)
        count = int(_row_starts(pieces.starts, pieces.chunks, *members)[-1])
        require_memory(bytes_of_block * float(count), purpose, REMEDY)


def _block_count_bounds(pieces: Pieces) -> tuple[float, float]:
    """Return lower and upper bounds on the number of blocks of G: one for each pair of blocks that share a chunk.

    A pair with p and q pieces shares at most √(p q) chunks, so weights of 1/√(p q) count it at most once.
    """
    n_pieces = np.diff(pieces.starts)
    weight = np.repeat(1.0 / np.sqrt(np.maximum(n_pieces, 1)), n_pieces)
    sums = np.bincount(pieces.chunks, weight, pieces.n_chunks + 1)[: pieces.n_chunks]
    counts = np.bincount(pieces.chunks, minlength=pieces.n_chunks + 1)[: pieces.n_chunks].astype(np.float64)
    lower = max(float(np.square(sums).sum()), float(counts.max(initial=0.0)) ** 2)
    return lower, float(np.square(counts).sum()) + pieces.n_blocks


def memory_purpose(n_contacts: int) -> str:
    """Return the name of G in messages about memory."""
    return f"G of {n_contacts:,} contacts"


def diagonal_of(matrix: sp.csr_array) -> FloatArray:
    """Return the diagonal of G, a fresh array of shape (n_rows,)."""
    diagonal = np.zeros(matrix.shape[0])
    write_diagonal(matrix.indptr, matrix.indices, matrix.data, diagonal)
    return diagonal


@interpretable
@njit(cache=True, error_model="numpy")
def write_diagonal(indptr, indices, data, diagonal):  # type: ignore[no-untyped-def]
    """Add the diagonal of a matrix in CSR to ``diagonal``."""
    for row in range(len(diagonal)):
        for p in range(indptr[row], indptr[row + 1]):
            if indices[p] == row:
                diagonal[row] += data[p]


@interpretable
@njit(cache=True, error_model="numpy")
def gather_blocks(indptr, indices, slot, n_blocks, width, data):  # type: ignore[no-untyped-def]
    """Return starts, columns and values of the block rows of a matrix in CSR.

    The rows of a block are adjacent. The columns of each block row are found and sorted, then the blocks are filled.
    ``position`` holds the position of each block column of the current block row.
    """
    starts, position = np.zeros(n_blocks + 1, dtype=np.int64), np.full(n_blocks, -1, dtype=np.int64)
    block_of, lane_of = slot // width, slot % width
    columns = np.empty(n_blocks + len(indices), dtype=np.int32)
    row, end = 0, 0
    for block in range(n_blocks):
        columns[end], position[block] = block, end
        begin, end = end + 1, end + 1
        while row < len(slot) and block_of[row] == block:
            for p in range(indptr[row], indptr[row + 1]):
                column = block_of[indices[p]]
                if position[column] < begin - 1:
                    position[column] = end
                    k = end
                    while k > begin and columns[k - 1] > column:
                        columns[k] = columns[k - 1]
                        k -= 1
                    columns[k] = column
                    end += 1
            row += 1
        starts[block + 1] = end
    values, row = np.zeros((end, width, width)), 0
    for block in range(n_blocks):
        for k in range(starts[block], starts[block + 1]):
            position[columns[k]] = k
        while row < len(slot) and block_of[row] == block:
            for p in range(indptr[row], indptr[row + 1]):
                column = indices[p]
                values[position[block_of[column]], lane_of[row], lane_of[column]] += data[p]
            row += 1
    return starts, columns[:end].copy(), values


@njit(cache=True, error_model="numpy")
def _pieces_of_chunks(starts, chunks, n_chunks):  # type: ignore[no-untyped-def]
    """Return, for each chunk, its pieces in the order of their blocks, and the block of each piece.

    The idle chunk, the last one, has no pieces.
    """
    chunk_starts = np.zeros(n_chunks + 2, dtype=np.int64)
    for p in range(len(chunks)):
        if chunks[p] < n_chunks:
            chunk_starts[chunks[p] + 1] += 1
    for chunk in range(n_chunks + 1):
        chunk_starts[chunk + 1] += chunk_starts[chunk]
    filled = chunk_starts[:-1].copy()
    members = np.empty(len(chunks), dtype=np.int64)
    block_of_piece = np.empty(len(chunks), dtype=np.int64)
    for block in range(len(starts) - 1):
        for p in range(starts[block], starts[block + 1]):
            block_of_piece[p] = block
            if chunks[p] < n_chunks:
                members[filled[chunks[p]]] = p
                filled[chunks[p]] += 1
    return chunk_starts, members, block_of_piece


@njit(cache=True, error_model="numpy")
def _row_starts(starts, chunks, chunk_starts, members, block_of_piece):  # type: ignore[no-untyped-def]
    """Return the first stored block of each block row of G, and the number of all stored blocks."""
    n_blocks = len(starts) - 1
    seen, row_starts = np.full(n_blocks, -1, dtype=np.int64), np.zeros(n_blocks + 1, dtype=np.int64)
    for block in range(n_blocks):
        count = 1
        seen[block] = block
        for p in range(starts[block], starts[block + 1]):
            for m in range(chunk_starts[chunks[p]], chunk_starts[chunks[p] + 1]):
                column = block_of_piece[members[m]]
                if seen[column] != block:
                    seen[column] = block
                    count += 1
        row_starts[block + 1] = row_starts[block] + count
    return row_starts


def _count_products(starts, chunks, pieces, n_chunks):  # type: ignore[no-untyped-def]
    """Return the number of products that ``multiply_pieces`` sums."""
    _, width, length = pieces.shape
    pairs = np.square(np.bincount(chunks, minlength=n_chunks)[:n_chunks]).sum()
    return int(pairs) * width * width * length


@partial(interpretable, count=_count_products)
@njit(cache=True, error_model="numpy")
def multiply_pieces(starts, chunks, pieces, n_chunks):  # type: ignore[no-untyped-def]
    """Return W̃ᵀ W̃ by the row-wise sparse product (Gustavson 1978): count the blocks first, then fill them."""
    n_blocks = len(starts) - 1
    _, width, length = pieces.shape
    chunk_starts, members, block_of_piece = _pieces_of_chunks(starts, chunks, n_chunks)
    row_starts = _row_starts(starts, chunks, chunk_starts, members, block_of_piece)
    columns = np.empty(row_starts[n_blocks], dtype=np.int32)
    values = np.zeros((row_starts[n_blocks], width, width))
    position = np.full(n_blocks, -1, dtype=np.int64)  # position of each block column in the current block row
    for block in range(n_blocks):
        begin = row_starts[block]
        end = begin + 1
        columns[begin] = block
        position[block] = begin
        for p in range(starts[block], starts[block + 1]):
            for m in range(chunk_starts[chunks[p]], chunk_starts[chunks[p] + 1]):
                other = members[m]
                column = block_of_piece[other]
                if position[column] < begin:
                    position[column] = end
                    columns[end] = column
                    end += 1
                target = values[position[column]]
                for row in range(width):
                    left = pieces[p, row]
                    for lane in range(width):
                        right = pieces[other, lane]
                        total = 0.0
                        for k in range(length):
                            total += left[k] * right[k]
                        target[row, lane] += total
    return row_starts, columns, values
