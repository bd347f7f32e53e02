"""Compiled loops over contacts of balls in batches, from one record with a normal for each contact.

The balls of a system share κ = r²m/J for the radius r, the mass m and the moment of inertia J (see
``matrices.ball_contacts``). When the impulse of a contact changes by P, a sweep updates the velocity v and τ, where
κτ = σ = rω for the angular velocity ω,

    ξ = n·d + c_N,   T1·d − T2·s + c_1,   T2·d + T1·s + c_2      with d = v_i − v_j, s = κ(τ_i + τ_j),
    v_i += P/m_i,   v_j −= P/m_j,   τ_i −= (n × P)/m_i,   τ_j −= (n × P)/m_j.

A record takes 88 bytes, and the indices of both balls take 8. In the general form (``pieces``), the two pieces and the
other data of a contact take 360 bytes, and the indices take 16.
"""

import numpy as np
from numba import njit, uint64

from ....problems.contact.matrices.contact_frame import tangents
from ....problems.contact.residual import outside_disc
from ...iteration.momentum import extrapolate, momentum_after
from .lanes import LANES, gather_moves, scatter_moves

ENTRIES_PER_RECORD = 11
"""Number of entries of a record: n, c, both step sizes, μ, and the inverse masses of both balls."""

WEIGHTS = 4
"""Number of entries of a contact in a check of the residual: α of the normal and of the friction law, and the
squares of the ratios by which ``Residual`` multiplies their violations."""


@njit(cache=True, fastmath={"contract"}, inline="always")
def velocity_in_frame(frame, difference, spin, free_velocity):  # type: ignore[no-untyped-def]
    """Return ξ of a contact: n·d + c_N, T1·d − T2·s + c_1 and T2·d + T1·s + c_2.

    ``frame`` is (n, T1, T2), ``difference`` is d, ``spin`` is s, and ``free_velocity`` is c.
    """
    (x, y, z), (t1x, t1y, t1z), (t2x, t2y, t2z) = frame
    (dx, dy, dz), (sx, sy, sz) = difference, spin
    along_normal = free_velocity[0] + x * dx + y * dy + z * dz
    along_first = free_velocity[1] + (t1x * dx + t1y * dy + t1z * dz) - (t2x * sx + t2y * sy + t2z * sz)
    along_second = free_velocity[2] + (t2x * dx + t2y * dy + t2z * dz) + (t1x * sx + t1y * sy + t1z * sz)
    return along_normal, along_first, along_second


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_balls(  # type: ignore[no-untyped-def]
    count, bodies, records, kappa, impulses, motion, change, previous_motion, momentum, delay, sweeps, beta
):
    """Do ``count`` sweeps on Λ (``impulses``), v and τ (``motion``), and return the β of the sweep after them.

    ``kappa`` is κ, and ``previous_motion`` is the motion at which the previous sweep began. The other arguments are
    those of ``pieces.sweep_batches``.
    """
    two, three, six, lanes = uint64(2), uint64(3), uint64(6), uint64(LANES)
    n_batches = uint64(len(bodies)) // (two * lanes)
    moves, turn = np.empty(six * lanes), np.empty(lanes)
    for _ in range(count):
        if momentum > 0.0:
            extrapolate(motion, previous_motion, beta, 0, len(motion))
        turn[:] = 0.0
        for batch in range(n_batches):
            pair = two * lanes * batch
            gather_moves(bodies, pair, motion, moves)
            record, first_entry = uint64(ENTRIES_PER_RECORD) * lanes * batch, three * lanes * batch
            update_impulses(records, record, kappa, impulses, change, first_entry, beta, turn, moves)
            scatter_moves(bodies, pair, records, record + uint64(9) * lanes, moves, motion)
        sweeps += 1
        beta = 0.0 if turn.sum() > 0.0 else momentum_after(sweeps, momentum, delay)
    return beta


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_impulses(records, record, kappa, impulses, change, first_entry, beta, turn, moves):  # type: ignore[no-untyped-def]
    """Update Λ of a batch, and replace ``moves``, which holds v_i − v_j and τ_i + τ_j, by P and n × P.

    Λ begins at ``first_entry``, and the records begin at ``record``. Add (Λ̂ − Λ⁺)·(Λ⁺ − Λ) to ``turn``, where Λ becomes
    Λ⁺ and Λ̂ = Λ + β ``change``.
    """
    lanes = uint64(LANES)
    k1, k2, k3, k4, k5 = lanes, uint64(2) * lanes, uint64(3) * lanes, uint64(4) * lanes, uint64(5) * lanes
    k6, k7, k8 = uint64(6) * lanes, uint64(7) * lanes, uint64(8) * lanes
    for lane in range(lanes):
        r, n = record + lane, first_entry + lane
        t1, t2 = n + k1, n + k2
        x, y, z = records[r], records[r + k1], records[r + k2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
        difference = moves[lane], moves[lane + k1], moves[lane + k2]
        spin = kappa * moves[lane + k3], kappa * moves[lane + k4], kappa * moves[lane + k5]
        free_velocity = records[r + k3], records[r + k4], records[r + k5]
        frame = (x, y, z), (t1x, t1y, t1z), (t2x, t2y, t2z)
        normal, first, second = velocity_in_frame(frame, difference, spin, free_velocity)
        ahead_n, ahead_t1, ahead_t2 = beta * change[n], beta * change[t1], beta * change[t2]
        old_n, old_t1, old_t2 = impulses[n] + ahead_n, impulses[t1] + ahead_t1, impulses[t2] + ahead_t2
        step_size_t = records[r + k7]
        new_n = max(old_n - records[r + k6] * normal, 0.0)
        new_t1, new_t2 = old_t1 - step_size_t * first, old_t2 - step_size_t * second
        bound = records[r + k8] * new_n
        squared = new_t1 * new_t1 + new_t2 * new_t2
        scale = bound / np.sqrt(squared) if squared > bound * bound else 1.0
        new_t1 *= scale
        new_t2 *= scale
        step_n, step_t1, step_t2 = new_n - impulses[n], new_t1 - impulses[t1], new_t2 - impulses[t2]
        turn[lane] += (ahead_n - step_n) * step_n + (ahead_t1 - step_t1) * step_t1 + (ahead_t2 - step_t2) * step_t2
        change[n], change[t1], change[t2] = step_n, step_t1, step_t2
        impulses[n], impulses[t1], impulses[t2] = new_n, new_t1, new_t2
        dn, dt1, dt2 = new_n - old_n, new_t1 - old_t1, new_t2 - old_t2
        moves[lane] = dn * x + dt1 * t1x + dt2 * t2x
        moves[lane + k1] = dn * y + dt1 * t1y + dt2 * t2y
        moves[lane + k2] = dn * z + dt1 * t1z + dt2 * t2z
        moves[lane + k3] = dt1 * t2x - dt2 * t1x
        moves[lane + k4] = dt1 * t2y - dt2 * t1y
        moves[lane + k5] = dt1 * t2z - dt2 * t1z


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def largest_violation(bodies, records, kappa, impulses, motion, weights, slots, rows):  # type: ignore[no-untyped-def]
    """Write Λ over rows; return the largest violation of a law times its ratio [m/s], as ``Residual`` measures it.

    ξ of all contacts follows from the final v and τ, which takes one more pass over the records.
    """
    for row in range(len(slots)):
        rows[row] = impulses[slots[row]]
    return _largest_violation(bodies, records, kappa, impulses, motion, weights)


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _largest_violation(bodies, records, kappa, impulses, motion, weights):  # type: ignore[no-untyped-def]
    moves, largest = np.empty(6 * LANES), np.zeros(LANES)
    for batch in range(uint64(len(bodies)) // (uint64(2) * uint64(LANES))):
        find_violations(bodies, records, kappa, impulses, motion, weights, batch, moves, largest)
    return np.sqrt(largest_of_lanes(largest))


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_window(  # type: ignore[no-untyped-def]
    counts, lowest, limit, scale, contacts, state, momentum, delay, sweeps, beta, weights, best, residuals
):
    """Do each number of sweeps, and write the residual after each; return the number of residuals and the next β.

    Stop at the first residual that is not between ``lowest`` and ``limit``. ``best`` becomes the Λ with the lowest
    residual before the last one. The residual is the largest violation divided by ``scale``. ``contacts`` holds bodies,
    records and κ, and ``state`` holds Λ, motion, change and previous motion, as ``sweep_balls`` takes them. ``weights``
    is as in ``largest_violation``.
    """
    (bodies, records, kappa), (impulses, motion, change, previous_motion) = contacts, state
    best_residual, n_checks = np.inf, uint64(len(counts))
    for check in range(n_checks):
        count = counts[check]
        beta = sweep_balls(
            count, bodies, records, kappa, impulses, motion, change, previous_motion, momentum, delay, sweeps, beta
        )
        sweeps += count
        residual = _largest_violation(bodies, records, kappa, impulses, motion, weights) / scale
        residuals[check] = residual
        if check + uint64(1) == n_checks or not lowest < residual < limit:
            break
        if residual < best_residual:
            best_residual = residual
            for entry in range(uint64(len(best))):
                best[entry] = impulses[entry]
    return check + uint64(1), beta


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def find_violations(bodies, records, kappa, impulses, motion, weights, batch, moves, largest):  # type: ignore[no-untyped-def]
    """Raise ``largest`` of each lane to the squared violations of a batch, or to NaN if one is NaN."""
    k1 = uint64(LANES)
    k2, k3 = uint64(2) * k1, uint64(3) * k1
    gather_moves(bodies, k2 * batch, motion, moves)
    record, first_entry, weight = uint64(ENTRIES_PER_RECORD) * k1 * batch, k3 * batch, uint64(WEIGHTS) * k1 * batch
    for lane in range(k1):
        r, n, w = record + lane, first_entry + lane, weight + lane
        normal, first, second = lane_velocity(records, r, kappa, moves, lane)
        impulse_velocity, friction_alpha = weights[w] * impulses[n], weights[w + k1]
        unilateral = impulse_velocity if impulse_velocity < normal or impulse_velocity != impulse_velocity else normal
        bound = friction_alpha * (records[r + uint64(8) * k1] * max(impulses[n], 0.0))
        square = outside_disc(
            friction_alpha * impulses[n + k1], friction_alpha * impulses[n + k2], first, second, bound
        )
        normal_part, friction_part = unilateral * unilateral * weights[w + k2], square * weights[w + k3]
        part = friction_part if friction_part > normal_part or friction_part != friction_part else normal_part
        largest[lane] = part if part > largest[lane] or part != part else largest[lane]


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def lane_velocity(records, r, kappa, moves, lane):  # type: ignore[no-untyped-def]
    """Return ξ of one contact, whose record begins at ``r``; ``moves`` as ``gather_moves`` writes it."""
    k1 = uint64(LANES)
    k2, k3, k4, k5 = uint64(2) * k1, uint64(3) * k1, uint64(4) * k1, uint64(5) * k1
    x, y, z = records[r], records[r + k1], records[r + k2]
    first, second = tangents(x, y, z)
    difference = moves[lane], moves[lane + k1], moves[lane + k2]
    spin = kappa * moves[lane + k3], kappa * moves[lane + k4], kappa * moves[lane + k5]
    free_velocity = records[r + k3], records[r + k4], records[r + k5]
    return velocity_in_frame(((x, y, z), first, second), difference, spin, free_velocity)


@njit(cache=True, inline="always")
def largest_of_lanes(largest):  # type: ignore[no-untyped-def]
    """Return the largest of several squares, or NaN if one is NaN."""
    square = 0.0
    for k in range(len(largest)):
        part = largest[k]
        square = part if part > square or part != part else square
    return square
