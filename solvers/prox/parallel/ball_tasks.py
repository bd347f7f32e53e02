"""Tasks of sweeps in several threads over contacts of balls: batches of ``sweeps.batches.ball_kernels``."""

from typing import NamedTuple

import numpy as np
from numba import njit, uint64

from ....problems.arrays import FloatArray
from ...sweeps.batches.ball_kernels import (
    ENTRIES_PER_RECORD,
    find_violations,
    in_frame,
    lane_velocity,
    update_impulses,
)
from ...sweeps.batches.lanes import LANES, gather_moves, scatter_moves_but_idle


class BallBatches(NamedTuple):
    """The constant data of the tasks.

    Attributes:
        bodies: first coordinate of both balls of each lane, shape (n_batches · 2 · LANES,).
        records: data of all contacts, in batches, shape (n_batches · ENTRIES_PER_RECORD · LANES,).
        spin_ratio: κ = r²m/J.
        normals: normals of the contacts, in their order, shape (n_contacts, 3).
        friction: μ of the contacts, in their order, shape (n_contacts,).
    """

    bodies: np.ndarray[tuple[int, ...], np.dtype[np.uint32]]
    records: FloatArray
    spin_ratio: float
    normals: FloatArray
    friction: FloatArray


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_ball_batch(balls, batch, motion, impulses, change, beta, turn, moves, scratch):  # type: ignore[no-untyped-def]
    """Update P, v and τ of the contacts of a batch."""
    bodies, records = balls.bodies, balls.records
    lanes, first_lane = uint64(LANES), uint64(LANES) * uint64(batch)
    record, pair = uint64(ENTRIES_PER_RECORD) * first_lane, uint64(2) * first_lane
    gather_moves(bodies, pair, motion, moves)
    first = uint64(3) * first_lane
    update_impulses(records, record, balls.spin_ratio, impulses, change, first, beta, turn, moves, scratch)
    # the idle ball of empty lanes and surfaces stays zero, because all threads read it
    scatter_moves_but_idle(bodies, pair, records, record + uint64(9) * lanes, moves, motion)


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def write_ball_velocities(balls, batch, motion, moves, velocity):  # type: ignore[no-untyped-def]
    """Write ξ of a batch in the order of Λ."""
    bodies, records = balls.bodies, balls.records
    lanes, first_lane = uint64(LANES), uint64(LANES) * uint64(batch)
    gather_moves(bodies, uint64(2) * first_lane, motion, moves)
    for lane in range(lanes):
        r, n = uint64(ENTRIES_PER_RECORD) * first_lane + lane, uint64(3) * first_lane + lane
        normal = records[r], records[r + lanes], records[r + uint64(2) * lanes]
        xi = in_frame(normal, lane_velocity(records, r, balls.spin_ratio, moves, lane))
        velocity[n], velocity[n + lanes], velocity[n + uint64(2) * lanes] = xi


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def raise_to_violations(balls, batch, motion, impulses, weights, moves, scratch, largest):  # type: ignore[no-untyped-def]
    """Raise ``largest`` of each lane to the squared violations of a batch, or to NaN if one is NaN."""
    bodies, records, kappa = balls.bodies, balls.records, balls.spin_ratio
    find_violations(bodies, records, kappa, impulses, motion, weights, uint64(batch), moves, scratch, largest)
