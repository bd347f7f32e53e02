"""Tasks of sweeps by colour over contacts of balls: batches of ``sweeps.batches.balls``."""

from numba import njit, uint64

from ....problems.contact.matrices.contact_frame import tangents
from ...sweeps.batches.balls import NUMBERS, gather_balls, in_frame, update_balls
from ...sweeps.batches.pieces import LANES


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_ball_batch(balls, batch, moved, held, change, present, turn, own, others):  # type: ignore[no-untyped-def]
    """Update Λ, v and τ of the contacts of a batch; ``balls`` holds bodies, records and κ of ``BallSweep``."""
    bodies, records, share = balls
    lanes, at = uint64(LANES), uint64(LANES) * uint64(batch)
    gather_balls(bodies, uint64(2) * at, moved, own, others)
    record = uint64(NUMBERS) * at
    update_balls(records, record, share, held, change, uint64(3) * at, present, turn, own, others)
    six, idle, pair = uint64(6), uint64(len(moved)) - uint64(6), uint64(2) * at
    for lane in range(lanes):  # the idle ball, which is last, remains zero, because all threads read it
        a, b = uint64(bodies[pair + lane]), uint64(bodies[pair + lanes + lane])
        if a != idle:
            for k in range(six):
                moved[a + k] = own[lanes * k + lane]
        if b != idle:
            for k in range(six):
                moved[b + k] = others[lanes * k + lane]


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def write_ball_velocities(balls, batch, moved, own, others, velocity):  # type: ignore[no-untyped-def]
    """Write ξ of a batch in the order of Λ."""
    bodies, records, share = balls
    one, at = uint64(LANES), uint64(LANES) * uint64(batch)
    gather_balls(bodies, uint64(2) * at, moved, own, others)
    two, three, four, five = uint64(2) * one, uint64(3) * one, uint64(4) * one, uint64(5) * one
    for lane in range(one):
        r, n = uint64(NUMBERS) * at + lane, uint64(3) * at + lane
        x, y, z = records[r], records[r + one], records[r + two]
        first, second = tangents(x, y, z)
        dx = own[lane] - others[lane]
        dy = own[lane + one] - others[lane + one]
        dz = own[lane + two] - others[lane + two]
        sx = share * (own[lane + three] + others[lane + three])
        sy = share * (own[lane + four] + others[lane + four])
        sz = share * (own[lane + five] + others[lane + five])
        free = records[r + three], records[r + four], records[r + five]
        found = in_frame((x, y, z), first, second, (dx, dy, dz), (sx, sy, sz), free)
        velocity[n], velocity[n + one], velocity[n + two] = found
