"""Gauss–Seidel sweeps over the assembled Delassus matrix, one kernel for each block width.

For each block i, a sweep computes the relative velocity ξ_i = Σ_j G_ij Λ_j + c_i of the lanes N, T1, T2 from the latest
impulses, updates Λ_N, corrects ξ_T by G_TN ΔΛ_N, and updates Λ_T. This is the sweep of SORprox, law by law, and it
reads G only once.

The kernels index flat arrays with unsigned numbers. numba then needs neither strides nor tests for negative indices,
and a sweep is about a third faster than the same loops over three-dimensional blocks.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.compilation.interpretation import interpretable
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.matrices.delassus import REMEDY, memory_purpose
from ...problems.contact.matrices.memory import named_allocation
from ...problems.contact.problem import ContactProblem
from ..iteration.loop import Iterates
from ..iteration.momentum import with_momentum
from .any_laws import AnyLawArrays, sweep_delassus
from .one_contact import disc_scale


class DelassusArrays(NamedTuple):
    """G and c as kernels read them: the first arguments of each kernel after the number of sweeps.

    Attributes:
        starts: first stored block of each block row.
        lanes: first lane of the column of each stored block.
        values: the stored blocks, flat [1/kg].
        free_velocity: c, padded and flat [m/s].
    """

    starts: Any
    lanes: Any
    values: FloatArray
    free_velocity: FloatArray


class LawArrays(NamedTuple):
    """The laws of contacts with sliding friction as kernels read them.

    Attributes:
        step_sizes: r of N and T of each block, flat [kg].
        friction: μ of each block.
        fixed_bound: a of each block [N s].
        partner_lanes: N lane of the block whose normal impulse bounds each block's friction.
    """

    step_sizes: FloatArray
    friction: FloatArray
    fixed_bound: FloatArray
    partner_lanes: Any

    @staticmethod
    def of(layout: BlockLayout, step_sizes: FloatArray) -> "LawArrays":
        """Return the laws of ``layout`` with step sizes as in ``step_size``."""
        partner_lanes = (layout.width * layout.partner).view(np.uint64)
        return LawArrays(step_sizes.reshape(-1), layout.friction_coefficient, layout.fixed_bound, partner_lanes)


@dataclass(frozen=True, eq=False)
class FlatDelassus:
    """G and c of one problem, in flat arrays.

    Attributes:
        layout: the padded blocks.
        arrays: G and c.
    """

    layout: BlockLayout
    arrays: DelassusArrays

    @staticmethod
    def of(problem: ContactProblem) -> "FlatDelassus":
        """Return G and c of ``problem``.

        Raises:
            InsufficientMemoryError: if the available memory does not suffice.
        """
        layout, blocks = problem.layout, problem.delassus_blocks()
        with named_allocation(memory_purpose(layout.n_blocks), REMEDY):
            lanes = (layout.width * blocks.columns).view(np.uint32)
        free_velocity = layout.pad(problem.free_velocity).reshape(-1)
        arrays = DelassusArrays(blocks.starts.view(np.uint64), lanes, blocks.values.reshape(-1), free_velocity)
        return FlatDelassus(layout, arrays)


class DelassusState:
    """Λ of an iteration over the assembled G; sweeps change it in place.

    Attributes:
        layout: the padded blocks.
        padded: Λ padded and flat.
    """

    def __init__(self, delassus: FlatDelassus, start: FloatArray) -> None:
        self.layout, self.padded = delassus.layout, delassus.layout.pad(start).reshape(-1)
        self._delassus, self._velocity = delassus, np.empty(len(self.padded))
        product = write_spatial_velocity if self.layout.width == 3 else partial(write_velocity, self.layout.width)
        self._write_velocity = partial(product, *delassus.arrays, self.padded, self._velocity)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self.layout.unpad(self.padded)

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        self._write_velocity()
        return self.layout.rows_of(self._velocity)


@dataclass(frozen=True, eq=False)
class DelassusSweep:
    """The constant data of a sweep.

    Attributes:
        delassus: G and c.
        laws: ``LawArrays``, or ``AnyLawArrays`` where there are joints or rolling friction.
    """

    delassus: FlatDelassus
    laws: LawArrays | AnyLawArrays

    @staticmethod
    def over(problem: ContactProblem, step_sizes: FloatArray) -> "DelassusSweep":
        """Return the sweep of ``problem`` with step sizes as in ``step_size``."""
        layout = problem.layout
        kind = LawArrays if layout.has_contacts_only else AnyLawArrays
        return DelassusSweep(FlatDelassus.of(problem), kind.of(layout, step_sizes))

    def begin(self, start: FloatArray, momentum: float = 0.0, delay: float = 0.0) -> Iterates:
        """Return the iterates that begin at ``start``, shape (n_rows,); see ``MomentumState``."""
        return with_momentum(DelassusIterates(self, start), momentum, delay)


class DelassusIterates(DelassusState):
    """Λ of a Gauss–Seidel iteration."""

    def __init__(self, sweep: DelassusSweep, start: FloatArray) -> None:
        super().__init__(sweep.delassus, start)
        width = self.layout.width
        self._kernel: Callable[..., None] = partial(sweep_delassus, tuple(range(width)))
        if self.layout.has_contacts_only:
            self._kernel = (sweep_frictionless, sweep_planar, sweep_spatial)[width - 1]
        self._laws = sweep.laws
        self._arguments = (*sweep.delassus.arrays, *sweep.laws, self.padded)

    @property
    def step_sizes(self) -> FloatArray:
        """Initial r of the lanes of each block [kg], as in ``step_size``."""
        return self._laws.step_sizes.reshape(-1, 2 if self.layout.has_contacts_only else 3)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        self._kernel(count, *self._arguments)

    def scale_steps(self, fraction: FloatArray) -> None:
        """Set the step sizes of each block to this fraction of the initial ones, shape (n_blocks,)."""
        scaled_step_sizes = (self.step_sizes * fraction[:, None]).reshape(-1)
        self._arguments = (*self._delassus.arrays, scaled_step_sizes, *self._laws[1:], self.padded)

    def linear_state(self) -> tuple[FloatArray, int]:
        """Return Λ and its length; see ``LinearIterates``."""
        return self.padded, len(self.padded)


@njit(cache=True, fastmath={"contract"}, inline="always")
def planar_velocity(i, n_skipped, starts, lanes, values, free_velocity, impulses):  # type: ignore[no-untyped-def]
    """Return ξ_N, ξ_T of block i without the first ``n_skipped`` of its stored blocks."""
    one, two, three, four = uint64(1), uint64(2), uint64(3), uint64(4)
    normal, tangent = free_velocity[two * i], free_velocity[two * i + one]
    for p in range(starts[i] + uint64(n_skipped), starts[i + one]):
        j, v = uint64(lanes[p]), four * p
        n, t = impulses[j], impulses[j + one]
        normal += values[v] * n + values[v + one] * t
        tangent += values[v + two] * n + values[v + three] * t
    return normal, tangent


@njit(cache=True, fastmath={"contract"}, inline="always")
def spatial_velocity(i, n_skipped, starts, lanes, values, free_velocity, impulses):  # type: ignore[no-untyped-def]
    """Return ξ_N, ξ_T1, ξ_T2 of block i without the first ``n_skipped`` of its stored blocks."""
    one, two, three = uint64(1), uint64(2), uint64(3)
    normal, tangent, other = free_velocity[three * i], free_velocity[three * i + one], free_velocity[three * i + two]
    for p in range(starts[i] + uint64(n_skipped), starts[i + one]):
        j, v = uint64(lanes[p]), uint64(9) * p
        n, t, s = impulses[j], impulses[j + one], impulses[j + two]
        normal += values[v] * n + values[v + one] * t + values[v + two] * s
        tangent += values[v + three] * n + values[v + uint64(4)] * t + values[v + uint64(5)] * s
        other += values[v + uint64(6)] * n + values[v + uint64(7)] * t + values[v + uint64(8)] * s
    return normal, tangent, other


@interpretable
@njit(cache=True, error_model="numpy")
def write_velocity(width, starts, lanes, values, free_velocity, impulses, velocity):  # type: ignore[no-untyped-def]
    """Write ξ = GΛ + c of blocks of any width."""
    one, width = uint64(1), uint64(width)
    for i in range(uint64(len(starts) - 1)):
        for lane in range(width):
            total = free_velocity[width * i + lane]
            for p in range(starts[i], starts[i + one]):
                j, v = uint64(lanes[p]), (width * p + lane) * width
                for other in range(width):
                    total += values[v + other] * impulses[j + other]
            velocity[width * i + lane] = total


@interpretable
@njit(cache=True, error_model="numpy")
def write_spatial_velocity(starts, lanes, values, free_velocity, impulses, velocity):  # type: ignore[no-untyped-def]
    """Write ξ = GΛ + c of spatial contacts."""
    one, two, three = uint64(1), uint64(2), uint64(3)
    for i in range(uint64(len(starts) - 1)):
        normal, first, second = spatial_velocity(i, 0, starts, lanes, values, free_velocity, impulses)
        velocity[three * i], velocity[three * i + one], velocity[three * i + two] = normal, first, second


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_frictionless(  # type: ignore[no-untyped-def]
    count, starts, lanes, values, free_velocity, step_sizes, friction, fixed_bound, partner, impulses
):
    """Sweep ``count`` times over contacts without friction."""
    one, two = uint64(1), uint64(2)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            normal = free_velocity[i]
            for p in range(starts[i], starts[i + one]):
                normal += values[p] * impulses[uint64(lanes[p])]
            impulses[i] = max(impulses[i] - step_sizes[two * i] * normal, 0.0)


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_planar(  # type: ignore[no-untyped-def]
    count, starts, lanes, values, free_velocity, step_sizes, friction, fixed_bound, partner, impulses
):
    """Sweep ``count`` times over planar contacts."""
    one, two, four = uint64(1), uint64(2), uint64(4)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k = two * i
            normal, tangent = planar_velocity(i, 0, starts, lanes, values, free_velocity, impulses)
            old = impulses[k]
            new = max(old - step_sizes[k] * normal, 0.0)
            impulses[k] = new
            tangent += values[four * starts[i] + two] * (new - old)
            bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
            impulses[k + one] = min(max(impulses[k + one] - step_sizes[k + one] * tangent, -bound), bound)


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_spatial(  # type: ignore[no-untyped-def]
    count, starts, lanes, values, free_velocity, step_sizes, friction, fixed_bound, partner, impulses
):
    """Sweep ``count`` times over spatial contacts."""
    one, two, three = uint64(1), uint64(2), uint64(3)
    for _ in range(count):
        for i in range(uint64(len(friction))):
            k = three * i
            normal, first, second = spatial_velocity(i, 0, starts, lanes, values, free_velocity, impulses)
            block_start = uint64(9) * starts[i]
            old = impulses[k]
            new = max(old - step_sizes[two * i] * normal, 0.0)
            impulses[k] = new
            first += values[block_start + three] * (new - old)
            second += values[block_start + uint64(6)] * (new - old)
            bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
            x = impulses[k + one] - step_sizes[two * i + one] * first
            y = impulses[k + two] - step_sizes[two * i + one] * second
            scale = disc_scale(x, y, bound)
            impulses[k + one] = x * scale
            impulses[k + two] = y * scale
