"""Sweeps over contacts of balls in batches, from one record with a normal for each contact.

The iterates are those of ``pieces``. In place of two pieces of W̃, a contact has its normal and the inverse masses of
its balls, because the balls of a system share κ = r²m/J (see ``matrices.ball_contacts``). When the impulse of a contact
changes by P, a sweep updates v and τ, where κτ = σ = rω for the radius r and the angular velocity ω,

    ξ = n·d + c_N,   T1·d − T2·s + c_1,   T2·d + T1·s + c_2      with d = v_i − v_j, s = κ(τ_i + τ_j),
    v_i += P/m_i,   v_j −= P/m_j,   τ_i −= (n × P)/m_i,   τ_j −= (n × P)/m_j.

A record takes 88 bytes, and the indices of both balls take 8. Two pieces with the other data would take 360, and their
indices 16.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.answer import ratio
from ....problems.contact.blocks import BlockLayout
from ....problems.contact.matrices.contact_frame import tangents
from ....problems.contact.matrices.pieces import BallRecords, Pieces
from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual, outside_disc
from ...iteration.loop import SinglePassIterates
from ...iteration.momentum import MomentumState, momentum_after
from .pieces import LANES, MIN_FILL, assign_batches

NUMBERS = 11
"""Number of entries of a record: n, c, both step sizes, μ, and the inverse masses of both balls."""

EQUALITY_TOLERANCE = 1e-12
"""Relative difference up to which the κ of two balls, or two entries of M⁻¹, count as equal."""


class Balls(NamedTuple):
    """The balls of a problem, from which the records of its contacts are created.

    Attributes:
        directions: W.
        contacts: the records of all contacts, in their order.
        inverse_masses: 1/m of each ball, and 0 for surfaces [1/kg], shape (n_balls + 1,).
        spin_share: κ = r²m/J.
    """

    directions: Pieces
    contacts: BallRecords
    inverse_masses: FloatArray
    spin_share: float

    def pack(self, problem: ContactProblem, sizes: FloatArray, places: IntArray, n_batches: int) -> tuple[Any, ...]:
        """Return bodies, records and slots of ``BallSweep`` for contacts at ``places`` (batch · LANES + lane)."""
        given = self.contacts.chunks, self.contacts.normals, problem.free_velocity, sizes
        packed: tuple[Any, ...] = _pack(
            *given, problem.layout.friction_coefficient, self.inverse_masses, places, n_batches
        )
        return packed

    def motion(self, impulses: FloatArray) -> FloatArray:
        """Return v and τ of all balls, and zeros for surfaces, from Λ over rows; flat from shape (n_balls + 1, 6)."""
        moved = np.zeros(6 * len(self.inverse_masses))
        if impulses.any():
            _write_motion(self.contacts.chunks, self.contacts.normals, self.inverse_masses, impulses, moved)
        return moved


def balls_of(problem: ContactProblem) -> Balls | None:
    """Return the balls of a problem, or None if its contacts are not those of balls that share κ."""
    factors, layout = problem.factors, problem.layout
    if factors is None or not isinstance(factors.directions, Pieces):
        return None
    pieces = factors.directions
    contacts = pieces.balls
    if contacts is None or not (layout.width == 3 and layout.has_contacts_only):
        return None
    if not factors.inverse_mass.is_diagonal or not layout.is_dense or not layout.bounds_are_own:
        return None
    inverse_masses = np.zeros(pieces.n_chunks + 1)
    spin_share = float(_write_inverse_masses(factors.inverse_mass.matrix.data, contacts.radii, inverse_masses))
    if spin_share <= 0.0 or layout.fixed_bound.any():
        return None
    return Balls(pieces, contacts, inverse_masses, spin_share)


@dataclass(frozen=True, eq=False)
class BallSweep:
    """The constant data of a sweep.

    Attributes:
        layout: the padded blocks.
        balls: the balls.
        free: c, flat.
        bodies: first coordinate of both balls of each lane, shape (n_batches · 2 · LANES,).
        records: numbers of all contacts in batches, shape (n_batches · NUMBERS · LANES,).
        slots: position of each entry of Λ in the order of batches.
    """

    layout: BlockLayout
    balls: Balls
    free: FloatArray
    bodies: np.ndarray[tuple[int, ...], np.dtype[np.uint32]]
    records: FloatArray
    slots: IntArray

    @staticmethod
    def over(problem: ContactProblem, sizes: FloatArray) -> "BallSweep | None":
        """Return the sweep with step sizes as in ``step_size``.

        Return None if batches would have few contacts, or the contacts are not those of balls that share κ.
        """
        balls = balls_of(problem)
        if balls is None:
            return None
        batches = assign_batches(balls.directions)
        if len(batches.places) < MIN_FILL * LANES * batches.n_batches:
            return None
        bodies, records, slots = balls.pack(problem, sizes, *batches)
        return BallSweep(problem.layout, balls, problem.free_velocity, bodies, records, slots)

    def begin(self, start: FloatArray, momentum: float = 0.0, delay: float = 0.0) -> "BallIterates":
        """Return the iterates that begin at ``start``, shape (n_rows,); see ``MomentumState``."""
        return BallIterates(self, start, momentum, delay)


class BallIterates(MomentumState, SinglePassIterates):
    """Λ, in the order of batches, and v and τ of all balls, of a Gauss–Seidel iteration."""

    def __init__(self, sweep: BallSweep, start: FloatArray, momentum: float, delay: float = 0.0) -> None:
        MomentumState.__init__(self, momentum, delay)
        self._sweep = sweep
        self._held = np.zeros(3 * len(sweep.bodies) // 2)
        self._held[sweep.slots] = start
        self._moved = sweep.balls.motion(start)
        self._change = np.zeros_like(self._held)
        self._before = self._moved.copy() if momentum > 0.0 else self._moved
        self._relative = np.empty(len(start))

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        data = self._sweep
        arrays = (self._held, self._moved, self._change, self._before)
        momentum = self._momentum, self._delay, self._sweeps, self._present
        self._present = sweep_balls(count, data.bodies, data.records, data.balls.spin_share, *arrays, *momentum)
        self._sweeps += count

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._held[self._sweep.slots]

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        data, contacts = self._sweep, self._sweep.balls.contacts
        share = data.balls.spin_share
        _write_relative(contacts.chunks, contacts.normals, share, data.free, self._moved, self._relative)
        return self._relative

    def impulses_and_residual(self, residual: Residual) -> tuple[FloatArray, float]:
        """Return Λ over rows and its residual."""
        if type(residual) is not Residual or residual.unit != 1.0 or residual.infeasible:
            impulses = self.impulses()
            return impulses, residual(impulses, self.relative_velocity())
        data, contacts, impulses = self._sweep, self._sweep.balls.contacts, np.empty(len(self._sweep.slots))
        motion = contacts.chunks, contacts.normals, data.balls.spin_share, data.free, self._moved
        laws = data.layout.friction_coefficient, residual.alpha, residual.ratios
        violation = _write_impulses_and_measure(*motion, *laws, data.slots, self._held, impulses)
        return impulses, ratio(violation, residual.scale)


@njit(cache=True)
def _write_inverse_masses(inverse, radii, inverse_masses):  # type: ignore[no-untyped-def]
    """Write 1/m of each ball and return κ = r²m/J, or 0 if balls differ in κ or have several moments of inertia."""
    share = 0.0
    for ball in range(len(radii)):
        linear, angular = inverse[6 * ball], inverse[6 * ball + 3]
        for axis in range(1, 3):
            if abs(inverse[6 * ball + axis] - linear) > EQUALITY_TOLERANCE * linear:
                return 0.0
            if abs(inverse[6 * ball + 3 + axis] - angular) > EQUALITY_TOLERANCE * angular:
                return 0.0
        inverse_masses[ball] = linear
        own = radii[ball] * radii[ball] * angular / linear
        if ball == 0:
            share = own
        if abs(own - share) > EQUALITY_TOLERANCE * share:
            return 0.0
    return share


@njit(cache=True)
def _pack(chunks, normals, free, sizes, friction, inverse_masses, places, n_batches):  # type: ignore[no-untyped-def]
    """Return the first coordinate of both balls of each lane, the records, and slots as in ``slots_in_batches``."""
    slots = np.empty(3 * len(places), dtype=np.int64)
    idle = len(inverse_masses) - 1
    bodies = np.full(n_batches * 2 * LANES, 6 * idle, dtype=np.uint32)
    records = np.zeros(n_batches * NUMBERS * LANES)
    for c in range(len(places)):
        batch, lane = places[c] // LANES, places[c] % LANES
        i, j, at = chunks[2 * c], chunks[2 * c + 1], NUMBERS * LANES * batch + lane
        bodies[2 * LANES * batch + lane], bodies[(2 * batch + 1) * LANES + lane] = 6 * i, 6 * j
        for k in range(3):
            records[at + LANES * k] = normals[c, k]
            records[at + LANES * (3 + k)] = free[3 * c + k]
            slots[3 * c + k] = LANES * (3 * batch + k) + lane
        records[at + LANES * 6], records[at + LANES * 7] = sizes[c, 0], sizes[c, 1]
        records[at + LANES * 8] = friction[c]
        records[at + LANES * 9], records[at + LANES * 10] = inverse_masses[i], inverse_masses[j]
    return bodies, records, slots


@njit(cache=True, fastmath={"contract"})
def _write_motion(chunks, normals, inverse_masses, impulses, moved):  # type: ignore[no-untyped-def]
    """Write v and τ of given impulses."""
    for c in range(len(normals)):
        x, y, z = normals[c, 0], normals[c, 1], normals[c, 2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
        held, one, two = impulses[3 * c], impulses[3 * c + 1], impulses[3 * c + 2]
        push = (held * x + one * t1x + two * t2x, held * y + one * t1y + two * t2y, held * z + one * t1z + two * t2z)
        turn = (one * t2x - two * t1x, one * t2y - two * t1y, one * t2z - two * t1z)
        for side in range(2):
            ball, sign = chunks[2 * c + side], 1.0 - 2.0 * side
            for axis in range(3):
                moved[6 * ball + axis] += sign * inverse_masses[ball] * push[axis]
                moved[6 * ball + 3 + axis] -= inverse_masses[ball] * turn[axis]


@njit(cache=True, fastmath={"contract"})
def _write_relative(chunks, normals, share, free, moved, relative):  # type: ignore[no-untyped-def]
    """Write ξ = GΛ + c."""
    for c in range(len(normals)):
        found = _relative(c, chunks, normals, share, free, moved)
        relative[3 * c], relative[3 * c + 1], relative[3 * c + 2] = found


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _write_impulses_and_measure(  # type: ignore[no-untyped-def]
    chunks, normals, share, free, moved, friction, alpha, ratios, slots, held, impulses
):
    """Write Λ over rows; return the largest violation of a law times its ratio [m/s], as ``Residual`` measures it."""
    largest, lanes = 0.0, uint64(LANES)
    for c in range(uint64(len(normals))):
        row, law, slot = uint64(3) * c, uint64(2) * c, uint64(slots[uint64(3) * c])
        own = held[slot], held[slot + lanes], held[slot + uint64(2) * lanes]
        impulses[row], impulses[row + uint64(1)], impulses[row + uint64(2)] = own
        normal, first, second = _relative(c, chunks, normals, share, free, moved)
        pressed = alpha[law] * own[0]
        violation = pressed if pressed < normal or pressed != pressed else normal
        stiffness = alpha[law + uint64(1)]
        bound = stiffness * (friction[c] * max(own[0], 0.0))
        square = outside_disc(stiffness * own[1], stiffness * own[2], first, second, bound)
        for squared in (violation * violation, square):
            relative = squared * ratios[law] * ratios[law]
            largest = relative if relative > largest or relative != relative else largest
    return np.sqrt(largest)


@njit(cache=True, fastmath={"contract"}, inline="always")
def in_frame(normal, first, second, apart, turned, free):  # type: ignore[no-untyped-def]
    """Return n·d + c_N, T1·d − T2·s + c_1 and T2·d + T1·s + c_2."""
    (x, y, z), (dx, dy, dz), (sx, sy, sz) = normal, apart, turned
    (t1x, t1y, t1z), (t2x, t2y, t2z) = first, second
    along_normal = free[0] + x * dx + y * dy + z * dz
    along_first = free[1] + (t1x * dx + t1y * dy + t1z * dz) - (t2x * sx + t2y * sy + t2z * sz)
    along_second = free[2] + (t2x * dx + t2y * dy + t2z * dz) + (t1x * sx + t1y * sy + t1z * sz)
    return along_normal, along_first, along_second


@njit(cache=True, fastmath={"contract"}, inline="always")
def _relative(c, chunks, normals, share, free, moved):  # type: ignore[no-untyped-def]
    """Return ξ of one contact."""
    row, six = uint64(3) * uint64(c), uint64(6)
    i, j = six * uint64(chunks[uint64(2) * uint64(c)]), six * uint64(chunks[uint64(2) * uint64(c) + uint64(1)])
    normal = normals[c, 0], normals[c, 1], normals[c, 2]
    first, second = tangents(normal[0], normal[1], normal[2])
    dx = moved[i] - moved[j]
    dy = moved[i + uint64(1)] - moved[j + uint64(1)]
    dz = moved[i + uint64(2)] - moved[j + uint64(2)]
    sx = share * (moved[i + uint64(3)] + moved[j + uint64(3)])
    sy = share * (moved[i + uint64(4)] + moved[j + uint64(4)])
    sz = share * (moved[i + uint64(5)] + moved[j + uint64(5)])
    own = free[row], free[row + uint64(1)], free[row + uint64(2)]
    return in_frame(normal, first, second, (dx, dy, dz), (sx, sy, sz), own)


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_balls(  # type: ignore[no-untyped-def]
    count, bodies, records, share, held, moved, change, before, momentum, delay, sweeps, present
):
    """Do ``count`` sweeps on Λ (``held``), v and τ (``moved``); other arguments as in ``pieces.sweep_batches``."""
    two, three, six, lanes = uint64(2), uint64(3), uint64(6), uint64(LANES)
    n_batches = uint64(len(bodies)) // (two * lanes)
    own, others, turn = np.empty(six * lanes), np.empty(six * lanes), np.empty(lanes)
    for _ in range(count):
        if momentum > 0.0:
            for k in range(uint64(len(moved))):
                v = moved[k]
                moved[k] = v + present * (v - before[k])
                before[k] = v
        turn[:] = 0.0
        for batch in range(n_batches):
            pair = two * lanes * batch
            gather_balls(bodies, pair, moved, own, others)
            record, at = uint64(NUMBERS) * lanes * batch, three * lanes * batch
            update_balls(records, record, share, held, change, at, present, turn, own, others)
            for lane in range(lanes):
                a, b = uint64(bodies[pair + lane]), uint64(bodies[pair + lanes + lane])
                for k in range(six):
                    moved[a + k] = own[lanes * k + lane]
                    moved[b + k] = others[lanes * k + lane]
        sweeps += 1
        present = 0.0 if turn.sum() > 0.0 else momentum_after(sweeps, momentum, delay)
    return present


@njit(cache=True, inline="always")
def gather_balls(bodies, pair, moved, own, others):  # type: ignore[no-untyped-def]
    """Copy v and τ of the first and second balls of a batch, whose numbers begin at ``pair`` of ``bodies``."""
    six, lanes = uint64(6), uint64(LANES)
    for k in range(six):
        for lane in range(lanes):
            own[lanes * k + lane] = moved[uint64(bodies[pair + lane]) + k]
    for k in range(six):
        for lane in range(lanes):
            others[lanes * k + lane] = moved[uint64(bodies[pair + lanes + lane]) + k]


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_balls(records, record, share, held, change, at, present, turn, own, others):  # type: ignore[no-untyped-def]
    """Update a batch with records from ``record`` on: its Λ from ``at`` on, and v and τ of its first and second balls.

    Add (Λ̂ − Λ⁺)·(Λ⁺ − Λ) to ``turn``, where Λ becomes Λ⁺ and Λ̂ = Λ + β ``change``.
    """
    lanes = uint64(LANES)
    k1, k2, k3, k4, k5 = lanes, uint64(2) * lanes, uint64(3) * lanes, uint64(4) * lanes, uint64(5) * lanes
    k6, k7, k8, k9, k10 = uint64(6) * lanes, uint64(7) * lanes, uint64(8) * lanes, uint64(9) * lanes, uint64(10) * lanes
    for lane in range(lanes):
        r, n = record + lane, at + lane
        t, s = n + k1, n + k2
        x, y, z = records[r], records[r + k1], records[r + k2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
        dx, dy, dz = own[lane] - others[lane], own[lane + k1] - others[lane + k1], own[lane + k2] - others[lane + k2]
        sx = share * (own[lane + k3] + others[lane + k3])
        sy = share * (own[lane + k4] + others[lane + k4])
        sz = share * (own[lane + k5] + others[lane + k5])
        free = records[r + k3], records[r + k4], records[r + k5]
        first_tangent, second_tangent = (t1x, t1y, t1z), (t2x, t2y, t2z)
        normal, first, second = in_frame((x, y, z), first_tangent, second_tangent, (dx, dy, dz), (sx, sy, sz), free)
        ahead_n, ahead_t, ahead_s = present * change[n], present * change[t], present * change[s]
        old_n, old_t, old_s = held[n] + ahead_n, held[t] + ahead_t, held[s] + ahead_s
        size_t = records[r + k7]
        new_n = max(old_n - records[r + k6] * normal, 0.0)
        new_t, new_s = old_t - size_t * first, old_s - size_t * second
        bound = records[r + k8] * new_n
        squared = new_t * new_t + new_s * new_s
        scale = bound / np.sqrt(squared) if squared > bound * bound else 1.0
        new_t *= scale
        new_s *= scale
        step_n, step_t, step_s = new_n - held[n], new_t - held[t], new_s - held[s]
        turn[lane] += (ahead_n - step_n) * step_n + (ahead_t - step_t) * step_t + (ahead_s - step_s) * step_s
        change[n], change[t], change[s] = step_n, step_t, step_s
        held[n], held[t], held[s] = new_n, new_t, new_s
        dn, dt, ds = new_n - old_n, new_t - old_t, new_s - old_s
        px, py, pz = dn * x + dt * t1x + ds * t2x, dn * y + dt * t1y + ds * t2y, dn * z + dt * t1z + ds * t2z
        qx, qy, qz = dt * t2x - ds * t1x, dt * t2y - ds * t1y, dt * t2z - ds * t1z  # n × P
        first_mass, second_mass = records[r + k9], records[r + k10]  # inverse masses
        own[lane] += first_mass * px
        own[lane + k1] += first_mass * py
        own[lane + k2] += first_mass * pz
        own[lane + k3] -= first_mass * qx
        own[lane + k4] -= first_mass * qy
        own[lane + k5] -= first_mass * qz
        others[lane] -= second_mass * px
        others[lane + k1] -= second_mass * py
        others[lane + k2] -= second_mass * pz
        others[lane + k3] -= second_mass * qx
        others[lane + k4] -= second_mass * qy
        others[lane + k5] -= second_mass * qz
