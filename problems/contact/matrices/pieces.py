"""Force directions as small dense pieces, one for each contact and each chunk of coordinates that it touches.

A chunk is a run of ``length`` degrees of freedom, for example those of a body. A contact touches one or two bodies, so
it has one or two pieces, and kernels over pieces do not need an index for each number. Both W and W̃ = Sᵀ W, with M⁻¹ =
S Sᵀ, are stored in this form.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit, uint64

from ...arrays import FloatArray, IntArray
from ...compilation.interpretation import interpretable
from ..blocks import BlockLayout
from .user_matrices import compressed_columns

CHUNK_LENGTHS = (1, 2, 3, 6)
"""Candidate chunk lengths; 2 and 3 suit discs, and 3 and 6 suit balls, without and with rotation."""

SAMPLED_ROWS = 300
"""Number of rows that are examined to choose the chunk length."""


class BallRecords(NamedTuple):
    """Contacts with friction in space, of two balls or of a ball and a surface, each given by its balls and its normal.

    Attributes:
        chunks: first and second ball of each contact, ``len(radii)`` for a surface, shape (2 · n_contacts,).
        normals: n from the second to the first ball, shape (n_contacts, 3).
        radii: r of all balls [m], shape (n_balls,).
    """

    chunks: IntArray
    normals: FloatArray
    radii: FloatArray


@dataclass(frozen=True, eq=False)
class Pieces:
    """A matrix with a row for each degree of freedom and a column for each lane of each block, in pieces.

    If no block has more than two pieces, pieces may come in pairs: a block with one piece gets a second piece of zeros,
    on the idle chunk ``n_chunks`` after all others. Kernels then treat all blocks alike.

    Attributes:
        starts: first piece of each block, shape (n_blocks + 1,).
        chunks: chunk of each piece, shape (n_pieces,).
        values: the pieces, transposed, shape (n_pieces, width, length); zero on the idle chunk.
        n_chunks: number of chunks, without the idle one.
    """

    starts: IntArray
    chunks: IntArray
    values: FloatArray
    n_chunks: int

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.starts) - 1

    @property
    def width(self) -> int:
        """Number of lanes per block."""
        return int(self.values.shape[1])

    @property
    def length(self) -> int:
        """Number of degrees of freedom per chunk."""
        return int(self.values.shape[2])

    @cached_property
    def in_pairs(self) -> bool:
        """Whether every block has exactly two pieces."""
        return bool((np.diff(self.starts) == 2).all())

    @cached_property
    def loops(self) -> tuple[tuple[int, ...], tuple[int, ...], IntArray, IntArray, FloatArray]:
        """Arguments of kernels: lanes and axes of a piece, starts, chunks, and the flat values.

        Lanes and axes are tuples because the compiler knows their lengths and unrolls loops over them.
        """
        return tuple(range(self.width)), tuple(range(self.length)), self.starts, self.chunks, self.values.reshape(-1)

    @property
    def fills_chunks(self) -> bool:
        """Whether each block is known to have an entry for every degree of freedom of its chunks."""
        return False

    @property
    def balls(self) -> BallRecords | None:
        """The records of contacts between balls; None if the blocks are not given by records."""
        return None

    @property
    def opposite_normals(self) -> FloatArray | None:
        """Normal n of each block, if all blocks are n on the first chunk and −n on the second; else None."""
        return None

    def copy(self) -> "Pieces":
        """Return a copy of the pieces."""
        return Pieces(self.starts.copy(), self.chunks.copy(), self.values.copy(), self.n_chunks)

    def times(self, padded: FloatArray) -> FloatArray:
        """Return the product with a vector over lanes, shape (n_chunks · length,)."""
        product = np.zeros(self.n_chunks * self.length)
        _write_product(*self.loops, self.n_chunks, padded.reshape(-1), product)
        return product

    def transposed_times(self, vector: FloatArray) -> FloatArray:
        """Return the product of the transpose with a vector over degrees of freedom, shape (n_blocks · width,)."""
        product = np.empty(self.n_blocks * self.width)
        _write_transposed_product(*self.loops, self.n_chunks, vector, product)
        return product

    def free_velocity(self, free_motion: FloatArray, velocity: FloatArray, restitution: FloatArray) -> FloatArray:
        """Return Wᵀ u_free + ε Wᵀ u [m/s], shape (n_blocks · width,), with ε of each row."""
        product = self.transposed_times(free_motion)
        product += restitution * self.transposed_times(velocity)
        return product

    def delassus_diagonal(self, inverse_diagonal: FloatArray) -> FloatArray | None:
        """Return the diagonal of G [1/kg], shape (n_rows,), for a diagonal M⁻¹, shape (n_chunks · length,).

        Return None if this requires the pieces of W̃; the diagonal is then their ``square_sums``.
        """
        return None

    def square_sums(self) -> FloatArray:
        """Return the squared norm of each column, shape (n_blocks, width): for W̃ the diagonal of G [1/kg]."""
        sums = np.zeros((self.n_blocks, self.width))
        _write_square_sums(self.starts, self.values, sums)
        return sums

    def scaled(self, root_blocks: FloatArray) -> "Pieces":
        """Return the pieces of Sᵀ W for a block diagonal S.

        Args:
            root_blocks: the blocks of S, shape (n_chunks, length, length), or its diagonal, shape (n_chunks · length,).
        """
        if root_blocks.ndim == 1:
            values = np.empty_like(self.values)
            _write_scaled_by_diagonal(self.chunks, self.values, self.n_chunks, root_blocks, values)
        else:
            values = _scaled_by_blocks(self.chunks, self.values, root_blocks)
        return Pieces(self.starts, self.chunks, values, self.n_chunks)

    def to_csc(self) -> sp.csc_array[Any]:
        """Return the matrix without stored zeros, shape (n_chunks · length, n_blocks · width)."""
        shape = (self.n_chunks * self.length, self.n_blocks * self.width)
        return compressed_columns(_to_columns(self.starts, self.chunks, self.values), shape)


class DeferredPieces(Pieces):
    """Base class of pairs of pieces whose numbers are computed when they are first read.

    Args:
        chunks: chunk of each piece, shape (n_pieces,).
        n_chunks: number of chunks, without the idle one.
        shape: lanes of a block and degrees of freedom of a chunk.
    """

    _shape: tuple[int, int]

    def __init__(self, chunks: IntArray, n_chunks: int, shape: tuple[int, int]) -> None:
        self._set(chunks=chunks, n_chunks=n_chunks, _shape=shape)

    def _set(self, **attributes: Any) -> None:
        for name, value in attributes.items():
            object.__setattr__(self, name, value)

    def _compute(self) -> FloatArray:
        """Return the pieces."""
        raise NotImplementedError

    @cached_property
    def starts(self) -> IntArray:
        """First piece of each block, shape (n_blocks + 1,)."""
        return 2 * np.arange(self.n_blocks + 1)

    @cached_property
    def values(self) -> FloatArray:
        """The pieces, transposed, shape (n_pieces, width, length)."""
        return self._compute()

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.chunks) // 2

    @property
    def width(self) -> int:
        """Number of lanes per block."""
        return self._shape[0]

    @property
    def length(self) -> int:
        """Number of degrees of freedom per chunk."""
        return self._shape[1]

    @property
    def in_pairs(self) -> bool:
        """Whether every block has exactly two pieces."""
        return True

    def scaled(self, root_blocks: FloatArray) -> Pieces:
        """Return the pieces of Sᵀ W for a block diagonal S; see ``Pieces.scaled``."""
        return _ScaledPieces(self, root_blocks)


class _ScaledPieces(DeferredPieces):
    """The pieces of Sᵀ W for a block diagonal S."""

    def __init__(self, unscaled: DeferredPieces, root_blocks: FloatArray) -> None:
        super().__init__(unscaled.chunks, unscaled.n_chunks, (unscaled.width, unscaled.length))
        self._set(_unscaled=unscaled, _root_blocks=root_blocks)

    _unscaled: DeferredPieces
    _root_blocks: FloatArray

    def _compute(self) -> FloatArray:
        return Pieces.scaled(self._unscaled, self._root_blocks).values


def cut_into_pieces(columns: sp.csc_array[Any], root: FloatArray, layout: BlockLayout) -> Pieces:
    """Return the pieces of a matrix with one column per row of a problem, with its rows scaled by ``root``.

    The chunk length minimises the number of values to read plus four per piece. It is determined from the first rows,
    because the contacts of a problem are similar.
    """
    pattern = (columns.indptr, columns.indices, layout.slot, layout.n_blocks, layout.width)
    starts, chunks, values, n_chunks = cut_columns(*pattern, columns.data, root)
    return Pieces(starts, chunks, values, n_chunks)


@njit(cache=True, fastmath={"contract"})
def _write_product(lanes, axes, starts, chunks, values, idle, padded, product):  # type: ignore[no-untyped-def]
    one, width, length = uint64(1), uint64(len(lanes)), uint64(len(axes))
    for i in range(uint64(len(starts) - 1)):
        for p in range(uint64(starts[i]), uint64(starts[i + one])):
            if chunks[p] == idle:
                continue
            chunk, piece = length * uint64(chunks[p]), width * length * p
            for k in range(length):
                total = product[chunk + k]
                for lane in range(width):
                    total += values[piece + length * lane + k] * padded[width * i + lane]
                product[chunk + k] = total


@njit(cache=True, fastmath={"contract"})
def _write_transposed_product(lanes, axes, starts, chunks, values, idle, vector, product):  # type: ignore[no-untyped-def]
    one, width, length = uint64(1), uint64(len(lanes)), uint64(len(axes))
    for i in range(uint64(len(starts) - 1)):
        for lane in range(width):
            total = 0.0
            for p in range(uint64(starts[i]), uint64(starts[i + one])):
                if chunks[p] == idle:
                    continue
                chunk, row = length * uint64(chunks[p]), length * (width * p + lane)
                for k in range(length):
                    total += values[row + k] * vector[chunk + k]
            product[width * i + lane] = total


@njit(cache=True, fastmath={"contract"})
def _write_square_sums(starts, values, sums):  # type: ignore[no-untyped-def]
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            for lane in range(values.shape[1]):
                for k in range(values.shape[2]):
                    entry = values[p, lane, k]
                    # entry**2 would be rounded with the options of the first kernel that computes a power
                    sums[i, lane] += entry * entry


@njit(cache=True)
def _write_scaled_by_diagonal(chunks, values, idle, diagonal, scaled):  # type: ignore[no-untyped-def]
    n_pieces, width, length = values.shape
    for p in range(n_pieces):
        for lane in range(width):
            for k in range(length):
                scaled[p, lane, k] = 0.0 if chunks[p] == idle else values[p, lane, k] * diagonal[length * chunks[p] + k]


@njit(cache=True)
def _scaled_by_blocks(chunks, values, blocks):  # type: ignore[no-untyped-def]
    scaled = np.zeros_like(values)
    n_pieces, width, length = values.shape
    for p in range(n_pieces):
        if chunks[p] == len(blocks):
            continue
        for lane in range(width):
            for k in range(length):
                for m in range(length):
                    scaled[p, lane, k] += values[p, lane, m] * blocks[chunks[p], m, k]
    return scaled


@njit(cache=True, error_model="numpy")
def _cheapest_length(indptr, indices, slot, n_blocks, width, n_dofs):  # type: ignore[no-untyped-def]
    """Return the chunk length with the lowest cost over the first rows."""
    cheapest, lowest_cost = CHUNK_LENGTHS[0], np.inf
    for length in CHUNK_LENGTHS:
        starts = _count_pieces(indptr, indices, slot[:SAMPLED_ROWS], n_blocks, width, length, -(-n_dofs // length))
        cost = starts[n_blocks] * (width * length + 4)
        if cost < lowest_cost:
            cheapest, lowest_cost = length, cost
    return cheapest


@njit(cache=True, error_model="numpy")
def _count_pieces(indptr, indices, slot, n_blocks, width, length, n_chunks):  # type: ignore[no-untyped-def]
    """Return the first piece of each block, shape (n_blocks + 1,), for one chunk length."""
    last_block = np.full(n_chunks, -1, dtype=np.int64)
    starts = np.zeros(n_blocks + 1, dtype=np.int64)
    for row in range(len(slot)):
        block = slot[row] // width
        for p in range(indptr[row], indptr[row + 1]):
            chunk = indices[p] // length
            if last_block[chunk] != block:
                last_block[chunk] = block
                starts[block + 1] += 1
    for block in range(n_blocks):
        starts[block + 1] += starts[block]
    return starts


@interpretable
@njit(cache=True, error_model="numpy")
def cut_columns(indptr, indices, slot, n_blocks, width, data, root):  # type: ignore[no-untyped-def]
    """Return starts, chunks, values and number of chunks of the pieces with the cheapest chunk length.

    Entries are multiplied by ``root`` of their row. Pieces come in pairs if a block has two pieces and none has more.
    """
    length = _cheapest_length(indptr, indices, slot, n_blocks, width, len(root))
    n_chunks = -(-len(root) // length)
    starts = _count_pieces(indptr, indices, slot, n_blocks, width, length, n_chunks)
    max_pieces = 0
    for block in range(n_blocks):
        max_pieces = max(max_pieces, starts[block + 1] - starts[block])
    if max_pieces == 2:
        starts = 2 * np.arange(n_blocks + 1)
    n_pieces = starts[n_blocks]
    chunks = np.full(n_pieces, n_chunks, dtype=np.int64)
    values = np.zeros((n_pieces, width, length))
    filled = starts[:-1].copy()
    for row in range(len(slot)):
        block, lane = slot[row] // width, slot[row] % width
        for p in range(indptr[row], indptr[row + 1]):
            chunk = indices[p] // length
            piece = starts[block]
            while piece < filled[block] and chunks[piece] != chunk:
                piece += 1
            if piece == filled[block]:
                chunks[piece] = chunk
                filled[block] += 1
            values[piece, lane, indices[p] - chunk * length] = root[indices[p]] * data[p]
    return starts, chunks, values, n_chunks


@interpretable
@njit(cache=True)
def _to_columns(starts, chunks, values):  # type: ignore[no-untyped-def]
    """Return the nonzero entries of all columns, their rows, ascending in each column, and the start of each column.

    Entries of a column that lie in the same row are added.
    """
    n_blocks, (_, width, length) = len(starts) - 1, values.shape
    entries, rows = np.empty(values.size), np.empty(values.size, dtype=np.int32)
    ends, count = np.zeros(n_blocks * width + 1, dtype=np.int32), 0
    for block in range(n_blocks):
        for lane in range(width):
            first = count
            for piece in range(starts[block], starts[block + 1]):
                for k in range(length):
                    entry, row = values[piece, lane, k], chunks[piece] * length + k
                    if entry == 0.0:
                        continue
                    position = count
                    while position > first and rows[position - 1] > row:
                        position -= 1
                    if position > first and rows[position - 1] == row:
                        entries[position - 1] += entry
                        continue
                    for later in range(count, position, -1):
                        entries[later], rows[later] = entries[later - 1], rows[later - 1]
                    entries[position], rows[position] = entry, row
                    count += 1
            ends[block * width + lane + 1] = count
    return entries[:count], rows[:count], ends
