"""Systems of moving and fixed rigid bodies of any shape.

    q = (x, quaternion)   7 numbers per body: the centre of mass, and the rotation of its principal axes
    u = (v, ω)            6 numbers per body: v in world axes, ω in body axes, so that M is constant and diagonal

A contact has the row N, with friction also T1 and T2, then the axes of rolling friction. Contacts are written directly
into W in pieces, one or two bodies per contact. Rows of joints follow those of the contacts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from ....arrays import FloatArray, IntArray, real_numbers
from ....contact.laws import Laws
from ....contact.matrices.factors import InverseMass
from ....errors import ProblemError
from ...detection.broad_phase import near_bodies
from ...detection.contact_keys import ContactKeys
from ...detection.narrow_phase import MAX_FEATURES, ContactSet, find_contacts
from ..balls import Acceleration, PairCoefficient, Potential, total_potential
from ..system import ActiveContacts, JointErrors, Overlaps, StepAssembly
from .force_directions import force_directions
from .materials import MaterialPairs
from .orientation import IDENTITY, check_orientation, free_spins, moved
from .shapes import Shape, check_shape


@dataclass(frozen=True)
class FixedBody:
    """A body without degrees of freedom.

    Attributes:
        shape: its shape.
        centre: the origin of its body axes [m].
        orientation: rotation of its body axes, a unit quaternion.

    Raises:
        ProblemError: if the body has no shape, a number is not finite, or the quaternion does not have unit length.
    """

    shape: Shape
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = IDENTITY

    def __post_init__(self) -> None:
        check_shape("shape of a fixed body", self.shape)
        if not np.isfinite(self.centre).all():
            raise ProblemError(f"centre of a fixed body must be finite, got {self.centre}.")
        check_orientation("orientation of a fixed body", self.orientation)


@dataclass(frozen=True, eq=False)
class JointRows:
    """The rows of all joints, and of the limits that are reached, at one position.

    Attributes:
        keys: identity of each joint and limit, from 0, ascending, shape (n,).
        gap: g [m or rad] of limits, 0 for joints, shape (n,).
        row_counts: number of rows of each joint and limit, shape (n,).
        laws: their force laws.
        directions: W, shape (n_dofs, n_rows).
        restitution: ε of each row, shape (n_rows,).
        drive: speed of motors [m/s or rad/s], as in ``ActiveContacts``, shape (n_rows,).
    """

    keys: IntArray
    gap: FloatArray
    row_counts: IntArray
    laws: Laws
    directions: sp.csc_array[Any]
    restitution: FloatArray
    drive: FloatArray


class Joints(Protocol):
    """The interface of joints to the system; poses are (x, quaternion), shape (n, 7)."""

    @property
    def pairs(self) -> IntArray:
        """Pairs of joined bodies, first < second, which do not touch each other, shape (n, 2)."""
        ...

    def rows_at(self, poses: FloatArray, seconds: float, margin: float = 0.0) -> JointRows:
        """Return the rows for a step of ``seconds``, with those of limits that have a gap below ``margin``."""
        ...

    def limits_below(self, poses: FloatArray, margin: float) -> tuple[IntArray, FloatArray, sp.csc_array[Any]]:
        """Return keys, gaps [m or rad] and W of the limits with a gap below ``margin``."""
        ...

    def errors_at(self, poses: FloatArray) -> JointErrors:
        """Return the residual of the joints [m or rad] and its W."""
        ...

    def check_start(self, poses: FloatArray) -> None:
        """Raise ``ProblemError`` if a joint does not close, or is beyond a limit."""
        ...


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Moving and fixed rigid bodies, and the effects on them, which ``scenes.effects`` adds.

    Attributes:
        shapes: shape of each moving body.
        masses: m [kg], shape (n,).
        fixed: bodies without degrees of freedom; their indices follow those of the moving ones.
        inertias: principal moments J [kg m²], shape (n, 3); those of homogeneous bodies if None.
        accelerations: accelerations of the centres by forces other than contact forces.
        potentials: potential energy of each of ``accelerations``, None if it is not known.
        friction: μ of all contacts, or a function of the keys of pairs of bodies; None for no friction.
        restitution_normal: ε_N of all contacts, or a function of the keys of pairs of bodies.
        restitution_tangential: ε_T of all contacts.
        rolling_friction: μ_r [m] of all contacts.
        rolling_axes: rows of rolling friction: 0 none, 1 spinning about the normal, 2 rolling, 3 both with one bound.
        is_gyroscopic: whether ω × Jω acts; otherwise ω is constant in body axes unless another moment acts.
        joints: joints between bodies; bodies that are joined do not touch each other.
        margin: gap [m] below which contacts are active; 0 in motion.

    Raises:
        ProblemError: if arrays have unequal lengths, a body has no shape, a moving body is unbounded, a mass or a
            moment of inertia is not positive, a moment exceeds the sum of the other two, a coefficient is out of range,
            or materials are missing.
    """

    shapes: Sequence[Shape]
    masses: FloatArray
    fixed: Sequence[FixedBody] = ()
    inertias: FloatArray | None = None
    accelerations: Sequence[Acceleration] = ()
    potentials: Sequence[Potential | None] = ()
    friction: float | PairCoefficient | None = None
    restitution_normal: float | PairCoefficient = 0.0
    restitution_tangential: float = 0.0
    rolling_friction: float = 0.0
    rolling_axes: int = 0
    is_gyroscopic: bool = False
    joints: Joints | None = None
    margin: float = 0.0

    def __post_init__(self) -> None:
        self._check_bodies()
        self._check_inertias()
        for name in ("friction", "restitution_normal"):
            value = getattr(self, name)
            if isinstance(value, MaterialPairs):
                value.check_count(name, len(self.shapes) + len(self.fixed))
        for name in ("friction", "rolling_friction"):
            value = getattr(self, name)
            if not (value is None or callable(value) or 0.0 <= value < np.inf):
                raise ProblemError(f"{name} must be finite and not negative, got {value}.")
        for name in ("restitution_normal", "restitution_tangential"):
            value = getattr(self, name)
            if isinstance(value, MaterialPairs):
                value = max(value.coefficients.values(), default=0.0)
            if not (callable(value) and name == "restitution_normal") and not 0.0 <= value <= 1.0:
                raise ProblemError(f"{name} must be between 0 and 1, got {value}.")
        if self.rolling_axes not in (0, 1, 2, 3):
            raise ProblemError(f"rolling_axes must be 0, 1, 2 or 3, got {self.rolling_axes}.")

    def _check_bodies(self) -> None:
        masses = np.ascontiguousarray(real_numbers(self.masses, "masses"), dtype=np.float64)
        if masses.shape != (len(self.shapes),):
            raise ProblemError(
                f"masses must be {len(self.shapes)} positive numbers, one per shape, got shape {masses.shape}."
            )
        for body, (shape, mass) in enumerate(zip(self.shapes, masses.tolist(), strict=True)):
            check_shape(f"shape of body {body}", shape)
            if shape.bounding_radius == np.inf:
                raise ProblemError(f"body {body} is unbounded and cannot move; list its shape among the fixed bodies.")
            if not 0.0 < mass < np.inf:
                raise ProblemError(
                    f"masses[{body}] must be positive and finite, got {mass}; list a body that cannot move among the "
                    "fixed bodies."
                )
        fixed: Sequence[object] = self.fixed
        for number, fixed_body in enumerate(fixed):
            if not isinstance(fixed_body, FixedBody):
                kind = type(fixed_body).__name__
                raise ProblemError(f"fixed[{number}] must be a FixedBody, got {kind}; write FixedBody({kind}(…)).")
        object.__setattr__(self, "masses", masses)

    def _check_inertias(self) -> None:
        if self.moments.shape != (self.n_bodies, 3):
            raise ProblemError(f"inertias must have shape ({self.n_bodies}, 3), got {self.moments.shape}.")
        for body, moments in enumerate(map(tuple, self.moments.tolist())):
            if not all(0.0 < moment < np.inf for moment in moments):
                raise ProblemError(
                    f"inertias[{body}] must be positive and finite, got {moments}; omit inertias for homogeneous "
                    "bodies."
                )
            if 2.0 * max(moments) > (1.0 + 1e-12) * sum(moments):
                raise ProblemError(
                    f"no body has the moments of inertia {moments} of inertias[{body}]: the largest must not "
                    "exceed the sum of the others."
                )

    @cached_property
    def moments(self) -> FloatArray:
        """Principal moments of inertia J [kg m²], shape (n, 3)."""
        if self.inertias is not None:
            return np.ascontiguousarray(self.inertias, dtype=np.float64)
        densities = self.masses / np.array([shape.volume for shape in self.shapes])
        moments: FloatArray = densities[:, None] * np.array([shape.inertia for shape in self.shapes]).reshape(-1, 3)
        return moments

    @property
    def n_bodies(self) -> int:
        """Number of moving bodies."""
        return len(self.masses)

    @property
    def linear_rows(self) -> int:
        """Number of velocity rows of a contact: 1 without friction, else 3."""
        return 1 if self.friction is None else 3

    @property
    def rows_per_contact(self) -> int:
        """Number of rows of one contact."""
        return self.linear_rows + self.rolling_axes

    @cached_property
    def inverse_mass(self) -> InverseMass:
        """M⁻¹, diagonal."""
        return InverseMass.create(1.0 / self._mass_diagonal)

    @cached_property
    def _mass_diagonal(self) -> FloatArray:
        diagonal: FloatArray = np.column_stack([*[self.masses] * 3, self.moments]).ravel()
        return diagonal

    @cached_property
    def _all_shapes(self) -> Sequence[Shape]:
        return (*self.shapes, *(body.shape for body in self.fixed))

    @cached_property
    def _fixed_poses(self) -> FloatArray:
        return np.array([(*body.centre, *body.orientation) for body in self.fixed]).reshape(-1, 7)

    @cached_property
    def radii(self) -> FloatArray:
        """Bounding radii [m] of all bodies, fixed ones last."""
        return np.array([shape.bounding_radius for shape in self._all_shapes])

    @cached_property
    def thicknesses(self) -> FloatArray:
        """Diameters [m] of the largest spheres inside all bodies, fixed ones last."""
        return np.array([shape.thickness for shape in self._all_shapes])

    @cached_property
    def _keys(self) -> ContactKeys:
        return ContactKeys(len(self._all_shapes), MAX_FEATURES)

    @cached_property
    def _joined_pairs(self) -> IntArray:
        """Numbers i · n + j, as in ``near_bodies``, of the joined pairs, which have no contacts."""
        pairs = np.zeros((0, 2), dtype=np.int64) if self.joints is None else self.joints.pairs
        pair_keys: IntArray = np.unique(pairs @ [len(self._all_shapes), 1])
        return pair_keys

    def poses(self, position: FloatArray) -> FloatArray:
        """Return (x [m], quaternion) of each body, shape (n, 7), of a position vector q, shape (7 n,)."""
        return position.reshape(self.n_bodies, 7)

    def centres(self, position: FloatArray) -> FloatArray:
        """Return the centres of mass [m], shape (n, 3), of a position vector q."""
        return self.poses(position)[:, :3]

    def twists(self, velocity: FloatArray) -> FloatArray:
        """Return (v, ω) of each body, shape (n, 6), of a velocity vector u."""
        return velocity.reshape(self.n_bodies, 6)

    def translation(self, direction: FloatArray) -> FloatArray:
        """Return u of bodies that all move with the velocity ``direction`` [m/s], shape (3,), without spin."""
        return np.tile(np.append(direction, np.zeros(3)), self.n_bodies)

    def with_margin(self, margin: float) -> "RigidBodies":
        """Return the bodies with contacts that count as closed at gaps below ``margin`` [m]."""
        return replace(self, margin=margin)

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q after uniform motion with (v, ω) for ``seconds``, with unit quaternions."""
        return moved(position, velocity, seconds)

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M: gaps and W of the contacts with a gap below the margin there, and of the joints."""
        poses, free_twists = self.poses(midpoint), self.twists(velocity).copy()
        for acceleration in self.accelerations:
            free_twists[:, :3] += seconds * acceleration(poses[:, :3], self.twists(velocity)[:, :3], self.masses)
        contacts = self._active_contacts(poses)
        if self.joints is not None:
            contacts = self._with_joints(contacts, self.joints.rows_at(poses, seconds, self.margin))
        if not self.is_gyroscopic:
            return StepAssembly(free_twists.ravel(), self.inverse_mass, contacts)

        def with_impulses(impulses: FloatArray | None) -> FloatArray:
            moments = None if impulses is None else self.twists(impulses)[:, 3:]
            spins = free_spins(self.twists(velocity)[:, 3:], self.moments, seconds, moments)
            return np.column_stack([free_twists[:, :3], spins]).ravel()

        return StepAssembly(with_impulses(None), self.inverse_mass, contacts, with_impulses)

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the contacts with a gap below ``limit``."""
        poses = self.poses(position)
        contacts = self.contacts_within(poses, limit)
        near = contacts.gap < limit
        keys, gap = self.keys_of(contacts)[near], contacts.gap[near]
        if self.joints is None:
            return keys, gap
        joint_keys, joint_gap, _ = self.joints.limits_below(poses, limit)
        return np.concatenate([keys, self.first_joint_key + joint_keys]), np.concatenate([gap, joint_gap])

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return all contacts and limits that penetrate, and the joints.

        Return None if there are no joints, and no contact is deeper than ``tolerated`` [m].
        """
        poses = self.poses(position)
        contacts = self.contacts_within(poses, 0.0)
        if self.joints is None:
            if not (contacts.gap < -tolerated).any():
                return None
            return Overlaps(contacts.gap, force_directions(contacts, poses, 1, 0), self.inverse_mass)
        _, limit_gap, limit_normals = self.joints.limits_below(poses, 0.0)
        normals = limit_normals
        if len(contacts.gap):
            normals = sp.csc_array(sp.hstack([force_directions(contacts, poses, 1, 0).to_csc(), limit_normals]))
        gap = np.concatenate([contacts.gap, limit_gap])
        return Overlaps(gap, normals, self.inverse_mass, self.joints.errors_at(poses))

    def contacts_within(self, poses: FloatArray, margin: float) -> ContactSet:
        """Return the contacts with a gap below ``margin`` [m], sorted by bodies and feature."""
        all_poses = np.concatenate([poses, self._fixed_poses])
        pairs = near_bodies(all_poses[:, :3], self.radii, self.n_bodies, margin, self._joined_pairs)
        return find_contacts(self._all_shapes, all_poses, pairs, margin)

    def keys_of(self, contacts: ContactSet) -> IntArray:
        """Return the keys that ``assemble`` gives to contacts, shape (n_contacts,)."""
        return self._keys.encode(contacts.first, contacts.second, contacts.feature)

    def _active_contacts(self, poses: FloatArray) -> ActiveContacts | None:
        contacts = self.contacts_within(poses, self.margin)
        if not len(contacts.gap):
            return None
        keys, width = self.keys_of(contacts), self.rows_per_contact
        pairs = self._keys.pairs(keys)
        friction = self.friction(pairs) if callable(self.friction) else self.friction or 0.0
        laws = Laws.contacts(friction, self.linear_rows, len(keys))
        if self.rolling_axes:
            laws = laws.with_rolling(self.rolling_friction, self.rolling_axes)
        restitution = np.zeros((len(keys), width))
        restitution[:, 1 : self.linear_rows] = self.restitution_tangential
        rebound = self.restitution_normal
        restitution[:, 0] = rebound(pairs) if callable(rebound) else rebound
        directions = force_directions(contacts, poses, self.linear_rows, self.rolling_axes)
        return ActiveContacts(keys, contacts.gap, laws, directions, restitution.ravel(), width)

    @property
    def first_joint_key(self) -> int:
        """The key of the first joint, larger than the keys of all contacts."""
        return self._keys.n_bodies**2 * self._keys.n_features

    def _with_joints(self, contacts: ActiveContacts | None, joints: JointRows) -> ActiveContacts | None:
        """Return the contacts followed by the rows of the joints."""
        counts, rebound, drive = joints.row_counts, joints.restitution, joints.drive
        if not len(counts):
            return contacts
        keys = self.first_joint_key + joints.keys
        width = max(self.rows_per_contact, int(counts.max()))
        if contacts is None:
            return ActiveContacts(keys, joints.gap, joints.laws, joints.directions, rebound, width, counts, drive)
        contact_directions = contacts.directions
        assert not isinstance(contact_directions, sp.csc_array)
        return ActiveContacts(
            np.concatenate([contacts.keys, keys]),
            np.concatenate([contacts.gap, joints.gap]),
            Laws.concatenate([contacts.laws, joints.laws]),
            sp.csc_array(sp.hstack([contact_directions.to_csc(), joints.directions])),
            np.concatenate([contacts.restitution, rebound]),
            width,
            np.concatenate([np.full(len(contacts.keys), contacts.width), counts]),
            np.concatenate([np.zeros(contacts.laws.n_rows), drive]),
        )

    @property
    def potential_energy(self) -> Callable[[FloatArray], float] | None:
        """The function q ↦ V [J] of all forces; None if the potential energy of a force is not known."""
        potential = total_potential(self.potentials, len(self.accelerations))
        return None if potential is None else lambda position: potential(self.centres(position), self.masses)

    def kinetic_energy(self, velocity: FloatArray) -> float:
        """Return ½ uᵀ M u [J]."""
        return 0.5 * float(velocity @ (self._mass_diagonal * velocity))
