"""Sweeps over contacts of balls in batches, from one record with a normal for each contact.

The iterates are those of the sweeps in the module ``pieces``. In place of two pieces of W̃, a contact has its normal and
the inverse masses of its balls, and in place of Λ, sweeps change the vector P; ``ball_kernels`` has the equations.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.answer import ratio
from ....problems.contact.blocks import BlockLayout
from ....problems.contact.matrices.contact_frame import tangents
from ....problems.contact.matrices.pieces import BallRecords, Pieces
from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ...iteration.loop import Window, WindowedIterates
from ...iteration.momentum import MomentumState
from .ball_kernels import (
    ENTRIES_PER_RECORD,
    WEIGHTS,
    from_frame,
    in_frame,
    largest_violation,
    sweep_balls,
    sweep_window,
    write_impulses,
    write_rows,
)
from .lanes import BALL_LENGTH, LANES, VECTOR, aligned_copy, zeros_for_balls
from .pieces import MIN_FILL, assign_batches

EQUALITY_TOLERANCE = 1e-12
"""Relative difference up to which the κ of two balls, or two entries of M⁻¹, count as equal."""


LENGTH_TOLERANCE = 1e-14
"""Largest difference of the squared length of a normal from 1 for which normal and tangents are orthogonal to rounding.
Sweeps that split vectors along n would otherwise have other residuals than W."""


class Balls(NamedTuple):
    """The balls of a problem, from which the records of its contacts are created.

    Attributes:
        directions: W.
        contacts: the records of all contacts, in their order.
        inverse_masses: 1/m of each ball, and 0 for surfaces [1/kg], shape (n_balls + 1,).
        spin_ratio: κ = r²m/J.
    """

    directions: Pieces
    contacts: BallRecords
    inverse_masses: FloatArray
    spin_ratio: float

    def pack(
        self, problem: ContactProblem, step_sizes: FloatArray, positions: IntArray, n_batches: int
    ) -> tuple[Any, ...]:
        """Return bodies, records and slots of ``BallSweep`` for contacts at ``positions`` (batch · LANES + lane)."""
        arrays = self.contacts.chunks, self.contacts.normals, problem.free_velocity, step_sizes
        packed: tuple[Any, ...] = _pack(
            *arrays, problem.layout.friction_coefficient, self.inverse_masses, positions, n_batches
        )
        return packed

    def renumbered(self, order: IntArray, bodies: IntArray) -> "Balls":
        """Return these balls in another order.

        Args:
            order: current number of each ball in the new order.
            bodies: new numbers of both balls of each contact, shape (2 · n_contacts,).
        """
        contacts = BallRecords(bodies, self.contacts.normals, self.contacts.radii[order])
        return self._replace(contacts=contacts, inverse_masses=np.append(self.inverse_masses[order], 0.0))

    def motion(self, impulses: FloatArray) -> FloatArray:
        """Return v and τ of all balls, and zeros for surfaces, with ``BALL_LENGTH`` entries each, flat.

        The impulses Λ are in the order of rows.
        """
        motion = zeros_for_balls(len(self.inverse_masses))
        if impulses.any():
            _write_motion(self.contacts.chunks, self.contacts.normals, self.inverse_masses, impulses, motion)
        return motion


def balls_of(problem: ContactProblem) -> Balls | None:
    """Return the balls of a problem, or None.

    The result is None unless the problem has factors, its contacts are spatial contacts of balls with Coulomb friction
    and normals of unit length, and the balls share κ.
    """
    factors, layout = problem.factors, problem.layout
    if factors is None or not isinstance(factors.directions, Pieces):
        return None
    pieces = factors.directions
    contacts = pieces.balls
    if contacts is None or not (layout.width == 3 and layout.has_contacts_only):
        return None
    if not layout.is_dense or not layout.bounds_are_own or layout.has_fixed_bounds:
        return None
    if not factors.inverse_mass.is_diagonal or not _are_unit(contacts.normals):
        return None
    inverse_masses = np.zeros(pieces.n_chunks + 1)
    spin_ratio = float(
        _find_inverse_masses_and_spin_ratio(factors.inverse_mass.matrix.data, contacts.radii, inverse_masses)
    )
    if spin_ratio <= 0.0:
        return None
    return Balls(pieces, contacts, inverse_masses, spin_ratio)


@dataclass(frozen=True, eq=False)
class BallSweep:
    """The constant data of a sweep.

    Attributes:
        layout: the padded blocks.
        balls: the balls.
        free_velocity: c, shape (n_rows,).
        bodies: first coordinate of both balls of each lane, shape (n_batches · 2 · LANES,).
        records: data of all contacts, in batches, shape (n_batches · ENTRIES_PER_RECORD · LANES,).
        slots: position of each component of the vectors P of all contacts in the order of batches, shape (n_rows,).
    """

    layout: BlockLayout
    balls: Balls
    free_velocity: FloatArray
    bodies: np.ndarray[tuple[int, ...], np.dtype[np.uint32]]
    records: FloatArray
    slots: IntArray

    @staticmethod
    def over(problem: ContactProblem, step_sizes: FloatArray) -> "BallSweep | None":
        """Return the sweep with step sizes as in ``step_size``.

        Return None if batches would have few contacts, or the contacts are not those of balls that share κ.
        """
        balls = balls_of(problem)
        if balls is None:
            return None
        batches = assign_batches(balls.directions)
        if len(batches.positions) < MIN_FILL * LANES * batches.n_batches:
            return None
        bodies, records, slots = balls.pack(problem, step_sizes, *batches)
        return BallSweep(problem.layout, balls, problem.free_velocity, bodies, records, slots)

    def weights(self, residual: Residual) -> FloatArray:
        """Return α of the laws, and the squares of ``Residual.ratios``, in batches; 0 in empty lanes.

        Their shape is (n_batches · WEIGHTS · LANES,).
        """
        weights = np.zeros(WEIGHTS * len(self.bodies) // 2)
        write_weights(residual.alpha, residual.ratios, self.slots, weights)
        return weights

    def begin(self, start: FloatArray, momentum: float = 0.0, delay: float = 0.0) -> "BallIterates":
        """Return the iterates that begin at ``start``, shape (n_rows,); see ``MomentumState``."""
        return BallIterates(self, start, momentum, delay)


class BallIterates(MomentumState, WindowedIterates):
    """P, in the order of batches, and v and τ of all balls, of a Gauss–Seidel iteration."""

    def __init__(self, sweep: BallSweep, start: FloatArray, momentum: float, delay: float = 0.0) -> None:
        MomentumState.__init__(self, momentum, delay)
        self._sweep, self._start = sweep, start.copy()
        self._impulses = np.zeros(3 * len(sweep.bodies) // 2)
        if start.any():
            write_impulses(sweep.balls.contacts.normals, sweep.slots, start, self._impulses)
        self._motion = sweep.balls.motion(start)
        self._change = np.zeros(len(self._impulses))
        self._previous_motion = aligned_copy(self._motion) if momentum > 0.0 else self._motion
        self._relative_velocity = np.empty(len(start))
        self._residual: Residual | None = None
        self._weights = np.empty(0)
        self._measured_after, self._last_residual = -1, np.inf  # sweeps before the last measurement, and its result

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        sweep = self._sweep
        arrays = (self._impulses, self._motion, self._change, self._previous_motion)
        momentum = self._momentum, self._delay, self._sweeps, self._beta
        self._beta = sweep_balls(count, sweep.bodies, sweep.records, sweep.balls.spin_ratio, *arrays, *momentum)
        self._sweeps += count

    def has_windows(self, residual: Residual) -> bool:
        """Return whether ``run_window`` applies to a residual."""
        return can_compare_squares(residual)

    def run_window(self, counts: Sequence[int], residual: Residual, limits: tuple[float, float]) -> Window:
        """Sweep and measure repeatedly; see ``WindowedIterates``."""
        self._use_residual(residual)
        sweep, residuals, best = self._sweep, np.empty(len(counts)), self._impulses.copy()
        state = (self._impulses, self._motion, self._change, self._previous_motion)
        momentum = self._momentum, self._delay, self._sweeps, self._beta
        contacts = sweep.bodies, sweep.records, sweep.balls.spin_ratio
        scales = np.array(counts), float(limits[0]), float(limits[1]), residual.scale
        n_checks, self._beta = sweep_window(*scales, contacts, state, *momentum, self._weights, best, residuals)
        self.count_window(counts[:n_checks], residuals[: n_checks - 1])
        last = float(residuals[n_checks - 1])
        self._measured_after, self._last_residual = self._sweeps, np.inf if np.isnan(last) else last
        return Window(residuals[:n_checks], partial(self._over_rows, best))

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._over_rows(self._impulses) if self._sweeps else self._start.copy()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        sweep, contacts = self._sweep, self._sweep.balls.contacts
        spin_ratio = sweep.balls.spin_ratio
        _write_relative_velocity(
            contacts.chunks, contacts.normals, spin_ratio, sweep.free_velocity, self._motion, self._relative_velocity
        )
        return self._relative_velocity

    def impulses_and_residual(self, residual: Residual) -> tuple[FloatArray, float]:
        """Return Λ over rows and its residual."""
        if not can_compare_squares(residual):
            impulses = self.impulses()
            return impulses, residual(impulses, self.relative_velocity())
        if self._measured_after != self._sweeps or residual is not self._residual:
            self._use_residual(residual)
            sweep = self._sweep
            arrays = sweep.bodies, sweep.records, sweep.balls.spin_ratio, self._impulses, self._motion, self._weights
            self._measured_after, self._last_residual = self._sweeps, ratio(largest_violation(*arrays), residual.scale)
        return self.impulses(), self._last_residual

    def _over_rows(self, impulses: FloatArray) -> FloatArray:
        """Return Λ over rows from P in the order of batches."""
        sweep, rows = self._sweep, np.empty(len(self._sweep.slots))
        contacts = sweep.balls.contacts.normals, sweep.layout.friction_coefficient
        write_rows(*contacts, sweep.slots, impulses, 0, len(rows) // 3, rows)
        return rows

    def _use_residual(self, residual: Residual) -> None:
        if residual is not self._residual:
            self._residual, self._weights = residual, self._sweep.weights(residual)


def can_compare_squares(residual: Residual) -> bool:
    """Whether the residual is that of Coulomb's law, and squares of its velocities are in range."""
    return type(residual) is Residual and residual.unit == 1.0 and not residual.infeasible


@njit(cache=True)
def _are_unit(normals):  # type: ignore[no-untyped-def]
    """Return whether the squared length of each normal is 1 up to ``LENGTH_TOLERANCE``; False if one is NaN."""
    farthest = 0.0
    for c in range(len(normals)):
        squared = normals[c, 0] * normals[c, 0] + normals[c, 1] * normals[c, 1] + normals[c, 2] * normals[c, 2]
        difference = abs(squared - 1.0)
        farthest = difference if difference > farthest or difference != difference else farthest
    return farthest <= LENGTH_TOLERANCE


@njit(cache=True)
def _find_inverse_masses_and_spin_ratio(inverse, radii, inverse_masses):  # type: ignore[no-untyped-def]
    """Write 1/m of each ball, and return κ = r²m/J, or 0 if balls differ in κ or have several moments of inertia."""
    spin_ratio = 0.0
    for ball in range(len(radii)):
        linear, angular = inverse[6 * ball], inverse[6 * ball + 3]
        for axis in range(1, 3):
            if abs(inverse[6 * ball + axis] - linear) > EQUALITY_TOLERANCE * linear:
                return 0.0
            if abs(inverse[6 * ball + 3 + axis] - angular) > EQUALITY_TOLERANCE * angular:
                return 0.0
        inverse_masses[ball] = linear
        ball_ratio = radii[ball] * radii[ball] * angular / linear
        if ball == 0:
            spin_ratio = ball_ratio
        if abs(ball_ratio - spin_ratio) > EQUALITY_TOLERANCE * spin_ratio:
            return 0.0
    return spin_ratio


@njit(cache=True, fastmath={"contract"})
def _pack(balls, normals, free_velocity, step_sizes, friction, inverse_masses, positions, n_batches):  # type: ignore[no-untyped-def]
    """Return the first coordinate of both balls of each lane, the records, and slots as in ``slots_in_batches``.

    Unsigned indices need no test for negative ones.
    """
    slots = np.empty(3 * len(positions), dtype=np.int64)
    bodies = np.full(n_batches * 2 * LANES, BALL_LENGTH * (len(inverse_masses) - 1), dtype=np.uint32)
    records = np.zeros(n_batches * ENTRIES_PER_RECORD * LANES)
    lanes, one, two, three, length = uint64(LANES), uint64(1), uint64(2), uint64(3), uint64(BALL_LENGTH)
    for c in range(uint64(len(positions))):
        position, i, j = uint64(positions[c]), uint64(balls[two * c]), uint64(balls[two * c + one])
        batch = position // lanes
        lane = position - lanes * batch
        first_entry = uint64(ENTRIES_PER_RECORD) * lanes * batch + lane
        bodies[two * lanes * batch + lane] = length * i
        bodies[(two * batch + one) * lanes + lane] = length * j
        normal, row = (normals[c, 0], normals[c, 1], normals[c, 2]), three * c
        vector = from_frame(normal, (free_velocity[row], free_velocity[row + one], free_velocity[row + two]))
        for k in range(three):
            records[first_entry + lanes * k] = normals[c, k]
            records[first_entry + lanes * (three + k)] = vector[k]
            slots[row + k] = lanes * (three * batch + k) + lane
        records[first_entry + uint64(6) * lanes] = step_sizes[c, uint64(0)]
        records[first_entry + uint64(7) * lanes] = step_sizes[c, one]
        records[first_entry + uint64(8) * lanes] = friction[c]
        records[first_entry + uint64(9) * lanes] = inverse_masses[i]
        records[first_entry + uint64(10) * lanes] = inverse_masses[j]
    return bodies, records, slots


@njit(cache=True, nogil=True)
def write_weights(alpha, ratios, slots, weights):  # type: ignore[no-untyped-def]
    """Write α of both laws of each contact, and the squares of their ratios."""
    lanes, one, two, three = uint64(LANES), uint64(1), uint64(2), uint64(3)
    for c in range(uint64(len(slots)) // three):
        slot, normal = uint64(slots[three * c]), two * c
        friction, entry = normal + one, uint64(WEIGHTS) * lanes * (slot // (three * lanes)) + slot % lanes
        weights[entry], weights[entry + lanes] = alpha[normal], alpha[friction]
        weights[entry + two * lanes] = ratios[normal] * ratios[normal]
        weights[entry + three * lanes] = ratios[friction] * ratios[friction]


@njit(cache=True, fastmath={"contract"})
def _write_motion(balls, normals, inverse_masses, impulses, motion):  # type: ignore[no-untyped-def]
    """Write v and τ of given impulses."""
    one, two, three, length, tau = uint64(1), uint64(2), uint64(3), uint64(BALL_LENGTH), uint64(VECTOR)
    for c in range(uint64(len(normals))):
        x, y, z = normals[c, 0], normals[c, 1], normals[c, 2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
        normal, first, second = impulses[three * c], impulses[three * c + one], impulses[three * c + two]
        push = (
            normal * x + first * t1x + second * t2x,
            normal * y + first * t1y + second * t2y,
            normal * z + first * t1z + second * t2z,
        )
        turn = (first * t2x - second * t1x, first * t2y - second * t1y, first * t2z - second * t1z)
        i, j = uint64(balls[two * c]), uint64(balls[two * c + one])  # unsigned indices need no test for negative ones
        inverse, v = inverse_masses[i], length * i
        for axis in range(three):
            motion[v + axis] += inverse * push[axis]
            motion[v + tau + axis] -= inverse * turn[axis]
        inverse, v = inverse_masses[j], length * j
        for axis in range(three):
            motion[v + axis] -= inverse * push[axis]
            motion[v + tau + axis] -= inverse * turn[axis]


@njit(cache=True, fastmath={"contract"})
def _write_relative_velocity(balls, normals, spin_ratio, free_velocity, motion, relative_velocity):  # type: ignore[no-untyped-def]
    """Write ξ = GΛ + c."""
    for c in range(len(normals)):
        xi = _contact_velocity(c, balls, normals, spin_ratio, free_velocity, motion)
        relative_velocity[3 * c], relative_velocity[3 * c + 1], relative_velocity[3 * c + 2] = xi


@njit(cache=True, fastmath={"contract"}, inline="always")
def _contact_velocity(c, balls, normals, spin_ratio, free_velocity, motion):  # type: ignore[no-untyped-def]
    """Return ξ of one contact."""
    row, length, tau = uint64(3) * uint64(c), uint64(BALL_LENGTH), uint64(VECTOR)
    i, j = length * uint64(balls[uint64(2) * uint64(c)]), length * uint64(balls[uint64(2) * uint64(c) + uint64(1)])
    normal = normals[c, 0], normals[c, 1], normals[c, 2]
    dx = motion[i] - motion[j]
    dy = motion[i + uint64(1)] - motion[j + uint64(1)]
    dz = motion[i + uint64(2)] - motion[j + uint64(2)]
    i, j = i + tau, j + tau
    sx = spin_ratio * (motion[i] + motion[j])
    sy = spin_ratio * (motion[i + uint64(1)] + motion[j + uint64(1)])
    sz = spin_ratio * (motion[i + uint64(2)] + motion[j + uint64(2)])
    x, y, z = normal
    along_normal, first, second = in_frame(
        normal, (dx + (y * sz - z * sy), dy + (z * sx - x * sz), dz + (x * sy - y * sx))
    )
    one, two = uint64(1), uint64(2)
    return free_velocity[row] + along_normal, free_velocity[row + one] + first, free_velocity[row + two] + second
