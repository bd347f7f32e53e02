"""Systems of rigid balls (spatial) or discs (planar) among fixed surfaces.

Friction alone can turn a ball, so without it a ball has no rotational degrees of freedom and a contact one row:

    spatial    u = (v, ω) ∈ R⁶, rows N, T1, T2        without friction u = v ∈ R³, row N
    planar     u = (v, ω) ∈ R³, rows N, T             without friction u = v ∈ R², row N

Contacts are found by a cell list and written straight into a sparse W; no dense matrix appears anywhere.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numba import njit

from .broadphase import overlapping_pairs
from .errors import ProblemError
from .factors import InverseMass
from .laws import FloatArray, IntArray, Laws
from .surfaces import Surface
from .system import ActiveContacts, StepAssembly

SPHERE_INERTIA = 0.4
"""J/(m r²) of a homogeneous ball."""

DISC_INERTIA = 0.5
"""J/(m r²) of a homogeneous disc."""

Acceleration = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""(centres, velocities, masses) ↦ acceleration of the centres [m/s²]; shapes (n, d), (n, d), (n,) and (n, d)."""


@dataclass(frozen=True, eq=False)
class BallSystem:
    """Balls, surfaces, and the effects that act; ``scenes.effects`` builds one from a list of effects.

    Attributes:
        radii: r [m], shape (n,).
        masses: m [kg], shape (n,).
        surfaces: fixed surfaces.
        dimension: 2 (planar) or 3 (spatial).
        accelerations: what acts on the centres beside contacts.
        friction: μ of all contacts, or None for balls without friction and without rotation.
        restitution_normal: ε_N of all contacts.
        restitution_tangential: ε_T of all contacts.
        inertia_factor: J/(m r²).

    Raises:
        ProblemError: if a radius or a mass is not positive, or a coefficient is out of range.
    """

    radii: FloatArray
    masses: FloatArray
    surfaces: Sequence[Surface]
    dimension: int
    accelerations: Sequence[Acceleration] = ()
    friction: float | None = None
    restitution_normal: float = 0.0
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
        if self.friction is not None and not 0.0 <= self.friction < np.inf:
            raise ProblemError(f"friction must be finite and not negative, got {self.friction}.")
        for name in ("restitution_normal", "restitution_tangential"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ProblemError(f"{name} must be between 0 and 1, got {getattr(self, name)}.")

    @property
    def n_balls(self) -> int:
        """Number of balls."""
        return len(self.radii)

    @property
    def rows_per_contact(self) -> int:
        """Rows of one contact: 1 without friction, else the dimension."""
        return 1 if self.friction is None else self.dimension

    @property
    def spins(self) -> int:
        """Rotational degrees of freedom of one ball: 0 without friction, else 1 (planar) or 3 (spatial)."""
        if self.friction is None:
            return 0
        return 1 if self.dimension == 2 else 3

    @property
    def dofs_per_ball(self) -> int:
        """Degrees of freedom of one ball."""
        return self.dimension + self.spins

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

    def _contacts(self, centres: FloatArray) -> ActiveContacts | None:
        keys, first, second, gap, normal = self._touching(centres)
        if not len(keys):
            return None
        indptr, indices, values = _force_directions(
            first, second, normal, self.radii, self.dofs_per_ball, self.rows_per_contact
        )
        shape = (self.n_balls * self.dofs_per_ball, len(keys) * self.rows_per_contact)
        directions = sp.csc_array((values, indices, indptr), shape=shape)
        directions.has_canonical_format = True
        restitution = np.full((len(keys), self.rows_per_contact), self.restitution_tangential)
        restitution[:, 0] = self.restitution_normal
        laws = Laws.contacts(self.friction or 0.0, self.rows_per_contact, len(keys))
        return ActiveContacts(keys, gap, laws, directions, restitution.ravel(), self.rows_per_contact)

    def _touching(self, centres: FloatArray) -> tuple[IntArray, IntArray, IntArray, FloatArray, FloatArray]:
        """Return keys, first ball, second ball (−1 for a surface), gaps and normals of all overlaps, ordered by key.

        The key of balls i < j is i · stride + j, that of ball i on surface k is i · stride + n + k.
        """
        n, stride = self.n_balls, self.n_balls + len(self.surfaces)
        pairs = overlapping_pairs(centres, self.radii)
        apart = centres[pairs[:, 0]] - centres[pairs[:, 1]]
        distance = np.sqrt((apart**2).sum(axis=1))
        keys = [pairs[:, 0] * stride + pairs[:, 1]]
        gaps = [distance - self.radii[pairs[:, 0]] - self.radii[pairs[:, 1]]]
        normals = [_unit(apart, distance)]
        for index, surface in enumerate(self.surfaces):
            touching, gap, normal = surface.touching(centres, self.radii)
            keys.append(touching * stride + n + index)
            gaps.append(gap)
            normals.append(normal)
        key = np.concatenate(keys)
        order = np.argsort(key)
        key = key[order]
        second = key % stride
        return (
            key,
            key // stride,
            np.where(second < n, second, -1),
            np.concatenate(gaps)[order],
            np.concatenate(normals)[order],
        )

    def kinetic_energy(self, velocity: FloatArray) -> float:
        """Return ½ uᵀ M u [J]."""
        return 0.5 * float(velocity @ (velocity / self.inverse_mass.matrix.data))


def _unit(vectors: FloatArray, length: FloatArray) -> FloatArray:
    """Return vectors of length one; concentric balls, which have no normal, are pushed apart along the first axis."""
    unit = vectors / np.where(length > 0.0, length, 1.0)[:, None]
    unit[length == 0.0, 0] = 1.0
    return unit


@njit(cache=True)
def _tangents(normal, tangents):  # type: ignore[no-untyped-def]
    """Write T (planar) or T1, T2 (spatial; Duff et al. 2017, which jumps only at n_z = 0) orthogonal to ``normal``."""
    if len(normal) == 2:
        tangents[0, 0], tangents[0, 1] = -normal[1], normal[0]
        return
    x, y, z = normal
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    tangents[0, 0], tangents[0, 1], tangents[0, 2] = 1.0 + sign * x * x * a, sign * b, -sign * x
    tangents[1, 0], tangents[1, 1], tangents[1, 2] = b, sign + y * y * a, -y


@njit(cache=True)
def _force_directions(first, second, normals, radii, dofs_per_ball, rows_per_contact):  # type: ignore[no-untyped-def]
    """Return W in compressed columns: the relative velocity of contact point and partner, row by row.

    γ_N = n·(v_i − v_j), γ_T = t·(v_i − v_j) − (n × t)·(r_i ω_i + r_j ω_j), with n from j to i; in the plane n × t = 1.
    """
    n_contacts, dim = normals.shape
    spins = dofs_per_ball - dim
    indptr = np.zeros(n_contacts * rows_per_contact + 1, dtype=np.int32)
    size = n_contacts * 2 * (dim + (rows_per_contact - 1) * dofs_per_ball)
    indices = np.empty(size, dtype=np.int32)
    values = np.empty(size)
    tangents = np.empty((2, dim))
    entry = 0
    for c in range(n_contacts):
        normal = normals[c]
        if rows_per_contact > 1:
            _tangents(normal, tangents)
        for lane in range(rows_per_contact):
            direction = normal if lane == 0 else tangents[lane - 1]
            for body in range(2):
                ball = first[c] if body == 0 else second[c]
                if ball < 0:
                    continue
                sign = 1.0 - 2.0 * body
                for axis in range(dim):
                    indices[entry] = ball * dofs_per_ball + axis
                    values[entry] = sign * direction[axis]
                    entry += 1
                if lane == 0:
                    continue
                for spin in range(spins):
                    if dim == 2:
                        lever = 1.0
                    else:
                        p, q = (spin + 1) % 3, (spin + 2) % 3
                        lever = normal[p] * direction[q] - normal[q] * direction[p]
                    indices[entry] = ball * dofs_per_ball + dim + spin
                    values[entry] = -radii[ball] * lever
                    entry += 1
            indptr[c * rows_per_contact + lane + 1] = entry
    return indptr, indices[:entry], values[:entry]
