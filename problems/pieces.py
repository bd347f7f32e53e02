"""The scaled factor W̃ = Sᵀ W in small dense pieces, one for each contact and each chunk of coordinates it touches.

A chunk is a run of ``length`` degrees of freedom (a body's, where all bodies have equally many). Contacts touch one or
two bodies, so a contact has one or two pieces, and kernels over pieces need no index for every single number.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from .blocks import BlockLayout
from .factors import Factors
from .laws import FloatArray, IntArray

CHUNK_LENGTHS = (1, 2, 3, 6)
"""Lengths to choose from: the degrees of freedom of discs and balls, without and with rotation."""

SAMPLED_ROWS = 300
"""Rows that the choice among them looks at."""


@dataclass(frozen=True, eq=False)
class FactorPieces:
    """W̃ in pieces.

    Attributes:
        starts: first piece of each block, shape (n_blocks + 1,).
        chunks: chunk of each piece, shape (n_pieces,).
        values: the pieces [kg^-½], shape (n_pieces, width, length).
        n_chunks: number of chunks.
    """

    starts: IntArray
    chunks: IntArray
    values: FloatArray
    n_chunks: int

    @property
    def most_per_block(self) -> int:
        """Largest number of pieces of one block."""
        return int(np.diff(self.starts).max(initial=0))


def cut_into_pieces(factors: Factors, layout: BlockLayout) -> FactorPieces:
    """Return W̃ in pieces of the chunk length that makes them cheapest: numbers to read, plus four for each piece.

    The length is chosen by the first rows; a problem's contacts are alike.
    """
    if factors.inverse_mass.is_diagonal:
        scaled, root = factors.force_directions, factors.inverse_mass.root.data
    else:
        scaled, root = factors.scaled_directions, np.ones(factors.n_dofs)
    dofs = np.arange(factors.n_dofs)
    sample = layout.slot[:SAMPLED_ROWS]
    cost = {
        length: _count_pieces(scaled.indptr, scaled.indices, sample, layout.n_blocks, layout.width, dofs // length)[-1]
        * (layout.width * length + 4)
        for length in CHUNK_LENGTHS
    }
    length = min(CHUNK_LENGTHS, key=lambda candidate: cost[candidate])
    pattern = (scaled.indptr, scaled.indices, layout.slot, layout.n_blocks, layout.width, dofs // length)
    starts, chunks, values = _cut(*pattern, length, scaled.data, root)
    return FactorPieces(starts, chunks, values, -(-factors.n_dofs // length))


def delassus_diagonal(pieces: FactorPieces, layout: BlockLayout) -> FloatArray:
    """Return the diagonal of G = W̃ᵀ W̃ [1/kg], shape (n_rows,)."""
    return layout.unpad(_square_sums(pieces.starts, pieces.values))


@njit(cache=True)
def _square_sums(starts, values):  # type: ignore[no-untyped-def]
    """Sum of the squares of each lane of each block."""
    _, width, length = values.shape
    sums = np.zeros((len(starts) - 1, width))
    for block in range(len(starts) - 1):
        for piece in range(starts[block], starts[block + 1]):
            for lane in range(width):
                for k in range(length):
                    sums[block, lane] += values[piece, lane, k] * values[piece, lane, k]
    return sums


@njit(cache=True)
def _count_pieces(indptr, indices, slot, n_blocks, width, chunk_of):  # type: ignore[no-untyped-def]
    """Return the first piece of each block, shape (n_blocks + 1,), from the chunk of each degree of freedom."""
    last_block = np.full(len(chunk_of), -1, dtype=np.int64)
    starts = np.zeros(n_blocks + 1, dtype=np.int64)
    for row in range(len(slot)):
        block = slot[row] // width
        for p in range(indptr[row], indptr[row + 1]):
            chunk = chunk_of[indices[p]]
            if last_block[chunk] != block:
                last_block[chunk] = block
                starts[block + 1] += 1
    for block in range(n_blocks):
        starts[block + 1] += starts[block]
    return starts


@njit(cache=True)
def _cut(indptr, indices, slot, n_blocks, width, chunk_of, length, data, root):  # type: ignore[no-untyped-def]
    """Return starts, chunks and values of the pieces for one chunk length, entries scaled by ``root`` of their row."""
    starts = _count_pieces(indptr, indices, slot, n_blocks, width, chunk_of)
    n_pieces = starts[n_blocks]
    chunks = np.empty(n_pieces, dtype=np.int64)
    values = np.zeros((n_pieces, width, length))
    filled = starts[:-1].copy()
    for row in range(len(slot)):
        block, lane = slot[row] // width, slot[row] % width
        for p in range(indptr[row], indptr[row + 1]):
            chunk = chunk_of[indices[p]]
            piece = starts[block]
            while piece < filled[block] and chunks[piece] != chunk:
                piece += 1
            if piece == filled[block]:
                chunks[piece] = chunk
                filled[block] += 1
            values[piece, lane, indices[p] - chunk * length] = root[indices[p]] * data[p]
    return starts, chunks, values
