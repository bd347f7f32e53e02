"""Systems of rigid balls (spatial) or discs (planar) among fixed surfaces.

Only friction can rotate a ball. Without it, a ball has no rotational degrees of freedom and a contact has one row:

    spatial    u = (v, ω) ∈ R⁶, rows N, T1, T2        without friction u = v ∈ R³, row N
    planar     u = (v, ω) ∈ R³, rows N, T             without friction u = v ∈ R², row N

A cell list finds the contacts. Their force directions are stored as pieces of W, two per contact, without a dense
matrix.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray, real_numbers
from ...contact.laws import Laws
from ...contact.matrices.ball_contacts import BallContacts, BallNormals
from ...contact.matrices.contact_frame import write_frame
from ...contact.matrices.factors import InverseMass
from ...contact.matrices.pieces import Pieces
from ...errors import ProblemError
from ..detection.broad_phase import NearPairs
from ..detection.contact_keys import ContactKeys
from .ball_overlaps import DetectedContacts, is_deeper, lowest_gap, merge_contacts
from .rigid.materials import MaterialPairs
from .surfaces import Surface, SurfaceContacts
from .system import ActiveContacts, Overlaps, StepAssembly

SPHERE_INERTIA = 0.4
"""J/(m r²) of a homogeneous ball."""

DISC_INERTIA = 0.5
"""J/(m r²) of a homogeneous disc."""

Acceleration = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""(centres, velocities, masses) ↦ acceleration of the centres [m/s²]; shapes (n, d), (n, d), (n,) and (n, d)."""

PairCoefficient = Callable[[IntArray], FloatArray]
"""(keys of pairs of bodies) ↦ coefficients of their contacts, μ or ε_N; shapes (n_contacts,) and (n_contacts,)."""

Potential = Callable[[FloatArray, FloatArray], float]
"""(centres, masses) ↦ potential energy [J]; shapes (n, d) and (n,)."""


def total_potential(potentials: Sequence[Potential | None], n_forces: int) -> Potential | None:
    """Return the sum of the potentials of ``n_forces`` forces; None if one of them is unknown."""
    known = [potential for potential in potentials if potential is not None]
    if len(known) != n_forces:
        return None
    return lambda centres, masses: sum(potential(centres, masses) for potential in known)


@dataclass(frozen=True, eq=False)
class BallSystem:
    """Balls, surfaces, and the effects on them; ``scenes.effects`` builds such a system from a list of effects.

    Attributes:
        radii: r [m], shape (n,).
        masses: m [kg], shape (n,).
        surfaces: fixed surfaces.
        dimension: 2 (planar) or 3 (spatial).
        accelerations: accelerations of the centres by forces other than contact forces.
        potentials: potential energy of each of ``accelerations``, None where it is not known.
        friction: μ of all contacts, or a function of the keys of pairs of bodies; None for balls without friction and
            without rotation.
        restitution_normal: ε_N of all contacts, or a function of the keys of pairs of bodies.
        restitution_tangential: ε_T of all contacts.
        inertia_factor: J/(m r²).

    Raises:
        ProblemError: if a radius or a mass is not positive and finite, their numbers differ, a coefficient is out of
            range, or materials are missing.
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
            if values.ndim != 1 or not ((values > 0.0) & (values < np.inf)).all():
                raise ProblemError(f"{name} must be positive, finite numbers, one per ball.")
            object.__setattr__(self, name, values)
        if len(self.radii) != len(self.masses):
            raise ProblemError(f"there are {len(self.radii)} radii and {len(self.masses)} masses; give one per ball.")
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
            if isinstance(value, MaterialPairs):
                value = max(value.coefficients.values(), default=0.0)
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
    def n_rotations(self) -> int:
        """Rotational degrees of freedom of one ball, 0 without friction, else 1 (planar) or 3 (spatial)."""
        if self.friction is None:
            return 0
        return 1 if self.dimension == 2 else 3

    @property
    def dofs_per_ball(self) -> int:
        """Degrees of freedom of one ball."""
        return self.dimension + self.n_rotations

    @cached_property
    def _near_pairs(self) -> NearPairs:
        return NearPairs(self.radii)

    @cached_property
    def _keys(self) -> ContactKeys:
        return ContactKeys(self.n_balls + len(self.surfaces))

    @cached_property
    def inverse_mass(self) -> InverseMass:
        """M⁻¹, a diagonal matrix, shape (n · dofs_per_ball, n · dofs_per_ball)."""
        inertia = self.inertia_factor * self.masses * self.radii**2
        diagonal = np.column_stack([*[1.0 / self.masses] * self.dimension, *[1.0 / inertia] * self.n_rotations]).ravel()
        return InverseMass.create(diagonal)

    def centres(self, position: FloatArray) -> FloatArray:
        """Return the centres [m], shape (n, d), of a position vector q, shape (n · d,)."""
        return position.reshape(self.n_balls, self.dimension)

    def twists(self, velocity: FloatArray) -> FloatArray:
        """Return (v, ω) of each ball, shape (n, dofs_per_ball), of a velocity vector u."""
        return velocity.reshape(self.n_balls, self.dofs_per_ball)

    def without_spin(self, velocities: FloatArray) -> FloatArray:
        """Return u for centres moving with ``velocities``, shape (n, d), and no spin."""
        return np.column_stack([velocities, np.zeros((self.n_balls, self.n_rotations))]).ravel()

    def translation(self, direction: FloatArray) -> FloatArray:
        """Return u for all balls moving with one velocity, shape (d,), and no spin."""
        return self.without_spin(np.broadcast_to(direction, (self.n_balls, self.dimension)))

    def with_margin(self, margin: float) -> "BallSystem":
        """Return balls with radii larger by ``margin`` [m].

        Gaps below ``margin`` to surfaces, and below twice ``margin`` between balls, then count as closed. All lever
        arms of a ball grow by the same length, so the equilibrium of its moments does not change.
        """
        return replace(self, radii=self.radii + margin)

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return the centres moved along their velocities; the orientation of a ball has no influence on its motion."""
        moved: FloatArray = _moved(self.centres(position), self.twists(velocity), seconds).reshape(-1)
        return moved

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Return the step linearised at q_M: its free motion, and gaps and W of the contacts with g(q_M) < 0.

        Args:
            midpoint: q_M [m], shape (n · d,).
            velocity: u before the step, shape (n · dofs_per_ball,).
            seconds: duration of the step [s].
        """
        centres = self.centres(midpoint)
        free = np.array(self.twists(velocity), dtype=np.float64)
        translation = self.twists(velocity)[:, : self.dimension]
        for acceleration in self.accelerations:
            accelerations = real_numbers(acceleration(centres, translation, self.masses), "accelerations")
            if accelerations.shape != centres.shape:
                accelerations = np.broadcast_to(accelerations, centres.shape).copy()
            _accelerate(free, np.ascontiguousarray(accelerations, dtype=np.float64), seconds)
        contacts = self._contacts(centres)
        return StepAssembly(free.reshape(-1), self.inverse_mass, contacts)

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the contacts with g(q) < ``limit``, which is not negative."""
        detected = self.with_margin(limit)._find_contacts(self.centres(position))
        gap = detected.gap + np.where(detected.chunks[1::2] == self.n_balls, limit, 2.0 * limit)
        near = gap < limit
        return detected.keys[near], gap[near]

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return all overlaps, or None if no overlap is deeper than ``tolerated`` [m]."""
        centres = self.centres(position)
        on_surfaces, near = self._find_surface_contacts(centres), self._near_pairs.at(centres)
        deepest = min((lowest_gap(gaps) for _, gaps, _ in on_surfaces if len(gaps)), default=0.0)
        if not deepest < -tolerated and not is_deeper(near, centres, self.radii, tolerated):
            return None
        detected = merge_contacts(near, centres, self.radii, on_surfaces)
        normals = BallNormals(detected.chunks, detected.normals, self.n_balls, self.dofs_per_ball)
        return Overlaps(detected.gap, normals, self.inverse_mass)

    def _contacts(self, centres: FloatArray) -> ActiveContacts | None:
        detected = self._find_contacts(centres)
        keys = detected.keys
        if not len(keys):
            return None
        directions = self._directions(detected)
        restitution = np.empty((len(keys), self.rows_per_contact))
        restitution[:] = self.restitution_tangential
        coefficient = self.restitution_normal
        restitution[:, 0] = coefficient(self._keys.pairs(keys)) if callable(coefficient) else coefficient
        friction = self.friction(self._keys.pairs(keys)) if callable(self.friction) else self.friction or 0.0
        laws = Laws.contacts(friction, self.rows_per_contact, len(keys))
        return ActiveContacts(keys, detected.gap, laws, directions, restitution.ravel(), self.rows_per_contact)

    def _directions(self, detected: DetectedContacts) -> Pieces:
        rows = self.rows_per_contact
        if rows == 3:
            return BallContacts(detected.chunks, detected.normals, self.radii)
        if rows == 1:
            return BallNormals(detected.chunks, detected.normals, self.n_balls, self.dimension)
        values = _planar_directions(detected.chunks, detected.normals, self.radii)
        return Pieces(2 * np.arange(len(detected.keys) + 1), detected.chunks, values, self.n_balls)

    def _find_contacts(self, centres: FloatArray) -> DetectedContacts:
        """Return all overlaps of balls with balls and surfaces."""
        return merge_contacts(self._near_pairs.at(centres), centres, self.radii, self._find_surface_contacts(centres))

    def _find_surface_contacts(self, centres: FloatArray) -> list[SurfaceContacts]:
        """Return the balls that touch each surface."""
        return [surface.find_contacts(centres, self.radii) for surface in self.surfaces]

    @property
    def potential_energy(self) -> Callable[[FloatArray], float] | None:
        """The function q ↦ V [J] of all forces; None if the potential energy of one of them is not known."""
        potential = total_potential(self.potentials, len(self.accelerations))
        return None if potential is None else lambda position: potential(self.centres(position), self.masses)

    def kinetic_energies(self, velocity: FloatArray) -> FloatArray:
        """Return ½ uᵀ M u of each ball [J], shape (n,)."""
        products = velocity * (velocity / self.inverse_mass.matrix.data)
        energies: FloatArray = 0.5 * self.twists(products).sum(axis=1)
        return energies

    def kinetic_energy(self, velocity: FloatArray) -> float:
        """Return ½ uᵀ M u [J]."""
        return 0.5 * float(velocity @ (velocity / self.inverse_mass.matrix.data))


@njit(cache=True)
def _moved(centres, twists, seconds):  # type: ignore[no-untyped-def]
    """Return the centres after a motion with constant velocities."""
    n, dim = centres.shape
    moved = np.empty((n, dim))
    for i in range(n):
        for axis in range(dim):
            moved[i, axis] = centres[i, axis] + seconds * twists[i, axis]
    return moved


@njit(cache=True)
def _accelerate(twists, accelerations, seconds):  # type: ignore[no-untyped-def]
    """Add the change of velocity within ``seconds`` to v of each ball."""
    for i in range(len(accelerations)):
        for axis in range(accelerations.shape[1]):
            twists[i, axis] += seconds * accelerations[i, axis]


@njit(cache=True)
def _planar_directions(chunks, normals, radii):  # type: ignore[no-untyped-def]
    """Return W of discs with friction in pieces: γ_N = n·(v_i − v_j), γ_T = t·(v_i − v_j) − (r_i ω_i + r_j ω_j)."""
    values, rows = np.zeros((len(chunks), 2, 3)), np.zeros((3, 3))
    for piece in range(len(chunks)):
        ball, contact, sign = chunks[piece], piece // 2, 1.0 - 2.0 * (piece % 2)
        if ball == len(radii):
            continue
        write_frame((normals[contact, 0], normals[contact, 1], 0.0), 2, rows)
        for lane in range(2):
            for axis in range(2):
                values[piece, lane, axis] = sign * rows[lane, axis]
        values[piece, 1, 2] = -radii[ball]
    return values
