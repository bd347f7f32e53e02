"""The reduced Newton system over bodies: (Ĝ + D) dr = b, where Ĝ = V WᵀM⁻¹W S is never assembled.

V and S are the scales of ``scaled_problem``. With M⁻¹ = T Tᵀ, L = TᵀW S and R = TᵀW V, so that Ĝ = RᵀL,

    (I + L D⁻¹ Rᵀ) v = L D⁻¹ b,      dr = D⁻¹ (b − Rᵀ v)      (Woodbury).

The size of the system is the number of degrees of freedom, for any number of contacts. A contact between two bodies
adds one dense block. Each solution is refined with Ĝ and D.
"""

import numpy as np
from numba import njit

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ..scaled_problem import ScaledProblem
from .block_lu import BlockLU
from .delassus_system import REFINEMENTS
from .small_blocks import invert, times

CORRECTIONS = 1
"""Number of corrections of products with inverses of blocks, which D⁻¹ of sticking contacts and of joints makes
ill-conditioned."""


class BodySystem:
    """L, R and the pattern of one problem, and the factors of I + L D⁻¹ Rᵀ."""

    def __init__(self, problem: ContactProblem, scaled_problem: ScaledProblem) -> None:
        pieces, width, self._lanes = problem.factor_pieces(), problem.layout.width, scaled_problem.lanes
        block = np.repeat(np.arange(pieces.n_blocks), np.diff(pieces.starts))
        self._n_chunks, self._length = pieces.n_chunks, pieces.length
        self._starts, self._chunks = pieces.starts, pieces.chunks
        self._left: FloatArray = pieces.values * self._lanes.to_block(scaled_problem.impulse_scale)[block, :, None]
        self._right: FloatArray = pieces.values * self._lanes.to_block(scaled_problem.velocity_scale)[block, :, None]
        rows, columns, pair_starts, targets = _pattern(self._starts, self._chunks, self._n_chunks)
        self._pairs = (pair_starts, targets, rows[:-1])
        self._blocks = np.empty((len(columns), self._length, self._length))
        self._factors = BlockLU(rows, columns, self._length, CORRECTIONS)
        self._coupled: FloatArray = np.zeros((0, width, width))
        self._inverse, self._sign = self._coupled, 0.0

    @property
    def flops(self) -> float:
        """Multiplications and additions of one factorisation."""
        return self._factors.flops

    def times(self, r: FloatArray) -> FloatArray:
        """Return Ĝ r for r, both of shape (m, w): m cones with w lanes each."""
        return self._lanes.split_from_block(self._pull(self._push(self._lanes.to_block(r))))

    def factorise(self, coupled: FloatArray) -> bool:
        """Factorise for D of shape (m, w, w); return False if D or I + L D⁻¹ Rᵀ is singular."""
        self._coupled = self._lanes.matrices_to_block(coupled)
        self._inverse = np.empty_like(self._coupled)
        self._sign = invert(self._coupled, self._inverse)
        if self._sign == 0.0:
            return False
        _assemble(self._starts, self._left, self._right, self._inverse, *self._pairs, self._blocks)
        return self._factors.factorise(self._blocks)

    def determinant_sign(self) -> float:
        """Return the sign of det (Ĝ + D) = det D · det (I + L D⁻¹ Rᵀ)."""
        return self._sign * self._factors.determinant_sign()

    def solve(self, right: FloatArray, refinements: int = REFINEMENTS) -> FloatArray:
        """Return dr for a right-hand side, both of shape (m, w)."""
        b = self._lanes.sum_to_block(right)
        dr, remainder = np.zeros_like(b), b
        for refinement in range(refinements + 1):
            v = self._factors.solve(self._push(times(self._inverse, remainder)))
            dr += times(self._inverse, remainder - self._pull(v))
            if refinement < refinements:
                remainder = b - self._pull(self._push(dr)) - times(self._coupled, dr)
        return self._lanes.from_block(dr)

    def _push(self, lanes: FloatArray) -> FloatArray:
        """Return L x over degrees of freedom."""
        product: FloatArray = _push(self._starts, self._chunks, self._n_chunks, self._left, np.ascontiguousarray(lanes))
        return product

    def _pull(self, velocity: FloatArray) -> FloatArray:
        """Return Rᵀ v over the lanes of blocks."""
        product: FloatArray = _pull(self._starts, self._chunks, self._n_chunks, self._right, velocity)
        return product


@njit(cache=True)
def _pattern(starts, chunks, n_chunks):  # type: ignore[no-untyped-def]
    """Return the block rows over chunks, diagonal first, and the block to which each pair of pieces adds."""
    n = len(starts) - 1
    chunk_starts = np.zeros(n_chunks + 2, dtype=np.int64)
    for p in range(len(chunks)):
        if chunks[p] < n_chunks:
            chunk_starts[chunks[p] + 1] += 1
    for chunk in range(n_chunks):
        chunk_starts[chunk + 1] += chunk_starts[chunk]
    contact_of, piece_of, next_index = np.empty_like(chunks), np.empty_like(chunks), chunk_starts[:-1].copy()
    pair_starts, max_blocks = np.zeros(n + 1, dtype=np.int64), n_chunks
    for i in range(n):
        count = starts[i + 1] - starts[i]
        pair_starts[i + 1] = pair_starts[i] + count * count
        for p in range(starts[i], starts[i + 1]):
            if chunks[p] < n_chunks:
                contact_of[next_index[chunks[p]]], piece_of[next_index[chunks[p]]] = i, p
                next_index[chunks[p]] += 1
    max_blocks += pair_starts[n]
    rows, columns = np.zeros(n_chunks + 1, dtype=np.int64), np.empty(max_blocks, dtype=np.int64)
    targets, position, end = np.full(pair_starts[n], -1, dtype=np.int64), np.full(n_chunks, -1, dtype=np.int64), 0
    for chunk in range(n_chunks):
        begin = end
        columns[end] = chunk
        position[chunk] = end
        end += 1
        for m in range(chunk_starts[chunk], chunk_starts[chunk + 1]):
            i = contact_of[m]
            count = starts[i + 1] - starts[i]
            for k in range(count):
                other = chunks[starts[i] + k]
                if other >= n_chunks:
                    continue
                if position[other] < begin:
                    position[other] = end
                    columns[end] = other
                    end += 1
                targets[pair_starts[i] + (piece_of[m] - starts[i]) * count + k] = position[other]
        rows[chunk + 1] = end
    return rows, columns[:end], pair_starts, targets


@njit(cache=True)
def _assemble(starts, left, right, inverse, pair_starts, targets, diagonal, blocks):  # type: ignore[no-untyped-def]
    """Write I + L D⁻¹ Rᵀ in blocks of the pattern."""
    width, length = left.shape[1], left.shape[2]
    blocks[:] = 0.0
    for chunk in range(len(diagonal)):
        for k in range(length):
            blocks[diagonal[chunk], k, k] = 1.0
    product = np.empty((width, length))
    for i in range(len(starts) - 1):
        count = starts[i + 1] - starts[i]
        for k in range(count):
            piece = right[starts[i] + k]
            for lane in range(width):
                for axis in range(length):
                    product[lane, axis] = 0.0
                    for other in range(width):
                        product[lane, axis] += inverse[i, lane, other] * piece[other, axis]
            for m in range(count):
                target = targets[pair_starts[i] + m * count + k]
                if target < 0:
                    continue
                for row in range(length):
                    for axis in range(length):
                        total = 0.0
                        for lane in range(width):
                            total += left[starts[i] + m, lane, row] * product[lane, axis]
                        blocks[target, row, axis] += total


@njit(cache=True)
def _push(starts, chunks, n_chunks, left, lanes):  # type: ignore[no-untyped-def]
    width, length = left.shape[1], left.shape[2]
    product = np.zeros(n_chunks * length)
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            if chunks[p] < n_chunks:
                for lane in range(width):
                    for k in range(length):
                        product[chunks[p] * length + k] += left[p, lane, k] * lanes[i, lane]
    return product


@njit(cache=True)
def _pull(starts, chunks, n_chunks, right, velocity):  # type: ignore[no-untyped-def]
    width, length = right.shape[1], right.shape[2]
    product = np.zeros((len(starts) - 1, width))
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            if chunks[p] < n_chunks:
                for lane in range(width):
                    for k in range(length):
                        product[i, lane] += right[p, lane, k] * velocity[chunks[p] * length + k]
    return product
