"""Block Gauss–Seidel sweeps over the assembled Delassus matrix, which solve one contact after the other exactly.

One sweep visits the contacts in order. For each contact, it computes the solution Λ* with the newest impulses of the
other contacts fixed (``one_contact``), and moves Λ to Λ + ω(Λ* − Λ), projected onto the cone, with relaxation ω.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.compilation.interpretation import count_numbers, interpretable
from ...problems.compilation.kernel_arrays import copy_entries
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.problem import ContactProblem
from .any_laws import AnyLawArrays, project_into_ball, write_velocity_of_block
from .delassus import DelassusState, FlatDelassus, LawArrays, planar_velocity, spatial_velocity
from .one_contact import disc_scale, solve_frictionless, solve_planar, solve_spatial, solve_usual_spatial
from .rolling_contact import solve_rolling
from .slip_angle import WORKSPACE_SIZE
from .step_size import diagonal_step_sizes

NO_STEP_SIZES = np.empty(0)
"""Placeholder for the step sizes of laws, which block sweeps do not use."""


@dataclass(frozen=True, eq=False)
class BlockSweep:
    """The constant data of a sweep.

    Attributes:
        problem: the problem.
        delassus: G and c.
        laws: ``LawArrays`` or ``AnyLawArrays`` without step sizes.
        relaxation: ω.
    """

    problem: ContactProblem
    delassus: FlatDelassus
    laws: tuple[Any, ...]
    relaxation: float

    @staticmethod
    def over(problem: ContactProblem, relaxation: float) -> "BlockSweep":
        """Return the sweep of ``problem``."""
        layout = problem.layout
        laws = (LawArrays if layout.has_contacts_only else AnyLawArrays).of(layout, NO_STEP_SIZES)
        return BlockSweep(problem, FlatDelassus.of(problem), laws[1:], relaxation)

    @cached_property
    def step_sizes(self) -> FloatArray:
        """1/α for the lanes of each block [kg], as in ``step_size``."""
        return diagonal_step_sizes(self.problem, 1.0)


class BlockIterates(DelassusState):
    """Λ of a block Gauss–Seidel iteration."""

    def __init__(self, sweep: BlockSweep, start: FloatArray) -> None:
        super().__init__(sweep.delassus, start)
        self._sweep, self._kernel = sweep, _kernel_of(self.layout)
        self._relaxation = np.empty(self.layout.n_blocks)
        self._relaxation.fill(sweep.relaxation)
        self._arguments = (self._relaxation, *self._delassus.arrays, *sweep.laws, self.padded)

    @property
    def step_sizes(self) -> FloatArray:
        """1/α for the lanes of each block [kg], as in ``step_size``."""
        return self._sweep.step_sizes

    def sweep(self, count: int) -> None:
        """Run ``count`` sweeps.

        If ``solve_usual_spatial`` cannot solve a spatial contact, ``solve_other_spatial_blocks`` completes the sweep.
        """
        if self._kernel is not solve_usual_spatial_blocks:
            self._kernel(count, *self._arguments)
            return
        n_blocks = max(self.layout.n_blocks, 1)
        while count > 0:
            visited = solve_usual_spatial_blocks(count, *self._arguments)
            count -= visited // n_blocks + 1
            if count >= 0:
                solve_other_spatial_blocks(visited % n_blocks, *self._arguments)

    def scale_steps(self, fraction: FloatArray) -> None:
        """Set ω of each block to this fraction of its initial value, shape (n_blocks,)."""
        self._relaxation[:] = self._sweep.relaxation * fraction


def _kernel_of(layout: BlockLayout) -> Callable[..., Any]:
    """Return the kernel that sweeps over blocks of these laws."""
    if not layout.has_contacts_only:
        return _sweep_any
    kernels: tuple[Callable[..., Any], ...] = (
        solve_frictionless_blocks,
        solve_planar_blocks,
        solve_usual_spatial_blocks,
    )
    return kernels[layout.width - 1]


INTERPRETATION_WEIGHT = 10
"""Weight of each number that a sweep reads, relative to other kernels that may be interpreted.

With this weight, sweeps over more than about ten contacts are compiled at once. Otherwise they would be compiled a few
solves later.
"""


def _count_swept_numbers(count: int, *arguments: Any) -> int:
    """Return the number of entries that ``count`` sweeps read, times their weight."""
    return INTERPRETATION_WEIGHT * count * count_numbers(*arguments)


_interpretable = partial(interpretable, count=_count_swept_numbers)


@njit(cache=True, inline="always")
def _split_bound(i, own, friction, fixed_bound, partner, impulses):  # type: ignore[no-untyped-def]
    """Return the friction bound a + μ Λ_N of block i as (μ, a); μ is 0 unless Λ_N is its own, in lane ``own``."""
    mu, bound = friction[i], fixed_bound[i]
    if partner[i] != own:
        mu, bound = 0.0, bound + mu * impulses[partner[i]]
    return mu, bound


@_interpretable
@njit(cache=True, error_model="numpy")
def solve_frictionless_blocks(  # type: ignore[no-untyped-def]
    count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
):
    """Sweep ``count`` times over frictionless contacts."""
    one = uint64(1)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            own, old = values[starts[i]], impulses[i]
            normal = free_velocity[i] - own * old
            for p in range(starts[i], starts[i + one]):
                normal += values[p] * impulses[uint64(lanes[p])]
            impulses[i] = max(old + relaxation[i] * (solve_frictionless(own, normal) - old), 0.0)


@_interpretable
@njit(cache=True, error_model="numpy")
def solve_planar_blocks(  # type: ignore[no-untyped-def]
    count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
):
    """Sweep ``count`` times over planar contacts."""
    one, two, three, four = uint64(1), uint64(2), uint64(3), uint64(4)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k, own = two * i, four * starts[i]
            normal, tangent = planar_velocity(i, 1, starts, lanes, values, free_velocity, impulses)
            nn, nt, tn, tt = values[own], values[own + one], values[own + two], values[own + three]
            old_n, old_t = impulses[k], impulses[k + one]
            mu, bound = _split_bound(i, k, friction, fixed_bound, partner, impulses)
            n, t = solve_planar(nn, nt, tn, tt, normal, tangent, mu, bound, old_n, old_t)
            if relaxation[i] != 1.0:
                n = max(old_n + relaxation[i] * (n - old_n), 0.0)
                bound += mu * n
                t = min(max(old_t + relaxation[i] * (t - old_t), -bound), bound)
            impulses[k], impulses[k + one] = n, t


@_interpretable
@njit(cache=True, error_model="numpy")
def solve_usual_spatial_blocks(  # type: ignore[no-untyped-def]
    count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
):
    """Sweep until ``solve_usual_spatial`` cannot solve a contact; return the number of contacts visited before it."""
    one, two, three, nine = uint64(1), uint64(2), uint64(3), uint64(9)
    for done in range(count):
        for i in range(uint64(len(friction))):
            k, own = three * i, nine * starts[i]
            normal, first, second = spatial_velocity(i, 1, starts, lanes, values, free_velocity, impulses)
            mu, bound = _split_bound(i, k, friction, fixed_bound, partner, impulses)
            old_n, old_t1, old_t2 = impulses[k], impulses[k + one], impulses[k + two]
            block = values[own : own + nine]
            n, t1, t2, is_usual = solve_usual_spatial(block, normal, first, second, mu, bound, old_n, old_t1, old_t2)
            if not is_usual:
                return done * len(friction) + np.int64(i)
            _move_spatial(k, relaxation[i], mu, bound, n, t1, t2, impulses)
    return count * len(friction)


@njit(cache=True, error_model="numpy")
def solve_other_spatial_blocks(  # type: ignore[no-untyped-def]
    begin, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
):
    """Solve the contacts of one sweep from contact ``begin`` on, in any state."""
    one, two, three, nine = uint64(1), uint64(2), uint64(3), uint64(9)
    work = np.empty(WORKSPACE_SIZE)
    for i in range(uint64(begin), uint64(len(friction))):
        k, own = three * i, nine * starts[i]
        normal, first, second = spatial_velocity(i, 1, starts, lanes, values, free_velocity, impulses)
        mu, bound = _split_bound(i, k, friction, fixed_bound, partner, impulses)
        old_n, old_t1, old_t2 = impulses[k], impulses[k + one], impulses[k + two]
        block = values[own : own + nine]
        n, t1, t2 = solve_spatial(block, normal, first, second, mu, bound, old_n, old_t1, old_t2, work)
        _move_spatial(k, relaxation[i], mu, bound, n, t1, t2, impulses)


@njit(cache=True, inline="always")
def _move_spatial(k, relaxation, mu, bound, n, t1, t2, impulses):  # type: ignore[no-untyped-def]
    """Move the impulse in lanes k to k + 2 by the fraction ``relaxation`` to (n, t1, t2), and project onto its cone."""
    one, two = uint64(1), uint64(2)
    if relaxation != 1.0:
        old_n, old_t1, old_t2 = impulses[k], impulses[k + one], impulses[k + two]
        n = max(old_n + relaxation * (n - old_n), 0.0)
        bound += mu * n
        t1, t2 = old_t1 + relaxation * (t1 - old_t1), old_t2 + relaxation * (t2 - old_t2)
        scale = disc_scale(t1, t2, bound)
        t1 *= scale
        t2 *= scale
    impulses[k], impulses[k + one], impulses[k + two] = n, t1, t2


@njit(cache=True, error_model="numpy")
def _sweep_any(  # type: ignore[no-untyped-def]
    count,
    relaxation,
    starts,
    lanes,
    values,
    free_velocity,
    friction,
    fixed_bound,
    partner,
    lower,
    mu_r,
    a_r,
    width,
    sliding,
    impulses,
):
    """Sweep over joints, row by row, and contacts with and without rolling friction."""
    xi, old, block, work = np.empty(width), np.empty(width), np.empty((width, width)), np.empty(WORKSPACE_SIZE)
    for _ in range(count):
        for i in range(len(friction)):
            k, own = width * i, width * width * np.int64(starts[i])
            write_velocity_of_block(i, 1, width, starts, lanes, values, free_velocity, impulses, xi)
            block_impulses = impulses[k : k + width]
            copy_entries(block_impulses, old)
            if lower[i] < 0.0:
                new = -xi[0] / values[own] if values[own] > 0.0 else block_impulses[0]
                block_impulses[0] = old[0] + relaxation[i] * (new - old[0])
                continue
            for row in range(width):
                copy_entries(values[own + width * row : own + width * (row + 1)], block[row])
            mu, bound = _split_bound(i, k, friction, fixed_bound, partner, impulses)
            if mu_r[i] > 0.0 or a_r[i] > 0.0:
                solve_rolling(block, xi, sliding, mu, bound, mu_r[i], a_r[i], block_impulses)
            else:
                block_impulses[1 + sliding :] = 0.0
                _solve_without_rolling(block, xi, sliding, mu, bound, block_impulses, work)
            if relaxation[i] != 1.0:
                _relax(relaxation[i], sliding, mu, bound, mu_r[i], a_r[i], old, block_impulses)


@njit(cache=True, error_model="numpy")
def _solve_without_rolling(block, xi, sliding, friction, bound, block_impulses, work):  # type: ignore[no-untyped-def]
    """Replace Λ_N and Λ_T by the exact solution of a contact without rolling friction."""
    if sliding == 0:
        block_impulses[0] = solve_frictionless(block[0, 0], xi[0])
    elif sliding == 1:
        nn, nt, tn, tt = block[0, 0], block[0, 1], block[1, 0], block[1, 1]
        block_impulses[0], block_impulses[1] = solve_planar(
            nn, nt, tn, tt, xi[0], xi[1], friction, bound, block_impulses[0], block_impulses[1]
        )
    else:
        g = np.ascontiguousarray(block[:3, :3]).reshape(-1)
        block_impulses[0], block_impulses[1], block_impulses[2] = solve_spatial(
            g, xi[0], xi[1], xi[2], friction, bound, block_impulses[0], block_impulses[1], block_impulses[2], work
        )


@njit(cache=True, error_model="numpy")
def _relax(relaxation, sliding, friction, fixed_bound, rolling_coefficient, rolling_bound, old, block_impulses):  # type: ignore[no-untyped-def]
    """Move Λ from ``old`` by the fraction ``relaxation`` to ``block_impulses``, and project onto its bounds."""
    for k in range(len(block_impulses)):
        block_impulses[k] = old[k] + relaxation * (block_impulses[k] - old[k])
    block_impulses[0] = max(block_impulses[0], 0.0)
    first = 1 + sliding
    zeros = np.zeros(len(block_impulses))
    project_into_ball(0.0, fixed_bound + friction * block_impulses[0], 1, zeros, block_impulses[1:first], zeros)
    project_into_ball(
        0.0, rolling_bound + rolling_coefficient * block_impulses[0], first, zeros, block_impulses[first:], zeros
    )
