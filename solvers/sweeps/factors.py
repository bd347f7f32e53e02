"""Gauss–Seidel sweeps over the factors: G = W̃ᵀ W̃ is never assembled.

With M⁻¹ = S Sᵀ and W̃ = Sᵀ W, the sweep updates the scaled velocity v = W̃ Λ. The work for a contact then depends only
on the degrees of freedom that it touches:

    ξ_i = W̃_iᵀ v + c_i,      Λ_i ← prox_{C_i}(Λ_i − r_i ξ_i),      v ← v + W̃_i ΔΛ_i.

The sweep uses W̃ both to compute ξ and to update v, and needs half the memory of W and M⁻¹ W. A specialised kernel for
contacts between two bodies has no loop over pieces of W̃; many such contacts are swept in batches.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.matrices.pieces import Pieces
from ...problems.contact.problem import ContactProblem
from ..iteration.loop import Iterates
from ..iteration.momentum import MomentumState, with_momentum
from .any_laws import AnyLawArrays, sweep_factors
from .batches.lanes import LANES
from .batches.pieces import MIN_FILL, assign_batches, batch_arguments, slots_in_batches, sweep_batches
from .delassus import LawArrays
from .one_contact import disc_scale


@dataclass(frozen=True, eq=False)
class FactorSweep:
    """The constant data of a sweep.

    Attributes:
        layout: the padded blocks.
        pieces: W̃ in pieces.
        kernel: does sweeps; its arguments are their number, ``arguments``, Λ and v, and more for ``sweep_batches``.
        arguments: constant arguments of the kernel.
        product: writes ξ from v; its arguments are ``factor``, c, v and ξ.
        factor: W̃ as the product reads it.
        free_velocity: c, padded and flat.
        slots: position of each entry of padded Λ in the kernel's order, None if the order is the same.
        n_impulses: length of Λ in the kernel's order.
    """

    layout: BlockLayout
    pieces: Pieces
    kernel: Callable[..., Any]
    arguments: tuple[Any, ...]
    product: Callable[..., None]
    factor: tuple[Any, ...]
    free_velocity: FloatArray
    slots: IntArray | None
    n_impulses: int

    @staticmethod
    def over(problem: ContactProblem, step_sizes: FloatArray) -> "FactorSweep":
        """Return the sweep of ``problem``, which holds factors, with step sizes as in ``step_size``.

        Specialised kernels sweep over spatial contacts of two bodies, or of a body and the ground, in batches if few
        lanes stay empty.
        """
        layout, pieces = problem.layout, problem.factor_pieces()
        free_velocity = layout.pad(problem.free_velocity).reshape(-1)
        if not layout.has_contacts_only:
            factor = (layout.width, pieces.starts.astype(np.uint64), pieces.chunks.astype(np.uint64), pieces.values)
            arguments: tuple[Any, ...] = (
                pieces.starts,
                pieces.chunks,
                pieces.values,
                free_velocity,
                *AnyLawArrays.of(layout, step_sizes),
            )
            return FactorSweep(
                layout,
                pieces,
                sweep_factors,
                arguments,
                _write_product,
                factor,
                free_velocity,
                None,
                len(free_velocity),
            )
        laws = LawArrays.of(layout, step_sizes)
        coupling = own_coupling(pieces.starts, pieces.values).reshape(-1)
        if layout.width != 3 or not pieces.in_pairs:
            factor = (layout.width, pieces.starts.astype(np.uint64), pieces.chunks.astype(np.uint64), pieces.values)
            arguments = (*factor, free_velocity, *laws, coupling)
            return FactorSweep(
                layout, pieces, _sweep, arguments, _write_product, factor, free_velocity, None, len(free_velocity)
            )
        product = (_write_product_of_spatial_pairs, _pairs(pieces), free_velocity)
        batches = assign_batches(pieces)
        n_lanes = LANES * batches.n_batches
        if len(batches.positions) < MIN_FILL * n_lanes or not layout.bounds_are_own:
            arguments = (*_pairs(pieces), free_velocity, *laws, coupling)
            return FactorSweep(layout, pieces, _sweep_spatial_pairs, arguments, *product, None, len(free_velocity))
        arguments = batch_arguments(pieces, batches, free_velocity, laws[:3], coupling)
        slots, n_impulses = slots_in_batches(batches.positions), 3 * n_lanes
        return FactorSweep(layout, pieces, sweep_batches, arguments, *product, slots, n_impulses)

    def begin(self, start: FloatArray, momentum: float = 0.0, delay: float = 0.0) -> Iterates:
        """Return the iterates that begin at ``start``, shape (n_rows,); see ``MomentumState``."""
        if self.slots is not None:
            return BatchIterates(self, start, momentum, delay)
        iterates = FactorIterates if self.layout.has_contacts_only else AnyLawIterates
        return with_momentum(iterates(self, start), momentum, delay)


class FactorIterates:
    """Λ, in the kernel's order, and v = W̃ Λ of a Gauss–Seidel iteration."""

    def __init__(self, sweep: FactorSweep, start: FloatArray) -> None:
        self._sweep = sweep
        layout, pieces = sweep.layout, sweep.pieces
        padded = layout.pad(start).reshape(-1)
        self._relative_velocity = np.empty_like(padded)
        idle_length = pieces.length
        self._state = np.zeros(sweep.n_impulses + pieces.n_chunks * pieces.length + idle_length)
        self._impulses, self._scaled_velocity = self._state[: sweep.n_impulses], self._state[sweep.n_impulses :]
        self._impulses[slice(None) if sweep.slots is None else sweep.slots] = padded
        self._scaled_velocity[:-idle_length] = pieces.times(padded)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        self._sweep.kernel(count, *self._sweep.arguments, self._impulses, self._scaled_velocity)

    def linear_state(self) -> tuple[FloatArray, int]:
        """Return Λ followed by v, and the length of Λ; see ``LinearIterates``."""
        return self._state, len(self._impulses)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        slots = self._sweep.slots
        return self._sweep.layout.unpad(self._impulses if slots is None else self._impulses[slots])

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        sweep = self._sweep
        sweep.product(*sweep.factor, sweep.free_velocity, self._scaled_velocity, self._relative_velocity)
        return sweep.layout.rows_of(self._relative_velocity)


class AnyLawIterates(FactorIterates):
    """``FactorIterates`` with joints or rolling friction: v is recomputed whenever ξ is read.

    Nothing bounds the impulses of joints. With momentum, those of redundant joints grow and shrink by many orders of
    magnitude, and rounding errors of their largest values would remain in v.
    """

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        pieces = self._sweep.pieces
        self._scaled_velocity[: -pieces.length] = pieces.times(self._impulses)
        return super().relative_velocity()


class BatchIterates(FactorIterates, MomentumState):
    """``FactorIterates`` for sweeps in batches, whose kernel includes the momentum."""

    def __init__(self, sweep: FactorSweep, start: FloatArray, momentum: float, delay: float = 0.0) -> None:
        FactorIterates.__init__(self, sweep, start)
        MomentumState.__init__(self, momentum, delay)
        self._change = np.zeros_like(self._impulses)
        self._previous_velocity = self._scaled_velocity.copy() if momentum > 0.0 else self._scaled_velocity

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        arrays = (self._impulses, self._scaled_velocity, self._change, self._previous_velocity)
        sweep, momentum = self._sweep, (self._momentum, self._delay, self._sweeps)
        self._beta = sweep.kernel(count, *sweep.arguments, *arrays, *momentum, self._beta)
        self._sweeps += count


def _pairs(pieces: Pieces) -> tuple[Any, Any, FloatArray]:
    """Return the axes of a chunk, the first coordinate of each piece, and the flat pieces, two per block.

    The axes are a tuple of known length, so that the compiler unrolls loops over it.
    """
    first_dofs = (pieces.length * pieces.chunks).astype(np.uint64)
    return tuple(np.arange(pieces.length, dtype=np.uint64)), first_dofs, pieces.values.reshape(-1)


@njit(cache=True)
def own_coupling(starts, pieces):  # type: ignore[no-untyped-def]
    """Return G_T1N and G_T2N of every block, shape (n_blocks, 2)."""
    coupling = np.zeros((len(starts) - 1, 2))
    _, width, length = pieces.shape
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            for lane in range(1, width):
                for k in range(length):
                    coupling[i, lane - 1] += pieces[p, lane, k] * pieces[p, 0, k]
    return coupling


@njit(cache=True, fastmath={"contract"})
def _write_product(width, starts, chunks, pieces, free_velocity, scaled_velocity, relative_velocity):  # type: ignore[no-untyped-def]
    """Write ξ = W̃ᵀ v + c for blocks of any width with any number of pieces."""
    one, lanes, length = uint64(1), uint64(width), uint64(pieces.shape[2])
    for i in range(uint64(len(starts) - 1)):
        for lane in range(lanes):
            total = free_velocity[lanes * i + lane]
            for p in range(starts[i], starts[i + one]):
                for k in range(length):
                    total += pieces[p, lane, k] * scaled_velocity[length * chunks[p] + k]
            relative_velocity[lanes * i + lane] = total


@njit(cache=True, fastmath={"contract"})
def _write_product_of_spatial_pairs(axes, first_dofs, pieces, free_velocity, scaled_velocity, relative_velocity):  # type: ignore[no-untyped-def]
    """Write ξ = W̃ᵀ v + c for spatial contacts between two bodies, or one body and the ground."""
    one, two, three, length = uint64(1), uint64(2), uint64(3), uint64(len(axes))
    for i in range(uint64(len(first_dofs)) // two):
        k = three * i
        normal, first, second = free_velocity[k], free_velocity[k + one], free_velocity[k + two]
        for body in range(two):
            begin, piece_start = first_dofs[two * i + body], three * length * (two * i + body)
            for x in range(length):
                v = scaled_velocity[begin + x]
                normal += pieces[piece_start + x] * v
                first += pieces[piece_start + length + x] * v
                second += pieces[piece_start + two * length + x] * v
        relative_velocity[k], relative_velocity[k + one], relative_velocity[k + two] = normal, first, second


@njit(cache=True, fastmath={"contract"})
def _sweep(  # type: ignore[no-untyped-def]
    count,
    width,
    starts,
    chunks,
    pieces,
    free_velocity,
    step_sizes,
    friction,
    fixed_bound,
    partner,
    coupling,
    impulses,
    scaled_velocity,
):
    """Sweep over blocks of any width with any number of pieces."""
    one, two, lanes, length = uint64(1), uint64(2), uint64(width), uint64(pieces.shape[2])
    xi, old = np.empty(3), np.empty(3)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k = lanes * i
            for lane in range(lanes):
                xi[lane] = free_velocity[k + lane]
                old[lane] = impulses[k + lane]
                for p in range(starts[i], starts[i + one]):
                    chunk = length * chunks[p]
                    for a in range(length):
                        xi[lane] += pieces[p, lane, a] * scaled_velocity[chunk + a]
            impulses[k] = max(old[0] - step_sizes[two * i] * xi[0], 0.0)
            if width > 1:
                change = impulses[k] - old[0]
                bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
                x = old[1] - step_sizes[two * i + one] * (xi[1] + coupling[two * i] * change)
                if width == 2:
                    impulses[k + one] = min(max(x, -bound), bound)
                else:
                    y = old[2] - step_sizes[two * i + one] * (xi[2] + coupling[two * i + one] * change)
                    scale = disc_scale(x, y, bound)
                    impulses[k + one], impulses[k + two] = x * scale, y * scale
            for lane in range(lanes):
                change = impulses[k + lane] - old[lane]
                for p in range(starts[i], starts[i + one]):
                    chunk = length * chunks[p]
                    for a in range(length):
                        scaled_velocity[chunk + a] += pieces[p, lane, a] * change


@njit(cache=True, fastmath={"contract"})
def _sweep_spatial_pairs(  # type: ignore[no-untyped-def]
    count,
    axes,
    first_dofs,
    pieces,
    free_velocity,
    step_sizes,
    friction,
    fixed_bound,
    partner,
    coupling,
    impulses,
    scaled_velocity,
):
    """Sweep over spatial contacts between two bodies, or one body and the ground."""
    one, two, length = uint64(1), uint64(2), uint64(len(axes))
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k, piece_start = uint64(3) * i, uint64(6) * length * i
            a, b = first_dofs[two * i], first_dofs[two * i + one]
            normal, first, second = free_velocity[k], free_velocity[k + one], free_velocity[k + two]
            normal_a, first_a, second_a = 0.0, 0.0, 0.0
            for x in range(length):
                va, vb, entry = scaled_velocity[a + x], scaled_velocity[b + x], piece_start + x
                normal += pieces[entry + uint64(3) * length] * vb
                first += pieces[entry + uint64(4) * length] * vb
                second += pieces[entry + uint64(5) * length] * vb
                normal_a += pieces[entry] * va
                first_a += pieces[entry + length] * va
                second_a += pieces[entry + two * length] * va
            old_n, old_t1, old_t2 = impulses[k], impulses[k + one], impulses[k + two]
            new = max(old_n - step_sizes[two * i] * (normal + normal_a), 0.0)
            impulses[k] = new
            dn = new - old_n
            first += first_a + coupling[two * i] * dn
            second += second_a + coupling[two * i + one] * dn
            bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
            t1 = old_t1 - step_sizes[two * i + one] * first
            t2 = old_t2 - step_sizes[two * i + one] * second
            scale = disc_scale(t1, t2, bound)
            t1 *= scale
            t2 *= scale
            impulses[k + one], impulses[k + two] = t1, t2
            dt1, dt2 = t1 - old_t1, t2 - old_t2
            for x in range(length):
                entry = piece_start + x
                scaled_velocity[a + x] = (
                    scaled_velocity[a + x]
                    + pieces[entry] * dn
                    + pieces[entry + length] * dt1
                    + pieces[entry + two * length] * dt2
                )
            for x in range(length):
                entry = piece_start + x + uint64(3) * length
                scaled_velocity[b + x] = (
                    scaled_velocity[b + x]
                    + pieces[entry] * dn
                    + pieces[entry + length] * dt1
                    + pieces[entry + two * length] * dt2
                )
