"""Tasks of sweeps in several threads over contacts of balls: batches of ``sweeps.batches.ball_kernels``."""

from numba import njit, uint64

from ...sweeps.batches.ball_kernels import (
    ENTRIES_PER_RECORD,
    find_violations,
    in_frame,
    lane_velocity,
    update_impulses,
)
from ...sweeps.batches.lanes import LANES, gather_moves, scatter_moves_but_idle


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_ball_batch(balls, batch, motion, impulses, change, beta, turn, moves, scratch):  # type: ignore[no-untyped-def]
    """Update P, v and τ of the contacts of a batch; ``balls`` holds bodies, records, κ, normals and μ."""
    bodies, records, kappa, _, _ = balls
    lanes, first_lane = uint64(LANES), uint64(LANES) * uint64(batch)
    record, pair = uint64(ENTRIES_PER_RECORD) * first_lane, uint64(2) * first_lane
    gather_moves(bodies, pair, motion, moves)
    update_impulses(records, record, kappa, impulses, change, uint64(3) * first_lane, beta, turn, moves, scratch)
    # the idle ball of empty lanes and surfaces stays zero, because all threads read it
    scatter_moves_but_idle(bodies, pair, records, record + uint64(9) * lanes, moves, motion)


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def write_ball_velocities(balls, batch, motion, moves, velocity):  # type: ignore[no-untyped-def]
    """Write ξ of a batch in the order of Λ."""
    bodies, records, kappa, _, _ = balls
    lanes, first_lane = uint64(LANES), uint64(LANES) * uint64(batch)
    gather_moves(bodies, uint64(2) * first_lane, motion, moves)
    for lane in range(lanes):
        r, n = uint64(ENTRIES_PER_RECORD) * first_lane + lane, uint64(3) * first_lane + lane
        normal = records[r], records[r + lanes], records[r + uint64(2) * lanes]
        xi = in_frame(normal, lane_velocity(records, r, kappa, moves, lane))
        velocity[n], velocity[n + lanes], velocity[n + uint64(2) * lanes] = xi


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def raise_to_violations(balls, batch, motion, impulses, weights, moves, scratch, largest):  # type: ignore[no-untyped-def]
    """Raise ``largest`` of each lane to the squared violations of a batch, or to NaN if one is NaN."""
    bodies, records, kappa, _, _ = balls
    find_violations(bodies, records, kappa, impulses, motion, weights, uint64(batch), moves, scratch, largest)
