"""Block Gauss–Seidel sweeps over the assembled Delassus matrix, which solve one contact after the other exactly.

One sweep visits the contacts in order. For each it computes the solution Λ* with the newest impulses of the other
contacts fixed (``one_contact``), and moves Λ to Λ + ω(Λ* − Λ), projected onto the cone; ω is the relaxation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from .any_laws import AnyLawArrays, into_ball, velocity_of_block
from .delassus import DelassusState, FlatDelassus, LawArrays, planar_velocity, spatial_velocity
from .one_contact import disc_scale, solve_frictionless, solve_planar, solve_spatial
from .rolling_contact import solve_rolling
from .slip_angle import WORKSPACE
from .step_size import diagonal_step_sizes


@dataclass(frozen=True, eq=False)
class BlockSweep:
    """The constant data of a sweep.

    Attributes:
        delassus: G and c.
        laws: μ for the contact's own normal impulse and μ for that of another contact, then ``LawArrays`` or
            ``AnyLawArrays`` without step sizes and friction.
        step_sizes: 1/α for the lanes of each block [kg], as in ``step_size``.
        relaxation: ω.
    """

    delassus: FlatDelassus
    laws: tuple[Any, ...]
    step_sizes: FloatArray
    relaxation: float

    @staticmethod
    def over(problem: ContactProblem, relaxation: float) -> "BlockSweep":
        """Return the sweep of ``problem``."""
        layout, sizes = problem.layout, diagonal_step_sizes(problem, 1.0)
        own_friction, remote = _split_friction(layout.friction_coefficient, layout.partner)
        laws = (LawArrays if layout.has_contacts_only else AnyLawArrays).of(layout, sizes)
        return BlockSweep(FlatDelassus.of(problem), (own_friction, remote, *laws[2:]), sizes, relaxation)


@njit(cache=True)
def _split_friction(friction, partner):  # type: ignore[no-untyped-def]
    """Return μ of each contact's own normal impulse, and μ of another contact's."""
    own, remote = np.zeros_like(friction), np.zeros_like(friction)
    for i in range(len(friction)):
        if partner[i] == i:
            own[i] = friction[i]
        else:
            remote[i] = friction[i]
    return own, remote


class BlockIterates(DelassusState):
    """Λ of a block Gauss–Seidel iteration.

    Attributes:
        step_sizes: 1/α for the lanes of each block [kg], as in ``step_size``.
    """

    def __init__(self, sweep: BlockSweep, start: FloatArray) -> None:
        super().__init__(sweep.delassus, start)
        self._sweep, self.step_sizes = sweep, sweep.step_sizes
        self._kernel: Callable[..., None] = _sweep_any
        if self.layout.has_contacts_only:
            self._kernel = (_sweep_frictionless, _sweep_planar, _sweep_spatial)[self.layout.width - 1]
        self._work = np.empty(WORKSPACE)
        self._relaxation = np.full(self.layout.n_blocks, float(sweep.relaxation))
        self._arguments = (self._relaxation, *self._delassus.arrays, *sweep.laws, self.padded, self._work)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        self._kernel(count, *self._arguments)

    def scale_steps(self, fraction: FloatArray) -> None:
        """Set ω of each block to this fraction of its initial value, shape (n_blocks,)."""
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


@njit(cache=True, error_model="numpy")
def _sweep_any(  # type: ignore[no-untyped-def]
    count,
    relaxation,
    starts,
    lanes,
    values,
    free,
    friction,
    remote,
    fixed,
    partner,
    lowest,
    rolling,
    rolling_fixed,
    axes,
    sliding,
    impulses,
    work,
):
    """Sweeps over joints, row by row, and contacts with and without rolling friction."""
    width = len(axes)
    xi, old, block = np.empty(width), np.empty(width), np.empty((width, width))
    for _ in range(count):
        for i in range(len(friction)):
            k, own = width * i, width * width * np.int64(starts[i])
            velocity_of_block(i, 1, axes, starts, lanes, values, free, impulses, xi)
            held = impulses[k : k + width]
            old[:] = held
            if lowest[i] < 0.0:
                new = -xi[0] / values[own] if values[own] > 0.0 else held[0]
                held[0] = old[0] + relaxation[i] * (new - old[0])
                continue
            for row in range(width):
                block[row] = values[own + width * row : own + width * (row + 1)]
            bound = fixed[i]
            if remote[i] > 0.0:
                bound += remote[i] * impulses[partner[i]]
            if rolling[i] > 0.0 or rolling_fixed[i] > 0.0:
                solve_rolling(block, xi, sliding, friction[i], bound, rolling[i], rolling_fixed[i], held)
            else:
                held[1 + sliding :] = 0.0
                _solve_without_rolling(block, xi, sliding, friction[i], bound, held, work)
            if relaxation[i] != 1.0:
                _relax(relaxation[i], sliding, friction[i], bound, rolling[i], rolling_fixed[i], old, held)


@njit(cache=True, error_model="numpy")
def _solve_without_rolling(block, xi, sliding, friction, bound, held, work):  # type: ignore[no-untyped-def]
    """Replace Λ_N and Λ_T by the solution of their contact."""
    if sliding == 0:
        held[0] = solve_frictionless(block[0, 0], xi[0])
    elif sliding == 1:
        nn, nt, tn, tt = block[0, 0], block[0, 1], block[1, 0], block[1, 1]
        held[0], held[1] = solve_planar(nn, nt, tn, tt, xi[0], xi[1], friction, bound, held[0], held[1])
    else:
        g = np.ascontiguousarray(block[:3, :3]).reshape(-1)
        held[0], held[1], held[2] = solve_spatial(
            g, xi[0], xi[1], xi[2], friction, bound, held[0], held[1], held[2], work
        )


@njit(cache=True, error_model="numpy")
def _relax(relaxation, sliding, friction, fixed, rolling, rolling_fixed, old, held):  # type: ignore[no-untyped-def]
    """Move Λ from ``old`` by the part ``relaxation`` towards ``held``, back onto its bounds."""
    for k in range(len(held)):
        held[k] = old[k] + relaxation * (held[k] - old[k])
    held[0] = max(held[0], 0.0)
    first = 1 + sliding
    zeros = np.zeros(len(held))
    into_ball(0.0, fixed + friction * held[0], 1, zeros, held[1:first], zeros)
    into_ball(0.0, rolling_fixed + rolling * held[0], first, zeros, held[first:], zeros)
