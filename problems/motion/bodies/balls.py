"""Systems of rigid balls (spatial) or discs (planar) among fixed surfaces.

Friction alone can turn a ball, so without it a ball has no rotational degrees of freedom and a contact one row:

    spatial    u = (v, ω) ∈ R⁶, rows N, T1, T2        without friction u = v ∈ R³, row N
    planar     u = (v, ω) ∈ R³, rows N, T             without friction u = v ∈ R², row N

Contacts are found by a cell list and written straight into W in pieces, two balls a contact or one; no dense matrix
appears anywhere.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray
from ...contact.laws import Laws
from ...contact.matrices.factors import InverseMass
from ...contact.matrices.pieces import Pieces
from ...errors import ProblemError
from ..detection.broad_phase import NearPairs
from ..detection.contact_keys import ContactKeys
from .contact_frame import write_frame
from .rigid.materials import MaterialPairs
from .surfaces import Surface
from .system import ActiveContacts, Overlaps, StepAssembly

SPHERE_INERTIA = 0.4
"""J/(m r²) of a homogeneous ball."""

DISC_INERTIA = 0.5
"""J/(m r²) of a homogeneous disc."""

Acceleration = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""(centres, velocities, masses) ↦ acceleration of the centres [m/s²]; shapes (n, d), (n, d), (n,) and (n, d)."""

PairCoefficient = Callable[[IntArray], FloatArray]
"""Keys of pairs of bodies ↦ a coefficient of their contacts, μ or ε_N, both of shape (n_contacts,)."""

Potential = Callable[[FloatArray, FloatArray], float]
"""(centres, masses) ↦ potential energy [J]; shapes (n, d) and (n,)."""


def known_potential(potentials: Sequence[Potential | None], n_forces: int) -> Potential | None:
    """Return the sum of the potentials of ``n_forces`` forces; None if one of them is not known."""
    known = [potential for potential in potentials if potential is not None]
    if len(known) != n_forces:
        return None
    return lambda centres, masses: sum(potential(centres, masses) for potential in known)


@dataclass(frozen=True, eq=False)
class BallSystem:
    """Balls, surfaces, and the effects on them; ``scenes.effects`` builds one from a list of effects.

    Attributes:
        radii: r [m], shape (n,).
        masses: m [kg], shape (n,).
        surfaces: fixed surfaces.
        dimension: 2 (planar) or 3 (spatial).
        accelerations: accelerations of the centres by forces other than contact forces.
        potentials: potential energy of each of ``accelerations``, None where it is not known.
        friction: μ of all contacts, or keys of pairs of bodies ↦ μ of each; None for balls without friction and without
            rotation.
        restitution_normal: ε_N of all contacts, or keys of pairs ↦ ε_N of each.
        restitution_tangential: ε_T of all contacts.
        inertia_factor: J/(m r²).

    Raises:
        ProblemError: if a radius or a mass is not positive, a coefficient is out of range, or materials are not one a
            body.
    """

    radii: FloatArray
    masses: FloatArray
    surfaces: Sequence[Surface]
    dimension: int
    accelerations: Sequence[Acceleration] = ()
    potentials: Sequence[Potential | None] = ()
    friction: float | PairCoefficient | None = None
    restitution_normal: float | PairCoefficient = 0.0
    restitution_tangential: float = 0.0
    inertia_factor: float = SPHERE_INERTIA

    def __post_init__(self) -> None:
        for name in ("radii", "masses"):
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if values.ndim != 1 or not (values > 0).all():
                raise ProblemError(f"{name} must be positive numbers, one a ball.")
            object.__setattr__(self, name, values)
        if self.dimension not in (2, 3):
            raise ProblemError(f"dimension must be 2 or 3, got {self.dimension}.")
        if not (self.friction is None or callable(self.friction) or 0.0 <= self.friction < np.inf):
            raise ProblemError(f"friction must be finite and not negative, got {self.friction}.")
        for name in ("friction", "restitution_normal"):
            value = getattr(self, name)
            if isinstance(value, MaterialPairs):
                value.check_count(name, len(self.radii) + len(self.surfaces))
        for name in ("restitution_normal", "restitution_tangential"):
            value = getattr(self, name)
            if not (callable(value) and name == "restitution_normal") and not 0.0 <= value <= 1.0:
                raise ProblemError(f"{name} must be between 0 and 1, got {value}.")

    @property
    def n_balls(self) -> int:
        """Number of balls."""
        return len(self.radii)

    @property
    def rows_per_contact(self) -> int:
        """Rows of one contact, 1 without friction, else the dimension."""
        return 1 if self.friction is None else self.dimension

    @property
    def spins(self) -> int:
        """Rotational degrees of freedom of one ball, 0 without friction, else 1 (planar) or 3 (spatial)."""
        if self.friction is None:
            return 0
        return 1 if self.dimension == 2 else 3

    @property
    def dofs_per_ball(self) -> int:
        """Degrees of freedom of one ball."""
        return self.dimension + self.spins

    @cached_property
    def _near_pairs(self) -> NearPairs:
        return NearPairs(self.radii)

    @cached_property
    def _keys(self) -> ContactKeys:
        return ContactKeys(self.n_balls + len(self.surfaces))

    @cached_property
    def inverse_mass(self) -> InverseMass:
        """M⁻¹, diagonal."""
        inertia = self.inertia_factor * self.masses * self.radii**2
        diagonal = np.column_stack([*[1.0 / self.masses] * self.dimension, *[1.0 / inertia] * self.spins]).ravel()
        return InverseMass.create(diagonal)

    def centres(self, position: FloatArray) -> FloatArray:
        """Return the centres [m], shape (n, d), of a position vector q, shape (n · d,)."""
        return position.reshape(self.n_balls, self.dimension)

    def twists(self, velocity: FloatArray) -> FloatArray:
        """Return (v, ω) of each ball, shape (n, dofs_per_ball), of a velocity vector u."""
        return velocity.reshape(self.n_balls, self.dofs_per_ball)

    def at_rest(self, velocities: FloatArray) -> FloatArray:
        """Return u for centres moving with ``velocities``, shape (n, d), and no spin."""
        return np.column_stack([velocities, np.zeros((self.n_balls, self.spins))]).ravel()

    def translation(self, direction: FloatArray) -> FloatArray:
        """Return u for all balls moving with one velocity, shape (d,), and no spin."""
        return self.at_rest(np.broadcast_to(direction, (self.n_balls, self.dimension)))

    def with_margin(self, margin: float) -> "BallSystem":
        """Return the balls swollen by ``margin`` [m], so that contacts count as closed that are open by so much.

        All levers of a ball grow alike, which leaves the balance of its moments as it is.
        """
        return replace(self, radii=self.radii + margin)

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return the centres moved along their velocities; the orientation of a ball has no influence on its motion."""
        return position + seconds * self.twists(velocity)[:, : self.dimension].ravel()

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M: gaps and W of the contacts that overlap there."""
        centres = self.centres(midpoint)
        free = self.twists(velocity).copy()
        translation = self.twists(velocity)[:, : self.dimension]
        for acceleration in self.accelerations:
            free[:, : self.dimension] += seconds * acceleration(centres, translation, self.masses)
        contacts = self._contacts(centres)
        return StepAssembly(free.ravel(), self.inverse_mass, contacts)

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the pairs, and of balls and surfaces, with a gap below ``limit``."""
        keys, _, second, gap, _ = self.with_margin(limit)._touching(self.centres(position))
        gap = gap + np.where(second < 0, limit, 2.0 * limit)
        near = gap < limit
        return keys[near], gap[near]

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return all overlaps, or None if none of them is deeper than ``tolerated`` [m]."""
        _, first, second, gap, normal = self._touching(self.centres(position))
        if not (gap < -tolerated).any():
            return None
        return Overlaps(gap, self._directions(first, second, normal, 1), self.inverse_mass)

    def _contacts(self, centres: FloatArray) -> ActiveContacts | None:
        keys, first, second, gap, normal = self._touching(centres)
        if not len(keys):
            return None
        directions = self._directions(first, second, normal, self.rows_per_contact)
        restitution = np.full((len(keys), self.rows_per_contact), self.restitution_tangential)
        rebound = self.restitution_normal
        restitution[:, 0] = rebound(self._keys.pairs(keys)) if callable(rebound) else rebound
        friction = self.friction(self._keys.pairs(keys)) if callable(self.friction) else self.friction or 0.0
        laws = Laws.contacts(friction, self.rows_per_contact, len(keys))
        return ActiveContacts(keys, gap, laws, directions, restitution.ravel(), self.rows_per_contact)

    def _directions(self, first: IntArray, second: IntArray, normal: FloatArray, rows: int) -> Pieces:
        lanes, spins = tuple(range(rows)), tuple(range(self.spins))
        starts, chunks, values = _force_directions(first, second, normal, self.radii, lanes, spins)
        return Pieces(starts, chunks, values, self.n_balls)

    def _touching(self, centres: FloatArray) -> tuple[IntArray, IntArray, IntArray, FloatArray, FloatArray]:
        """Return keys, first ball, second ball (−1 for a surface), gaps and normals of all overlaps, ordered by key.

        As bodies of keys, surfaces are numbered after the balls.
        """
        n = self.n_balls
        pairs, gap, normal = _overlaps_of_pairs(self._near_pairs.at(centres), centres, self.radii)
        keys, gaps, normals = [self._keys.encode(pairs[:, 0], pairs[:, 1])], [gap], [normal]
        for index, surface in enumerate(self.surfaces):
            touching, gap, normal = surface.touching(centres, self.radii)
            keys.append(self._keys.encode(touching, np.full(len(touching), n + index)))
            gaps.append(gap)
            normals.append(normal)
        key = np.concatenate(keys)
        order = np.argsort(key, kind="stable")  # merges runs that are sorted already
        key = key[order]
        first, second, _ = self._keys.decode(key)
        second[second >= n] = -1
        return key, first, second, np.concatenate(gaps)[order], np.concatenate(normals)[order]

    @property
    def potential_energy(self) -> Callable[[FloatArray], float] | None:
        """Q ↦ V [J] of all forces; None if the potential energy of one of them is not known."""
        known = known_potential(self.potentials, len(self.accelerations))
        return None if known is None else lambda position: known(self.centres(position), self.masses)

    def kinetic_energies(self, velocity: FloatArray) -> FloatArray:
        """Return ½ uᵀ M u of each ball [J], shape (n,)."""
        products = velocity * (velocity / self.inverse_mass.matrix.data)
        energies: FloatArray = 0.5 * self.twists(products).sum(axis=1)
        return energies

    def kinetic_energy(self, velocity: FloatArray) -> float:
        """Return ½ uᵀ M u [J]."""
        return 0.5 * float(velocity @ (velocity / self.inverse_mass.matrix.data))


@njit(cache=True)
def _overlaps_of_pairs(near, centres, radii):  # type: ignore[no-untyped-def]
    """Return those pairs that overlap, gaps and normals; concentric balls, which have none, are pushed along x."""
    dim = centres.shape[1]
    pairs, gaps, normals = np.empty_like(near), np.empty(len(near)), np.zeros((len(near), dim))
    count = 0
    for k in range(len(near)):
        i, j = near[k, 0], near[k, 1]
        squared, reach = 0.0, radii[i] + radii[j]
        for axis in range(dim):
            across = centres[i, axis] - centres[j, axis]
            normals[count, axis] = across
            squared += across * across
        if not squared < reach * reach:
            continue
        distance = np.sqrt(squared)
        pairs[count, 0], pairs[count, 1], gaps[count] = i, j, distance - radii[i] - radii[j]
        if distance > 0.0:
            for axis in range(dim):
                normals[count, axis] /= distance
        else:
            normals[count, 0] = 1.0
        count += 1
    return pairs[:count], gaps[:count], normals[:count]


@njit(cache=True)
def _force_directions(first, second, normals, radii, lanes, spins):  # type: ignore[no-untyped-def]
    """Return W in pairs of pieces (starts, chunks, values): the relative velocity of each contact point, row by row.

    γ_N = n·(v_i − v_j), γ_T = t·(v_i − v_j) − (n × t)·(r_i ω_i + r_j ω_j), with n from j to i; in the plane n × t = 1.
    Lanes and spins are tuples, whose length the compiler knows.
    """
    n_contacts, dim = normals.shape
    n_rows, n_spins = len(lanes), len(spins)
    chunks = np.full(2 * n_contacts, len(radii))
    values = np.zeros((2 * n_contacts, n_rows, dim + n_spins))
    rows, levers = np.zeros((3, 3)), np.zeros((3, 3))
    for c in range(n_contacts):
        if n_rows > 1:
            write_frame((normals[c, 0], normals[c, 1], normals[c, 2] if dim == 3 else 0.0), dim, rows)
            _write_levers(rows, dim, levers)
        else:
            for axis in range(dim):
                rows[0, axis] = normals[c, axis]
        for side in range(2):
            piece, ball, sign = 2 * c + side, second[c] if side else first[c], 1.0 - 2.0 * side
            if ball < 0:
                continue
            chunks[piece] = ball
            for lane in range(n_rows):
                for axis in range(dim):
                    values[piece, lane, axis] = sign * rows[lane, axis]
                for spin in range(n_spins if lane else 0):
                    values[piece, lane, dim + spin] = -radii[ball] * levers[lane, spin]
    return 2 * np.arange(n_contacts + 1), chunks, values


@njit(cache=True)
def _write_levers(rows, dim, levers):  # type: ignore[no-untyped-def]
    """Write n × t of both tangents into rows 1 and 2 of ``levers``; in the plane it is 1."""
    if dim == 2:
        levers[1, 0] = 1.0
        return
    for lane in range(1, 3):
        levers[lane, 0] = rows[0, 1] * rows[lane, 2] - rows[0, 2] * rows[lane, 1]
        levers[lane, 1] = rows[0, 2] * rows[lane, 0] - rows[0, 0] * rows[lane, 2]
        levers[lane, 2] = rows[0, 0] * rows[lane, 1] - rows[0, 1] * rows[lane, 0]
