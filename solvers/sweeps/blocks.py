"""Block Gauss–Seidel sweeps over the assembled Delassus matrix: contact by contact, each solved exactly.

One sweep visits the contacts in order and replaces the impulse of each by the solution Λ* of its own problem with the
newest impulses of all others (``one_contact``); with relaxation ω it moves to Λ + ω(Λ* − Λ), projected onto its cone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.problem import ContactProblem
from .delassus import block_product
from .one_contact import disc_scale, solve_frictionless, solve_planar, solve_spatial
from .slip_angle import WORKSPACE
from .step_size import diagonal_step_sizes


@dataclass(frozen=True, eq=False)
class BlockSweep:
    """Everything a sweep reads and never writes.

    Attributes:
        layout: the padded blocks.
        matrix: first stored block of each row, first lane of each stored block's column, and the values of G, flat.
        free: c, padded and flat.
        laws: μ of the contact's own normal impulse, μ of another's, a, and the N lane of each block's partner.
        step_sizes: 1/α for the N lane and for the T lanes of each block [kg], shape (n_blocks, 2).
        relaxation: ω.
    """

    layout: BlockLayout
    matrix: tuple[Any, Any, FloatArray]
    free: FloatArray
    laws: tuple[FloatArray, FloatArray, FloatArray, Any]
    step_sizes: FloatArray
    relaxation: float

    @staticmethod
    def over(problem: ContactProblem, relaxation: float) -> "BlockSweep":
        """Return the sweep of ``problem``."""
        layout, blocks = problem.layout, problem.delassus_blocks()
        lanes = (layout.width * blocks.columns).astype(np.uint32)
        matrix = (blocks.starts.astype(np.uint64), lanes, blocks.values.reshape(-1))
        own = layout.partner == np.arange(layout.n_blocks)
        own_friction = np.where(own, layout.friction_coefficient, 0.0)
        remote_friction = layout.friction_coefficient - own_friction
        partner = (layout.width * layout.partner).astype(np.uint64)
        laws = (own_friction, remote_friction, layout.fixed_bound, partner)
        free, sizes = layout.pad(problem.free_velocity).reshape(-1), diagonal_step_sizes(problem, 1.0)
        return BlockSweep(layout, matrix, free, laws, sizes, relaxation)


class BlockIterates:
    """Λ of a block Gauss–Seidel iteration.

    Attributes:
        layout: the padded blocks.
        padded: Λ padded and flat.
        step_sizes: 1/α for the N lane and for the T lanes of each block [kg], shape (n_blocks, 2).
    """

    def __init__(self, sweep: BlockSweep, start: FloatArray) -> None:
        self.layout, self.padded = sweep.layout, sweep.layout.pad(start).reshape(-1)
        self._sweep, self.step_sizes = sweep, sweep.step_sizes
        self._velocity = np.empty_like(self.padded)
        kernel = {1: _sweep_frictionless, 2: _sweep_planar, 3: _sweep_spatial}[sweep.layout.width]
        self._kernel, self._work = kernel, np.empty(WORKSPACE)
        self._relaxation = np.full(sweep.layout.n_blocks, float(sweep.relaxation))

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        own = self._sweep
        self._kernel(count, self._relaxation, *own.matrix, own.free, *own.laws, self.padded, self._work)

    def scale_steps(self, fraction: FloatArray) -> None:
        """Let ω of each block be this fraction of what it was at first, shape (n_blocks,)."""
        self._relaxation[:] = self._sweep.relaxation * fraction

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self.layout.unpad(self.padded)

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        own = self._sweep
        block_product(self.layout.width, *own.matrix, self.padded, own.free, self._velocity)
        return self.layout.unpad(self._velocity)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _sweep_frictionless(  # type: ignore[no-untyped-def]
    count, relaxation, starts, lanes, values, free, friction, remote, fixed, partner, impulses, work
):
    one = uint64(1)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            own, old = values[starts[i]], impulses[i]
            normal = free[i] - own * old
            for p in range(starts[i], starts[i + one]):
                normal += values[p] * impulses[uint64(lanes[p])]
            impulses[i] = max(old + relaxation[i] * (solve_frictionless(own, normal) - old), 0.0)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _sweep_planar(  # type: ignore[no-untyped-def]
    count, relaxation, starts, lanes, values, free, friction, remote, fixed, partner, impulses, work
):
    one, two, three, four = uint64(1), uint64(2), uint64(3), uint64(4)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k, own = two * i, four * starts[i]
            normal, tangent = free[k], free[k + one]
            for p in range(starts[i] + one, starts[i + one]):
                j, v = uint64(lanes[p]), four * p
                n, t = impulses[j], impulses[j + one]
                normal += values[v] * n + values[v + one] * t
                tangent += values[v + two] * n + values[v + three] * t
            nn, nt, tn, tt = values[own], values[own + one], values[own + two], values[own + three]
            old_n, old_t = impulses[k], impulses[k + one]
            bound = fixed[i]
            if remote[i] > 0.0:
                bound += remote[i] * impulses[partner[i]]
            n, t = solve_planar(nn, nt, tn, tt, normal, tangent, friction[i], bound, old_n, old_t)
            if relaxation[i] != 1.0:
                n = max(old_n + relaxation[i] * (n - old_n), 0.0)
                bound += friction[i] * n
                t = min(max(old_t + relaxation[i] * (t - old_t), -bound), bound)
            impulses[k], impulses[k + one] = n, t


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _sweep_spatial(  # type: ignore[no-untyped-def]
    count, relaxation, starts, lanes, values, free, friction, remote, fixed, partner, impulses, work
):
    one, two, three, nine = uint64(1), uint64(2), uint64(3), uint64(9)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k, own = three * i, nine * starts[i]
            normal, first, second = free[k], free[k + one], free[k + two]
            for p in range(starts[i] + one, starts[i + one]):  # the diagonal block comes first
                j, v = uint64(lanes[p]), nine * p
                n, t, s = impulses[j], impulses[j + one], impulses[j + two]
                normal += values[v] * n + values[v + one] * t + values[v + two] * s
                first += values[v + three] * n + values[v + uint64(4)] * t + values[v + uint64(5)] * s
                second += values[v + uint64(6)] * n + values[v + uint64(7)] * t + values[v + uint64(8)] * s
            old_n, old_t, old_s = impulses[k], impulses[k + one], impulses[k + two]
            bound = fixed[i]
            if remote[i] > 0.0:
                bound += remote[i] * impulses[partner[i]]
            block = values[own : own + nine]
            n, t, s = solve_spatial(block, normal, first, second, friction[i], bound, old_n, old_t, old_s, work)
            if relaxation[i] != 1.0:
                n = max(old_n + relaxation[i] * (n - old_n), 0.0)
                bound += friction[i] * n
                t, s = old_t + relaxation[i] * (t - old_t), old_s + relaxation[i] * (s - old_s)
                scale = disc_scale(t, s, bound)
                t *= scale
                s *= scale
            impulses[k], impulses[k + one], impulses[k + two] = n, t, s
