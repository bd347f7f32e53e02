"""Block Gauss–Seidel sweeps over the assembled Delassus matrix: contact by contact, each solved exactly.

One sweep visits the contacts in order and replaces the impulse of each by the solution Λ* of its own problem with the
newest impulses of all others (``one_contact``); with relaxation ω it moves to Λ + ω(Λ* − Λ), projected onto its cone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from .delassus import DelassusState, FlatDelassus, law_arguments, planar_velocity, spatial_velocity
from .one_contact import disc_scale, solve_frictionless, solve_planar, solve_spatial
from .slip_angle import WORKSPACE
from .step_size import diagonal_step_sizes


@dataclass(frozen=True, eq=False)
class BlockSweep:
    """Everything a sweep reads and never writes.

    Attributes:
        delassus: G and c.
        laws: μ of the contact's own normal impulse, μ of another's, a, and the N lane of each block's partner.
        step_sizes: 1/α for the N lane and for the T lanes of each block [kg], shape (n_blocks, 2).
        relaxation: ω.
    """

    delassus: FlatDelassus
    laws: tuple[FloatArray, FloatArray, FloatArray, Any]
    step_sizes: FloatArray
    relaxation: float

    @staticmethod
    def over(problem: ContactProblem, relaxation: float) -> "BlockSweep":
        """Return the sweep of ``problem``."""
        layout, sizes = problem.layout, diagonal_step_sizes(problem, 1.0)
        own = layout.partner == np.arange(layout.n_blocks)
        own_friction = np.where(own, layout.friction_coefficient, 0.0)
        laws = (own_friction, layout.friction_coefficient - own_friction, *law_arguments(layout, sizes)[2:])
        return BlockSweep(FlatDelassus.of(problem), laws, sizes, relaxation)


class BlockIterates(DelassusState):
    """Λ of a block Gauss–Seidel iteration.

    Attributes:
        step_sizes: 1/α for the N lane and for the T lanes of each block [kg], shape (n_blocks, 2).
    """

    def __init__(self, sweep: BlockSweep, start: FloatArray) -> None:
        super().__init__(sweep.delassus, start)
        self._sweep, self.step_sizes = sweep, sweep.step_sizes
        self._kernel = (_sweep_frictionless, _sweep_planar, _sweep_spatial)[self.layout.width - 1]
        self._work = np.empty(WORKSPACE)
        self._relaxation = np.full(self.layout.n_blocks, float(sweep.relaxation))

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        arrays = (*self._delassus.arrays, *self._sweep.laws, self.padded, self._work)
        self._kernel(count, self._relaxation, *arrays)

    def scale_steps(self, fraction: FloatArray) -> None:
        """Let ω of each block be this fraction of what it was at first, shape (n_blocks,)."""
        self._relaxation[:] = self._sweep.relaxation * fraction


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
            normal, tangent = planar_velocity(i, 1, starts, lanes, values, free, impulses)
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
            normal, first, second = spatial_velocity(i, 1, starts, lanes, values, free, impulses)
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
