"""Sweeps over contacts, joints and rolling friction, in all forms of the projected iterations.

A block has the lanes N, T and R of ``BlockLayout``, as many as the problem needs. Its laws are updated one after the
other, with the lower bound l = 0 for Λ_N of a unilateral law and l = −∞ for a bilateral law,

    Λ_N ← max(Λ_N − r_N ξ_N, l),
    Λ_T ← prox of the disc of radius a + μ Λ_N  of  Λ_T − r_T ξ_T,
    Λ_R ← prox of the ball of radius a_r + μ_r Λ_N  of  Λ_R − r_R ξ_R.

For fixed Λ_N, the cone of a rolling contact is the product of a disc and a ball, which are projected onto separately.
Problems that contain only contacts with sliding friction have specialised kernels of fixed width.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout


class AnyLawArrays(NamedTuple):
    """Arrays of laws of any kind for compiled kernels; n is the number of blocks.

    Attributes:
        step_sizes: r of N, T and R of each block, flat [kg], shape (3n,).
        friction: μ, shape (n,).
        fixed_bound: a [N s], shape (n,).
        partner_lanes: N lane of the block whose normal impulse bounds the friction, shape (n,).
        lower_bound: l [N s], shape (n,).
        rolling: μ_r [m], shape (n,).
        rolling_bound: a_r [N m s], shape (n,).
        width: number of lanes of a block.
        sliding: number of tangential lanes.
    """

    step_sizes: FloatArray
    friction: FloatArray
    fixed_bound: FloatArray
    partner_lanes: Any
    lower_bound: FloatArray
    rolling: FloatArray
    rolling_bound: FloatArray
    width: int
    sliding: int

    @staticmethod
    def of(layout: BlockLayout, step_sizes: FloatArray) -> "AnyLawArrays":
        """Return the laws of ``layout`` with step sizes [kg] of shape (n_blocks, 3)."""
        lower_bound = np.where(layout.is_bilateral, -np.inf, 0.0)
        partner_lanes = (layout.width * layout.partner).astype(np.int64)
        return AnyLawArrays(
            step_sizes.reshape(-1),
            layout.friction_coefficient,
            layout.fixed_bound,
            partner_lanes,
            lower_bound,
            layout.rolling_coefficient,
            layout.rolling_bound,
            layout.width,
            layout.sliding,
        )


@njit(cache=True, inline="always")
def write_velocity_of_block(i, n_skipped, n_lanes, starts, lanes, values, free_velocity, impulses, xi):  # type: ignore[no-untyped-def]
    """Write ξ of the lanes of block i from G in block rows, without the first ``n_skipped`` stored blocks."""
    width = uint64(n_lanes)
    for lane in range(width):
        xi[lane] = free_velocity[width * uint64(i) + lane]
    for p in range(uint64(starts[i]) + uint64(n_skipped), uint64(starts[i + 1])):
        j = uint64(lanes[p])
        for lane in range(width):
            v, total = (width * p + lane) * width, 0.0
            for other in range(width):
                total += values[v + other] * impulses[j + other]
            xi[lane] += total


@njit(cache=True, error_model="numpy")
def project_into_ball(size, bound, begin, xi, impulses, change):  # type: ignore[no-untyped-def]
    """Move the impulses of the lanes from ``begin`` on by −size ξ, project them onto a ball, and write their change."""
    squared = 0.0
    for k in range(len(impulses)):
        change[begin + k] = impulses[k] - size * xi[begin + k]
        squared += change[begin + k] ** 2
    scale = bound / np.sqrt(squared) if squared > bound * bound else 1.0
    for k in range(len(impulses)):
        new = scale * change[begin + k]
        change[begin + k] = new - impulses[k]
        impulses[k] = new


@njit(cache=True)
def sweep_delassus(  # type: ignore[no-untyped-def]
    axes,
    count,
    starts,
    lanes,
    values,
    free_velocity,
    step_sizes,
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
    """Do ``count`` Gauss–Seidel sweeps over G in block rows; ``axes`` is a tuple with one entry for each lane."""
    width = len(axes)  # known to the compiler, unlike the argument, so that it unrolls loops over lanes
    xi, change = np.empty(width), np.empty(width)
    first_rolling = 1 + sliding
    for _ in range(count):
        for i in range(len(friction)):
            k, block_start = width * i, width * width * np.int64(starts[i])
            write_velocity_of_block(i, 0, width, starts, lanes, values, free_velocity, impulses, xi)
            new = max(impulses[k] - step_sizes[3 * i] * xi[0], lower[i])
            change[0], impulses[k] = new - impulses[k], new
            if sliding > 0:
                for lane in range(1, first_rolling):
                    xi[lane] += values[block_start + width * lane] * change[0]
                bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
                project_into_ball(step_sizes[3 * i + 1], bound, 1, xi, impulses[k + 1 : k + first_rolling], change)
            if first_rolling < width:
                for lane in range(first_rolling, width):
                    for other in range(first_rolling):
                        xi[lane] += values[block_start + width * lane + other] * change[other]
                bound = a_r[i] + mu_r[i] * new
                project_into_ball(
                    step_sizes[3 * i + 2], bound, first_rolling, xi, impulses[k + first_rolling : k + width], change
                )


@njit(cache=True)
def project_all(  # type: ignore[no-untyped-def]
    step_sizes, friction, fixed_bound, partner, lower, mu_r, a_r, width, sliding, velocity, impulses
):
    """Move Λ along −r ξ and project: all normal impulses, then all friction impulses."""
    change = np.empty(width)
    first_rolling = 1 + sliding
    for i in range(len(friction)):
        impulses[width * i] = max(impulses[width * i] - step_sizes[3 * i] * velocity[width * i], lower[i])
    for i in range(len(friction)):
        k = width * i
        xi = velocity[k : k + width]
        bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
        project_into_ball(step_sizes[3 * i + 1], bound, 1, xi, impulses[k + 1 : k + first_rolling], change)
        bound = a_r[i] + mu_r[i] * impulses[k]
        project_into_ball(
            step_sizes[3 * i + 2], bound, first_rolling, xi, impulses[k + first_rolling : k + width], change
        )


@njit(cache=True)
def _write_velocity_of_lanes(first_lane, last_lane, begin, end, chunks, pieces, scaled_velocity, free_velocity, xi):  # type: ignore[no-untyped-def]
    """Write ξ of the lanes ``first_lane`` to ``last_lane`` − 1 of a block with the pieces ``begin`` to ``end`` − 1."""
    length = pieces.shape[2]
    for lane in range(first_lane, last_lane):
        total = free_velocity[lane]
        for p in range(begin, end):
            chunk = length * np.int64(chunks[p])
            for a in range(length):
                total += pieces[p, lane, a] * scaled_velocity[chunk + a]
        xi[lane] = total


@njit(cache=True)
def _push(first_lane, last_lane, begin, end, chunks, pieces, change, scaled_velocity):  # type: ignore[no-untyped-def]
    """Add W̃ ΔΛ of the same lanes to v; see ``_write_velocity_of_lanes``."""
    length = pieces.shape[2]
    for lane in range(first_lane, last_lane):
        for p in range(begin, end):
            chunk = length * np.int64(chunks[p])
            for a in range(length):
                scaled_velocity[chunk + a] += pieces[p, lane, a] * change[lane]


@njit(cache=True)
def sweep_factors(  # type: ignore[no-untyped-def]
    count,
    starts,
    chunks,
    pieces,
    free_velocity,
    step_sizes,
    friction,
    fixed_bound,
    partner,
    lower,
    mu_r,
    a_r,
    width,
    sliding,
    impulses,
    v,
):
    """Do ``count`` Gauss–Seidel sweeps over the pieces of W̃, and update v = W̃ Λ after each law."""
    xi, change = np.empty(width), np.empty(width)
    first_rolling = 1 + sliding
    for _ in range(count):
        for i in range(len(friction)):
            k, begin, end = width * i, np.int64(starts[i]), np.int64(starts[i + 1])
            block_free_velocity = free_velocity[k : k + width]
            _write_velocity_of_lanes(0, 1, begin, end, chunks, pieces, v, block_free_velocity, xi)
            new = max(impulses[k] - step_sizes[3 * i] * xi[0], lower[i])
            change[0], impulses[k] = new - impulses[k], new
            _push(0, 1, begin, end, chunks, pieces, change, v)
            if sliding > 0:
                _write_velocity_of_lanes(1, first_rolling, begin, end, chunks, pieces, v, block_free_velocity, xi)
                bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
                project_into_ball(step_sizes[3 * i + 1], bound, 1, xi, impulses[k + 1 : k + first_rolling], change)
                _push(1, first_rolling, begin, end, chunks, pieces, change, v)
            if first_rolling < width:
                _write_velocity_of_lanes(first_rolling, width, begin, end, chunks, pieces, v, block_free_velocity, xi)
                bound = a_r[i] + mu_r[i] * new
                project_into_ball(
                    step_sizes[3 * i + 2], bound, first_rolling, xi, impulses[k + first_rolling : k + width], change
                )
                _push(first_rolling, width, begin, end, chunks, pieces, change, v)
