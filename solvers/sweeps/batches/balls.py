"""Sweeps over contacts of balls in batches, from one record with a normal for each contact.

The iterates are those of ``pieces``. In place of two pieces of W̃, a contact has its normal and the inverse masses of
its balls; ``ball_kernels`` has the equations.
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
from ....problems.contact.residual import Residual
from ...iteration.loop import SinglePassIterates
from ...iteration.momentum import MomentumState
from .ball_kernels import NUMBERS, WEIGHTS, in_frame, largest_violation, sweep_balls
from .pieces import LANES, MIN_FILL, assign_batches

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

    def pack(
        self, problem: ContactProblem, step_sizes: FloatArray, places: IntArray, n_batches: int
    ) -> tuple[Any, ...]:
        """Return bodies, records and slots of ``BallSweep`` for contacts at ``places`` (batch · LANES + lane)."""
        arrays = self.contacts.chunks, self.contacts.normals, problem.free_velocity, step_sizes
        packed: tuple[Any, ...] = _pack(
            *arrays, problem.layout.friction_coefficient, self.inverse_masses, places, n_batches
        )
        return packed

    def renumbered(self, bodies: IntArray, chunks: IntArray) -> "Balls":
        """Return these balls in the order of ``bodies``; ``chunks`` has the new numbers of both balls of a contact."""
        contacts = BallRecords(chunks, self.contacts.normals, self.contacts.radii[bodies])
        return self._replace(contacts=contacts, inverse_masses=np.append(self.inverse_masses[bodies], 0.0))

    def motion(self, impulses: FloatArray) -> FloatArray:
        """Return v and τ of all balls, and zeros for surfaces, from Λ over rows; flat from shape (n_balls + 1, 6)."""
        motion = np.zeros(6 * len(self.inverse_masses))
        if impulses.any():
            _write_motion(self.contacts.chunks, self.contacts.normals, self.inverse_masses, impulses, motion)
        return motion


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
        free_velocity: c, flat.
        bodies: first coordinate of both balls of each lane, shape (n_batches · 2 · LANES,).
        records: numbers of all contacts in batches, shape (n_batches · NUMBERS · LANES,).
        slots: position of each entry of Λ in the order of batches.
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
        if len(batches.places) < MIN_FILL * LANES * batches.n_batches:
            return None
        bodies, records, slots = balls.pack(problem, step_sizes, *batches)
        return BallSweep(problem.layout, balls, problem.free_velocity, bodies, records, slots)

    def weights(self, residual: Residual) -> FloatArray:
        """Return α and squared ratios of the laws in batches, 0 in empty lanes.

        Their shape is (n_batches · WEIGHTS · LANES,).
        """
        weights = np.zeros(WEIGHTS * len(self.bodies) // 2)
        write_weights(residual.alpha, residual.ratios, self.slots, weights)
        return weights

    def begin(self, start: FloatArray, momentum: float = 0.0, delay: float = 0.0) -> "BallIterates":
        """Return the iterates that begin at ``start``, shape (n_rows,); see ``MomentumState``."""
        return BallIterates(self, start, momentum, delay)


class BallIterates(MomentumState, SinglePassIterates):
    """Λ, in the order of batches, and v and τ of all balls, of a Gauss–Seidel iteration."""

    def __init__(self, sweep: BallSweep, start: FloatArray, momentum: float, delay: float = 0.0) -> None:
        MomentumState.__init__(self, momentum, delay)
        self._sweep = sweep
        self._impulses = np.zeros(3 * len(sweep.bodies) // 2)
        self._impulses[sweep.slots] = start
        self._motion = sweep.balls.motion(start)
        self._change = np.zeros_like(self._impulses)
        self._before = self._motion.copy() if momentum > 0.0 else self._motion
        self._relative = np.empty(len(start))
        self._residual: Residual | None = None
        self._weights = np.empty(0)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        data = self._sweep
        arrays = (self._impulses, self._motion, self._change, self._before)
        momentum = self._momentum, self._delay, self._sweeps, self._beta
        self._beta = sweep_balls(count, data.bodies, data.records, data.balls.spin_share, *arrays, *momentum)
        self._sweeps += count

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._impulses[self._sweep.slots]

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        data, contacts = self._sweep, self._sweep.balls.contacts
        share = data.balls.spin_share
        _write_relative(contacts.chunks, contacts.normals, share, data.free_velocity, self._motion, self._relative)
        return self._relative

    def impulses_and_residual(self, residual: Residual) -> tuple[FloatArray, float]:
        """Return Λ over rows and its residual."""
        if not measures_squares(residual):
            impulses = self.impulses()
            return impulses, residual(impulses, self.relative_velocity())
        data, impulses = self._sweep, np.empty(len(self._sweep.slots))
        if residual is not self._residual:
            self._residual, self._weights = residual, data.weights(residual)
        arrays = data.bodies, data.records, data.balls.spin_share, self._impulses, self._motion
        violation = largest_violation(*arrays, self._weights, data.slots, impulses)
        return impulses, ratio(violation, residual.scale)


def measures_squares(residual: Residual) -> bool:
    """Whether the residual is that of Coulomb's law, and squares of its velocities are in range."""
    return type(residual) is Residual and residual.unit == 1.0 and not residual.infeasible


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
        ball_share = radii[ball] * radii[ball] * angular / linear
        if ball == 0:
            share = ball_share
        if abs(ball_share - share) > EQUALITY_TOLERANCE * share:
            return 0.0
    return share


@njit(cache=True)
def _pack(chunks, normals, free_velocity, step_sizes, friction, inverse_masses, places, n_batches):  # type: ignore[no-untyped-def]
    """Return the first coordinate of both balls of each lane, the records, and slots as in ``slots_in_batches``."""
    slots = np.empty(3 * len(places), dtype=np.int64)
    idle = len(inverse_masses) - 1
    bodies = np.full(n_batches * 2 * LANES, 6 * idle, dtype=np.uint32)
    records = np.zeros(n_batches * NUMBERS * LANES)
    for c in range(len(places)):
        batch, lane = places[c] // LANES, places[c] % LANES
        i, j, first_entry = chunks[2 * c], chunks[2 * c + 1], NUMBERS * LANES * batch + lane
        bodies[2 * LANES * batch + lane], bodies[(2 * batch + 1) * LANES + lane] = 6 * i, 6 * j
        for k in range(3):
            records[first_entry + LANES * k] = normals[c, k]
            records[first_entry + LANES * (3 + k)] = free_velocity[3 * c + k]
            slots[3 * c + k] = LANES * (3 * batch + k) + lane
        records[first_entry + LANES * 6], records[first_entry + LANES * 7] = step_sizes[c, 0], step_sizes[c, 1]
        records[first_entry + LANES * 8] = friction[c]
        records[first_entry + LANES * 9], records[first_entry + LANES * 10] = inverse_masses[i], inverse_masses[j]
    return bodies, records, slots


@njit(cache=True)
def write_weights(alpha, ratios, slots, weights):  # type: ignore[no-untyped-def]
    """Write α of both laws of each contact, and the squares of their ratios."""
    for c in range(len(slots) // 3):
        batch, lane = slots[3 * c] // (3 * LANES), slots[3 * c] % LANES
        first_entry = WEIGHTS * LANES * batch + lane
        for law in range(2):
            ratio_of_law = ratios[2 * c + law]
            weights[first_entry + LANES * law], weights[first_entry + LANES * (2 + law)] = (
                alpha[2 * c + law],
                ratio_of_law * ratio_of_law,
            )


@njit(cache=True, fastmath={"contract"})
def _write_motion(chunks, normals, inverse_masses, impulses, motion):  # type: ignore[no-untyped-def]
    """Write v and τ of given impulses."""
    for c in range(len(normals)):
        x, y, z = normals[c, 0], normals[c, 1], normals[c, 2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
        normal, first, second = impulses[3 * c], impulses[3 * c + 1], impulses[3 * c + 2]
        push = (
            normal * x + first * t1x + second * t2x,
            normal * y + first * t1y + second * t2y,
            normal * z + first * t1z + second * t2z,
        )
        turn = (first * t2x - second * t1x, first * t2y - second * t1y, first * t2z - second * t1z)
        for side in range(2):
            ball, sign = chunks[2 * c + side], 1.0 - 2.0 * side
            for axis in range(3):
                motion[6 * ball + axis] += sign * inverse_masses[ball] * push[axis]
                motion[6 * ball + 3 + axis] -= inverse_masses[ball] * turn[axis]


@njit(cache=True, fastmath={"contract"})
def _write_relative(chunks, normals, share, free_velocity, motion, relative):  # type: ignore[no-untyped-def]
    """Write ξ = GΛ + c."""
    for c in range(len(normals)):
        xi = _relative(c, chunks, normals, share, free_velocity, motion)
        relative[3 * c], relative[3 * c + 1], relative[3 * c + 2] = xi


@njit(cache=True, fastmath={"contract"}, inline="always")
def _relative(c, chunks, normals, share, free_velocity, motion):  # type: ignore[no-untyped-def]
    """Return ξ of one contact."""
    row, six = uint64(3) * uint64(c), uint64(6)
    i, j = six * uint64(chunks[uint64(2) * uint64(c)]), six * uint64(chunks[uint64(2) * uint64(c) + uint64(1)])
    normal = normals[c, 0], normals[c, 1], normals[c, 2]
    first, second = tangents(normal[0], normal[1], normal[2])
    dx = motion[i] - motion[j]
    dy = motion[i + uint64(1)] - motion[j + uint64(1)]
    dz = motion[i + uint64(2)] - motion[j + uint64(2)]
    sx = share * (motion[i + uint64(3)] + motion[j + uint64(3)])
    sy = share * (motion[i + uint64(4)] + motion[j + uint64(4)])
    sz = share * (motion[i + uint64(5)] + motion[j + uint64(5)])
    contact_free_velocity = free_velocity[row], free_velocity[row + uint64(1)], free_velocity[row + uint64(2)]
    return in_frame((normal, first, second), (dx, dy, dz), (sx, sy, sz), contact_free_velocity)
