"""Compiled loops over contacts of balls in batches, from one record with a normal for each contact.

The balls of a system share κ = r²m/J for the radius r, the mass m and the moment of inertia J (see
``matrices.ball_contacts``). Sweeps use vectors in space, so that they need no tangents:

    u = v_i − v_j + n × s + c      with s = κ(τ_i + τ_j) and c = c_N n + c_1 T1 + c_2 T2,
    P = Λ_N n + Λ_T1 T1 + Λ_T2 T2.

Then ξ_N = n·u, and u − ξ_N n is the sliding velocity; P is split in the same way. When P changes by ΔP, a sweep updates
the velocity v and τ, where κτ = σ = rω for the angular velocity ω,

    v_i += ΔP/m_i,   v_j −= ΔP/m_j,   τ_i −= (n × ΔP)/m_i,   τ_j −= (n × ΔP)/m_j.

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
"""Number of entries of a record: n, c (vector), both step sizes, μ, and the inverse masses of both balls."""

SCRATCH = 8
"""Number of entries of a contact that one loop writes and the next one reads. Two loops with short chains of operations
take less time than one, because the processor executes more contacts simultaneously."""

WEIGHTS = 4
"""Number of entries of a contact in a check of the residual: α of the normal and of the friction law, and the
squares of the ratios by which ``Residual`` multiplies their violations."""


@njit(cache=True, fastmath={"contract"}, inline="always")
def in_frame(normal, vector):  # type: ignore[no-untyped-def]
    """Return the components of a vector along n, T1 and T2."""
    (x, y, z), (vx, vy, vz) = normal, vector
    (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
    return x * vx + y * vy + z * vz, t1x * vx + t1y * vy + t1z * vz, t2x * vx + t2y * vy + t2z * vz


@njit(cache=True, fastmath={"contract"}, inline="always")
def from_frame(normal, components):  # type: ignore[no-untyped-def]
    """Return the vector with given components along n, T1 and T2; the inverse of ``in_frame``."""
    (x, y, z), (along_normal, first, second) = normal, components
    (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
    return (
        along_normal * x + first * t1x + second * t2x,
        along_normal * y + first * t1y + second * t2y,
        along_normal * z + first * t1z + second * t2z,
    )


@njit(cache=True, fastmath=False, error_model="numpy")
def write_rows(normals, friction, slots, impulses, begin, end, rows):  # type: ignore[no-untyped-def]
    """Write Λ over the rows of the contacts from ``begin`` to ``end``, from P in the order of batches.

    Rounding may bring friction beyond its bound; it is then projected, so that it is exactly zero for μ = 0.
    The components of P of contact k are the entries ``slots[3k]``, ``slots[3k + 1]`` and ``slots[3k + 2]``. Without the
    explicit ``fastmath``, numba would take that of the kernel that calls, and write other numbers for each.
    """
    one, two, three = uint64(1), uint64(2), uint64(3)
    for c in range(uint64(begin), uint64(end)):
        x, y, z = uint64(slots[three * c]), uint64(slots[three * c + one]), uint64(slots[three * c + two])
        normal = normals[c, 0], normals[c, 1], normals[c, 2]
        along_normal, first, second = in_frame(normal, (impulses[x], impulses[y], impulses[z]))
        bound, squared = friction[c] * max(along_normal, 0.0), first * first + second * second
        scale = bound / np.sqrt(squared) if squared > bound * bound else 1.0
        rows[three * c], rows[three * c + one], rows[three * c + two] = along_normal, scale * first, scale * second


@njit(cache=True)
def write_impulses(normals, slots, rows, impulses):  # type: ignore[no-untyped-def]
    """Write P in the order of batches, from Λ over rows; the inverse of ``write_rows``."""
    one, two, three = uint64(1), uint64(2), uint64(3)
    for c in range(uint64(len(normals))):
        normal = normals[c, 0], normals[c, 1], normals[c, 2]
        x, y, z = from_frame(normal, (rows[three * c], rows[three * c + one], rows[three * c + two]))
        impulses[uint64(slots[three * c])] = x
        impulses[uint64(slots[three * c + one])] = y
        impulses[uint64(slots[three * c + two])] = z


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_balls(  # type: ignore[no-untyped-def]
    count, bodies, records, kappa, impulses, motion, change, previous_motion, momentum, delay, sweeps, beta
):
    """Do ``count`` sweeps on P (``impulses``), v and τ (``motion``), and return the β of the sweep after them.

    ``kappa`` is κ, and ``previous_motion`` is the motion at which the previous sweep began. The other arguments are
    those of ``pieces.sweep_batches``.
    """
    two, three, six, lanes = uint64(2), uint64(3), uint64(6), uint64(LANES)
    n_batches = uint64(len(bodies)) // (two * lanes)
    moves, turn, scratch = np.empty(six * lanes), np.empty(lanes), np.empty(uint64(SCRATCH) * lanes)
    for _ in range(count):
        if momentum > 0.0:
            extrapolate(motion, previous_motion, beta, 0, len(motion))
        turn[:] = 0.0
        for batch in range(n_batches):
            pair = two * lanes * batch
            gather_moves(bodies, pair, motion, moves)
            record, first_entry = uint64(ENTRIES_PER_RECORD) * lanes * batch, three * lanes * batch
            update_impulses(records, record, kappa, impulses, change, first_entry, beta, turn, moves, scratch)
            scatter_moves(bodies, pair, records, record + uint64(9) * lanes, moves, motion)
        sweeps += 1
        beta = 0.0 if turn.sum() > 0.0 else momentum_after(sweeps, momentum, delay)
    return beta


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_impulses(  # type: ignore[no-untyped-def]
    records, record, kappa, impulses, change, first_entry, beta, turn, moves, scratch
):
    """Update P of a batch, and replace ``moves``, which holds v_i − v_j and τ_i + τ_j, by ΔP and n × ΔP.

    P begins at ``first_entry``, and the records begin at ``record``. Add (P̂ − P⁺)·(P⁺ − P) to ``turn``, where P becomes
    P⁺ and P̂ = P + β ``change``. The second loop reads from ``scratch`` the projected impulse and the ratio of the
    friction bound to the friction before it is projected, if that is larger.
    """
    lanes = uint64(LANES)
    k1, k2, k3, k4 = lanes, uint64(2) * lanes, uint64(3) * lanes, uint64(4) * lanes
    k5, k6, k7, k8 = uint64(5) * lanes, uint64(6) * lanes, uint64(7) * lanes, uint64(8) * lanes
    for lane in range(lanes):
        r, a = record + lane, first_entry + lane
        b, c = a + k1, a + k2
        x, y, z = records[r], records[r + k1], records[r + k2]
        ux, uy, uz = lane_velocity(records, r, kappa, moves, lane)
        normal = x * ux + y * uy + z * uz
        old_x, old_y = impulses[a] + beta * change[a], impulses[b] + beta * change[b]
        old_z = impulses[c] + beta * change[c]
        old_n, step_size_t = x * old_x + y * old_y + z * old_z, records[r + k7]
        new_n = max(old_n - records[r + k6] * normal, 0.0)
        along_normal = old_n - step_size_t * normal
        tx, ty = old_x - step_size_t * ux - along_normal * x, old_y - step_size_t * uy - along_normal * y
        tz = old_z - step_size_t * uz - along_normal * z
        bound, squared = records[r + k8] * new_n, tx * tx + ty * ty + tz * tz
        scratch[lane], scratch[lane + k1], scratch[lane + k2], scratch[lane + k3] = new_n, tx, ty, tz
        scratch[lane + k4] = bound / np.sqrt(squared) if squared > bound * bound else 1.0
    for lane in range(lanes):
        r, a = record + lane, first_entry + lane
        b, c = a + k1, a + k2
        x, y, z = records[r], records[r + k1], records[r + k2]
        ahead_x, ahead_y, ahead_z = beta * change[a], beta * change[b], beta * change[c]
        new_n, scale = scratch[lane], scratch[lane + k4]
        new_x, new_y = new_n * x + scale * scratch[lane + k1], new_n * y + scale * scratch[lane + k2]
        new_z = new_n * z + scale * scratch[lane + k3]
        step_x, step_y, step_z = new_x - impulses[a], new_y - impulses[b], new_z - impulses[c]
        turn[lane] += (ahead_x - step_x) * step_x + (ahead_y - step_y) * step_y + (ahead_z - step_z) * step_z
        dx, dy = new_x - (impulses[a] + ahead_x), new_y - (impulses[b] + ahead_y)
        dz = new_z - (impulses[c] + ahead_z)
        change[a], change[b], change[c] = step_x, step_y, step_z
        impulses[a], impulses[b], impulses[c] = new_x, new_y, new_z
        moves[lane], moves[lane + k1], moves[lane + k2] = dx, dy, dz
        moves[lane + k3], moves[lane + k4], moves[lane + k5] = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def largest_violation(bodies, records, kappa, impulses, motion, weights):  # type: ignore[no-untyped-def]
    """Return the largest violation of a law times its ratio [m/s], as ``Residual`` measures it.

    u of all contacts follows from the final v and τ, which takes one more pass over the records.
    """
    moves, scratch, largest = np.empty(6 * LANES), np.empty(SCRATCH * LANES), np.zeros(LANES)
    for batch in range(uint64(len(bodies)) // (uint64(2) * uint64(LANES))):
        find_violations(bodies, records, kappa, impulses, motion, weights, batch, moves, scratch, largest)
    return np.sqrt(largest_of_lanes(largest))


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_window(  # type: ignore[no-untyped-def]
    counts, lowest, limit, scale, contacts, state, momentum, delay, sweeps, beta, weights, best, residuals
):
    """Do each number of sweeps, and write the residual after each; return the number of residuals and the next β.

    Stop at the first residual that is not between ``lowest`` and ``limit``. ``best`` becomes the P with the lowest
    residual before the last one. The residual is the largest violation divided by ``scale``. ``contacts`` holds bodies,
    records and κ, and ``state`` holds P, motion, change and previous motion, as ``sweep_balls`` takes them. ``weights``
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
        residual = largest_violation(bodies, records, kappa, impulses, motion, weights) / scale
        residuals[check] = residual
        if check + uint64(1) == n_checks or not lowest < residual < limit:
            break
        if residual < best_residual:
            best_residual = residual
            for entry in range(uint64(len(best))):
                best[entry] = impulses[entry]
    return check + uint64(1), beta


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def find_violations(  # type: ignore[no-untyped-def]
    bodies, records, kappa, impulses, motion, weights, batch, moves, scratch, largest
):
    """Raise ``largest`` of each lane to the squared violations of a batch, or to NaN if one is NaN."""
    k1 = uint64(LANES)
    k2, k3, k4, k5 = uint64(2) * k1, uint64(3) * k1, uint64(4) * k1, uint64(5) * k1
    k6, k7, k8 = uint64(6) * k1, uint64(7) * k1, uint64(8) * k1
    gather_moves(bodies, k2 * batch, motion, moves)
    record, first_entry, weight = uint64(ENTRIES_PER_RECORD) * k1 * batch, k3 * batch, uint64(WEIGHTS) * k1 * batch
    for lane in range(k1):
        r, n, w = record + lane, first_entry + lane, weight + lane
        x, y, z = records[r], records[r + k1], records[r + k2]
        px, py, pz = impulses[n], impulses[n + k1], impulses[n + k2]
        ux, uy, uz = lane_velocity(records, r, kappa, moves, lane)
        normal, impulse = x * ux + y * uy + z * uz, x * px + y * py + z * pz
        held, alpha = weights[w] * impulse, weights[w + k1]
        unilateral = held if held < normal or held != held else normal
        scratch[lane] = unilateral * unilateral * weights[w + k2]
        scratch[lane + k1] = alpha * (records[r + k8] * max(impulse, 0.0))
        scratch[lane + k2] = alpha * (px - impulse * x)
        scratch[lane + k3] = alpha * (py - impulse * y)
        scratch[lane + k4] = alpha * (pz - impulse * z)
        scratch[lane + k5], scratch[lane + k6] = ux - normal * x, uy - normal * y
        scratch[lane + k7] = uz - normal * z
    for lane in range(k1):
        held_friction = scratch[lane + k2], scratch[lane + k3], scratch[lane + k4]
        sliding_velocity = scratch[lane + k5], scratch[lane + k6], scratch[lane + k7]
        square = outside_disc(held_friction, sliding_velocity, scratch[lane + k1])
        normal_part, friction_part = scratch[lane], square * weights[weight + lane + k3]
        part = friction_part if friction_part > normal_part or friction_part != friction_part else normal_part
        largest[lane] = part if part > largest[lane] or part != part else largest[lane]


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def lane_velocity(records, r, kappa, moves, lane):  # type: ignore[no-untyped-def]
    """Return u of one contact, whose record begins at ``r``; ``moves`` as ``gather_moves`` writes it."""
    k1 = uint64(LANES)
    k2, k3, k4, k5 = uint64(2) * k1, uint64(3) * k1, uint64(4) * k1, uint64(5) * k1
    x, y, z = records[r], records[r + k1], records[r + k2]
    sx, sy, sz = kappa * moves[lane + k3], kappa * moves[lane + k4], kappa * moves[lane + k5]
    return (
        moves[lane] + records[r + k3] + (y * sz - z * sy),
        moves[lane + k1] + records[r + k4] + (z * sx - x * sz),
        moves[lane + k2] + records[r + k5] + (x * sy - y * sx),
    )


@njit(cache=True, inline="always")
def largest_of_lanes(largest):  # type: ignore[no-untyped-def]
    """Return the largest of several squares, or NaN if one is NaN."""
    square = 0.0
    for k in range(len(largest)):
        part = largest[k]
        square = part if part > square or part != part else square
    return square
