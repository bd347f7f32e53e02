"""Gauss–Seidel sweeps over the factors: G = W̃ᵀ W̃ is never assembled.

With M⁻¹ = S Sᵀ and W̃ = Sᵀ W, the sweep keeps the scaled velocity v = W̃ Λ up to date, so that a contact costs only
the degrees of freedom that it touches:

    ξ_i = W̃_iᵀ v + c_i,      Λ_i ← prox_{C_i}(Λ_i − r_i ξ_i),      v ← v + W̃_i ΔΛ_i.

W̃ serves for reading and for writing, which halves the memory that W and M⁻¹ W would need. Degrees of freedom are cut
into chunks of equal length (a body's, where bodies have equally many), and each contact holds one dense piece of W̃ for
each chunk it touches.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from ...problems.blocks import BlockLayout
from ...problems.contact import ContactProblem
from ...problems.factors import Factors
from ...problems.laws import FloatArray
from .projection import disc_scale

CHUNK_LENGTHS = (1, 2, 3, 6)
"""Chunk lengths to choose from: the degrees of freedom of discs and balls, without and with rotation."""


@dataclass(frozen=True, eq=False)
class FactorSweep:
    """Everything a sweep reads and never writes.

    Attributes:
        layout: the padded blocks.
        starts: first piece of each block, shape (n_blocks + 1,).
        chunks: chunk of each piece, shape (n_pieces,).
        pieces: the pieces of W̃, shape (n_pieces, width, chunk length).
        n_chunks: number of chunks.
        free: c, padded.
        laws: step sizes, μ, a and partner of each block.
        coupling: G_T1N and G_T2N of each block's own diagonal block, shape (n_blocks, 2).
        kernel: the sweep for this width.
    """

    layout: BlockLayout
    starts: Any
    chunks: Any
    pieces: FloatArray
    n_chunks: int
    free: FloatArray
    laws: tuple[FloatArray, FloatArray, FloatArray, Any]
    coupling: FloatArray
    kernel: Callable[..., None]

    @staticmethod
    def over(problem: ContactProblem, factors: Factors, sizes: FloatArray) -> "FactorSweep":
        """Return the sweep of ``problem`` with step sizes of shape (n_blocks, 2)."""
        layout, scaled = problem.layout, factors.scaled_directions
        arrays = (scaled.indptr, scaled.indices, scaled.data, layout.slot, layout.n_blocks, layout.width)
        length = _chunk_length(*arrays)
        starts, chunks, pieces = _cut(*arrays, length)
        kernel = {1: _sweep_frictionless, 2: _sweep_planar, 3: _sweep_spatial}[layout.width]
        laws = (sizes, layout.friction_coefficient, layout.fixed_bound, layout.partner)
        n_chunks = -(-factors.n_dofs // length)
        free = layout.pad(problem.free_velocity)
        coupling = _own_coupling(starts, pieces)
        return FactorSweep(layout, starts, chunks, pieces, n_chunks, free, laws, coupling, kernel)

    def begin(self, start: FloatArray) -> "FactorIterates":
        """Return the iterates that begin at ``start``, shape (n_rows,)."""
        return FactorIterates(self, self.layout.pad(start))


class FactorIterates:
    """Λ and v = W̃ Λ of a Gauss–Seidel iteration, in padded blocks and chunks."""

    def __init__(self, sweep: FactorSweep, padded: FloatArray) -> None:
        self._sweep = sweep
        self._impulses = padded
        self._relative = np.empty_like(padded)
        self._scaled = np.zeros((sweep.n_chunks, sweep.pieces.shape[2]))
        _scaled_velocity(sweep.starts, sweep.chunks, sweep.pieces, padded, self._scaled)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        own = self._sweep
        own.kernel(
            count, own.starts, own.chunks, own.pieces, own.free, *own.laws, own.coupling, self._impulses, self._scaled
        )

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._sweep.layout.unpad(self._impulses)

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        own = self._sweep
        _relative_velocity(own.starts, own.chunks, own.pieces, own.free, self._scaled, self._relative)
        return own.layout.unpad(self._relative)


def _chunk_length(indptr: Any, indices: Any, data: Any, slot: Any, n_blocks: int, width: int) -> int:
    """Return the chunk length that makes a sweep cheapest: numbers read, plus two for the handling of each piece."""
    cost = {
        length: int(_count_pieces(indptr, indices, slot, n_blocks, width, length)[-1]) * (width * length + 2)
        for length in CHUNK_LENGTHS
    }
    return min(cost, key=lambda length: cost[length])


@njit(cache=True)
def _count_pieces(indptr, indices, slot, n_blocks, width, length):  # type: ignore[no-untyped-def]
    """Return the first piece of each block, shape (n_blocks + 1,)."""
    highest = 0
    for p in range(len(indices)):
        highest = max(highest, indices[p])
    last_block = np.full(highest // length + 1, -1, dtype=np.int64)
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


@njit(cache=True)
def _cut(indptr, indices, data, slot, n_blocks, width, length):  # type: ignore[no-untyped-def]
    """Return starts, chunks and pieces of W̃ for one chunk length."""
    starts = _count_pieces(indptr, indices, slot, n_blocks, width, length)
    n_pieces = starts[n_blocks]
    chunks = np.empty(n_pieces, dtype=np.int32)
    pieces = np.zeros((n_pieces, width, length))
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
            pieces[piece, lane, indices[p] % length] = data[p]
    return starts, chunks, pieces


@njit(cache=True)
def _own_coupling(starts, pieces):  # type: ignore[no-untyped-def]
    """G_T1N and G_T2N of every block."""
    coupling = np.zeros((len(starts) - 1, 2))
    _, width, length = pieces.shape
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            for lane in range(1, width):
                for k in range(length):
                    coupling[i, lane - 1] += pieces[p, lane, k] * pieces[p, 0, k]
    return coupling


@njit(cache=True)
def _scaled_velocity(starts, chunks, pieces, impulses, scaled):  # type: ignore[no-untyped-def]
    """Write v = W̃ Λ."""
    _, width, length = pieces.shape
    scaled[:] = 0.0
    for i in range(len(impulses)):
        for p in range(starts[i], starts[i + 1]):
            for lane in range(width):
                for k in range(length):
                    scaled[chunks[p], k] += pieces[p, lane, k] * impulses[i, lane]


@njit(cache=True, fastmath={"contract"})
def _relative_velocity(starts, chunks, pieces, free, scaled, relative):  # type: ignore[no-untyped-def]
    """Write ξ = W̃ᵀ v + c in padded blocks."""
    _, width, length = pieces.shape
    for i in range(len(relative)):
        for lane in range(width):
            total = free[i, lane]
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    total += pieces[p, lane, k] * scaled[chunks[p], k]
            relative[i, lane] = total


@njit(cache=True, fastmath={"contract"})
def _sweep_frictionless(  # type: ignore[no-untyped-def]
    count, starts, chunks, pieces, free, sizes, friction, fixed, partner, coupling, impulses, scaled
):
    length = scaled.shape[1]
    for _ in range(count):
        for i in range(len(impulses)):
            normal = free[i, 0]
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    normal += pieces[p, 0, k] * scaled[chunks[p], k]
            old = impulses[i, 0]
            impulses[i, 0] = max(old - sizes[i, 0] * normal, 0.0)
            change = impulses[i, 0] - old
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    scaled[chunks[p], k] += pieces[p, 0, k] * change


@njit(cache=True, fastmath={"contract"})
def _sweep_planar(  # type: ignore[no-untyped-def]
    count, starts, chunks, pieces, free, sizes, friction, fixed, partner, coupling, impulses, scaled
):
    length = scaled.shape[1]
    for _ in range(count):
        for i in range(len(impulses)):
            normal, tangent = free[i, 0], free[i, 1]
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    v = scaled[chunks[p], k]
                    normal += pieces[p, 0, k] * v
                    tangent += pieces[p, 1, k] * v
            old_n, old_t = impulses[i, 0], impulses[i, 1]
            new = max(old_n - sizes[i, 0] * normal, 0.0)
            impulses[i, 0] = new
            change_n = new - old_n
            tangent += coupling[i, 0] * change_n
            bound = fixed[i] + friction[i] * impulses[partner[i], 0]
            impulses[i, 1] = min(max(old_t - sizes[i, 1] * tangent, -bound), bound)
            change_t = impulses[i, 1] - old_t
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    scaled[chunks[p], k] += pieces[p, 0, k] * change_n + pieces[p, 1, k] * change_t


@njit(cache=True, fastmath={"contract"})
def _sweep_spatial(  # type: ignore[no-untyped-def]
    count, starts, chunks, pieces, free, sizes, friction, fixed, partner, coupling, impulses, scaled
):
    length = scaled.shape[1]
    for _ in range(count):
        for i in range(len(impulses)):
            normal, first, second = free[i, 0], free[i, 1], free[i, 2]
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    v = scaled[chunks[p], k]
                    normal += pieces[p, 0, k] * v
                    first += pieces[p, 1, k] * v
                    second += pieces[p, 2, k] * v
            old_n, old_t, old_s = impulses[i, 0], impulses[i, 1], impulses[i, 2]
            new = max(old_n - sizes[i, 0] * normal, 0.0)
            impulses[i, 0] = new
            change_n = new - old_n
            first += coupling[i, 0] * change_n
            second += coupling[i, 1] * change_n
            bound = fixed[i] + friction[i] * impulses[partner[i], 0]
            x = old_t - sizes[i, 1] * first
            y = old_s - sizes[i, 1] * second
            scale = disc_scale(x, y, bound)
            impulses[i, 1] = x * scale
            impulses[i, 2] = y * scale
            change_t, change_s = x * scale - old_t, y * scale - old_s
            for p in range(starts[i], starts[i + 1]):
                for k in range(length):
                    scaled[chunks[p], k] += (
                        pieces[p, 0, k] * change_n + pieces[p, 1, k] * change_t + pieces[p, 2, k] * change_s
                    )
