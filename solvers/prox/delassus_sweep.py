"""Gauss–Seidel sweeps over the assembled Delassus matrix, one kernel for each block width.

A block i holds the relative velocity ξ_i = Σ_j G_ij Λ_j + c_i of its lanes N, T1, T2 from the newest impulses, updates
Λ_N, corrects ξ_T by G_TN ΔΛ_N, and updates Λ_T: law by law the sweep of [54, 55], with G read once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from ...problems.blocks import BlockLayout
from ...problems.contact import ContactProblem
from ...problems.delassus import DelassusBlocks
from ...problems.laws import FloatArray
from .projection import disc_scale


@dataclass(frozen=True, eq=False)
class DelassusSweep:
    """Everything a sweep reads and never writes."""

    layout: BlockLayout
    matrix: tuple[Any, Any, Any]
    free: FloatArray
    laws: tuple[FloatArray, FloatArray, FloatArray, Any]
    kernel: Callable[..., None]

    @staticmethod
    def over(problem: ContactProblem, blocks: DelassusBlocks, sizes: FloatArray) -> "DelassusSweep":
        """Return the sweep of ``problem`` with step sizes of shape (n_blocks, 2)."""
        layout = problem.layout
        kernel = {1: _sweep_frictionless, 2: _sweep_planar, 3: _sweep_spatial}[layout.width]
        laws = (sizes, layout.friction_coefficient, layout.fixed_bound, layout.partner)
        matrix = (blocks.starts, blocks.columns, blocks.values)
        return DelassusSweep(layout, matrix, layout.pad(problem.free_velocity), laws, kernel)

    def begin(self, start: FloatArray) -> "DelassusIterates":
        """Return the iterates that begin at ``start``, shape (n_rows,)."""
        return DelassusIterates(self, self.layout.pad(start))


class DelassusIterates:
    """Λ of a Gauss–Seidel iteration, in padded blocks."""

    def __init__(self, sweep: DelassusSweep, padded: FloatArray) -> None:
        self._sweep = sweep
        self._impulses = padded
        self._velocity = np.empty_like(padded)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        self._sweep.kernel(count, *self._sweep.matrix, self._sweep.free, *self._sweep.laws, self._impulses)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._sweep.layout.unpad(self._impulses)

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        block_product(*self._sweep.matrix, self._impulses, self._sweep.free, self._velocity)
        return self._sweep.layout.unpad(self._velocity)


@njit(cache=True, fastmath={"contract"})
def block_product(starts, columns, values, impulses, free, velocity):  # type: ignore[no-untyped-def]
    """Write ξ = GΛ + c in padded blocks of any width."""
    n_blocks, width = impulses.shape
    for i in range(n_blocks):
        for lane in range(width):
            total = free[i, lane]
            for p in range(starts[i], starts[i + 1]):
                j = columns[p]
                for other in range(width):
                    total += values[p, lane, other] * impulses[j, other]
            velocity[i, lane] = total


@njit(cache=True, fastmath={"contract"})
def _sweep_frictionless(  # type: ignore[no-untyped-def]
    count, starts, columns, values, free, sizes, friction, fixed, partner, impulses
):
    for _ in range(count):
        for i in range(len(impulses)):
            normal = free[i, 0]
            for p in range(starts[i], starts[i + 1]):
                normal += values[p, 0, 0] * impulses[columns[p], 0]
            impulses[i, 0] = max(impulses[i, 0] - sizes[i, 0] * normal, 0.0)


@njit(cache=True, fastmath={"contract"})
def _sweep_planar(  # type: ignore[no-untyped-def]
    count, starts, columns, values, free, sizes, friction, fixed, partner, impulses
):
    for _ in range(count):
        for i in range(len(impulses)):
            normal, tangent = free[i, 0], free[i, 1]
            for p in range(starts[i], starts[i + 1]):
                j = columns[p]
                n, t = impulses[j, 0], impulses[j, 1]
                normal += values[p, 0, 0] * n + values[p, 0, 1] * t
                tangent += values[p, 1, 0] * n + values[p, 1, 1] * t
            own = starts[i]
            old = impulses[i, 0]
            new = max(old - sizes[i, 0] * normal, 0.0)
            impulses[i, 0] = new
            tangent += values[own, 1, 0] * (new - old)
            bound = fixed[i] + friction[i] * impulses[partner[i], 0]
            impulses[i, 1] = min(max(impulses[i, 1] - sizes[i, 1] * tangent, -bound), bound)


@njit(cache=True, fastmath={"contract"})
def _sweep_spatial(  # type: ignore[no-untyped-def]
    count, starts, columns, values, free, sizes, friction, fixed, partner, impulses
):
    for _ in range(count):
        for i in range(len(impulses)):
            normal, first, second = free[i, 0], free[i, 1], free[i, 2]
            for p in range(starts[i], starts[i + 1]):
                j = columns[p]
                n, t, s = impulses[j, 0], impulses[j, 1], impulses[j, 2]
                normal += values[p, 0, 0] * n + values[p, 0, 1] * t + values[p, 0, 2] * s
                first += values[p, 1, 0] * n + values[p, 1, 1] * t + values[p, 1, 2] * s
                second += values[p, 2, 0] * n + values[p, 2, 1] * t + values[p, 2, 2] * s
            own = starts[i]
            old = impulses[i, 0]
            new = max(old - sizes[i, 0] * normal, 0.0)
            impulses[i, 0] = new
            first += values[own, 1, 0] * (new - old)
            second += values[own, 2, 0] * (new - old)
            bound = fixed[i] + friction[i] * impulses[partner[i], 0]
            x = impulses[i, 1] - sizes[i, 1] * first
            y = impulses[i, 2] - sizes[i, 1] * second
            scale = disc_scale(x, y, bound)
            impulses[i, 1] = x * scale
            impulses[i, 2] = y * scale
