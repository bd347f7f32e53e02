"""Mechanical systems with unilateral contacts and joints, in the form that steppers need.

M(q) u̇ = h(q, u) + W(q) λ, q̇ = u, with gaps g(q) and set-valued laws between λ and the relative velocities Wᵀu
(Studer & Glocker 2005, [1–6]). A step needs one ``StepAssembly``. Indices B, M and E denote the beginning, midpoint and
end of a step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ...arrays import FloatArray, IntArray, frozen, real_numbers
from ...contact.laws import Laws
from ...contact.matrices.factors import InverseMass
from ...contact.matrices.pieces import Pieces
from ...errors import ProblemError

MAX_PATTERNS = 64
"""Largest number of sets of active contacts that a general system caches; the oldest is dropped."""

MAX_JOINT_ERROR = 1e-11
"""Residual [m or rad] below which a joint counts as closed."""


@dataclass(frozen=True, eq=False)
class ActiveContacts:
    """The contacts of one step, those with g(q_M) < 0, and the joints, which are always active.

    Rows are ordered by key. A vector over rows can be padded to ``width`` lanes per key; states store impulses in this
    form.

    Attributes:
        keys: identity of each contact and joint, ascending and distinct, shape (n_keys,). A contact keeps its key from
            step to step; two bodies that touch at several features have a key for each; see
            ``detection.contact_keys``.
        gap: g(q_M) [m], 0 for joints, shape (n_keys,).
        laws: their force laws.
        directions: W at the midpoint, shape (n_dofs, n_rows): in pieces, one block per contact, if all contacts have
            ``width`` rows and there are no joints, else scipy CSC.
        restitution: ε of each row, shape (n_rows,).
        width: largest number of rows of a contact or joint of the system.
        row_counts: rows of each contact and joint, shape (n_keys,); None if all have ``width``.
        drive: χ of each row [m/s], the relative velocity that counts as rest, shape (n_rows,): the target
            speeds of motors; None if all are 0.
    """

    keys: IntArray
    gap: FloatArray
    laws: Laws
    directions: Pieces | sp.csc_array[Any]
    restitution: FloatArray
    width: int
    row_counts: IntArray | None = None
    drive: FloatArray | None = None

    @cached_property
    def first_rows(self) -> IntArray:
        """First row of each contact and joint, shape (n_keys,)."""
        if self.row_counts is None:
            return np.arange(len(self.keys)) * self.width
        return np.cumsum(self.row_counts) - self.row_counts

    @cached_property
    def is_contact(self) -> NDArray[np.bool_]:
        """Whether each key identifies a contact or the limit of a joint, not a joint itself, shape (n_keys,)."""
        if self.row_counts is None:
            return np.ones(len(self.keys), dtype=np.bool_)
        first_laws = np.searchsorted(self.laws.first_row, self.first_rows)
        return self.laws.is_unilateral[first_laws]

    @property
    def n_contacts(self) -> int:
        """Number of contacts and limits of joints, without the joints themselves."""
        return len(self.keys) if self.row_counts is None else int(self.is_contact.sum())

    def normals(self, rows: FloatArray) -> FloatArray:
        """Return the first value of each contact or limit, shape (n_contacts,), from a vector over rows."""
        return rows[:: self.width] if self.row_counts is None else rows[self.first_rows[self.is_contact]]

    def lanes(self, rows: FloatArray) -> FloatArray:
        """Return a vector over rows padded with zeros, shape (n_keys, width)."""
        if self.row_counts is None:
            return rows.reshape(len(self.keys), self.width)
        padded = np.zeros((len(self.keys), self.width))
        padded[self._is_lane] = rows
        return padded

    def rows(self, lanes: FloatArray) -> FloatArray:
        """Return the vector over rows, shape (n_rows,), from a padded one."""
        return lanes.ravel() if self.row_counts is None else lanes[self._is_lane]

    def for_rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values per row, shape (n_rows,), from values per key, shape (n_keys,)."""
        return np.repeat(values, self.width if self.row_counts is None else self.row_counts)

    def times(self, impulses: FloatArray) -> FloatArray:
        """Return W Λ, shape (n_dofs,)."""
        w = self.directions
        product: FloatArray = w.times(impulses) if isinstance(w, Pieces) else w @ impulses
        return product

    def transposed_times(self, velocity: FloatArray) -> FloatArray:
        """Return Wᵀ u [m/s], shape (n_rows,)."""
        w = self.directions
        product: FloatArray = w.transposed_times(velocity) if isinstance(w, Pieces) else w.T @ velocity
        return product

    @cached_property
    def _is_lane(self) -> NDArray[np.bool_]:
        assert self.row_counts is not None
        return np.arange(self.width) < self.row_counts[:, None]


@dataclass(frozen=True, eq=False)
class StepAssembly:
    """A system linearised at the midpoint of one step.

    Attributes:
        free_motion: u_B + M_M⁻¹ h_M Δt, shape (n_dofs,).
        inverse_mass: M_M⁻¹.
        contacts: the active contacts, None if there are none.
        free_motion_with: maps W Λ to the free motion with h_M at the velocity (u_B + u_E)/2 of a step with these
            impulses; None if h_M is taken at u_B.
    """

    free_motion: FloatArray
    inverse_mass: InverseMass
    contacts: ActiveContacts | None
    free_motion_with: Callable[[FloatArray], FloatArray] | None = None


@dataclass(frozen=True, eq=False)
class JointErrors:
    """Errors of joints at one position q.

    Attributes:
        residual: residual of the joints [m or rad], shape (n_rows,).
        directions: W of the joints, shape (n_dofs, n_rows); the rate of ``residual`` is Wᵀ u.
    """

    residual: FloatArray
    directions: sp.csc_array[Any]

    @property
    def are_closed(self) -> bool:
        """Whether no joint is open by more than ``MAX_JOINT_ERROR``."""
        return bool(np.abs(self.residual).max(initial=0.0) <= MAX_JOINT_ERROR)


@dataclass(frozen=True, eq=False)
class Overlaps:
    """The contacts that penetrate at one position q, and the metric in which to move them apart.

    Attributes:
        gap: g(q) [m], negative, shape (n_contacts,).
        normals: W_N, the normal columns of W(q): in pieces, one block of one lane per contact, or, with joints, scipy
            CSC.
        inverse_mass: M⁻¹(q), whose blocks are the chunks of ``normals``.
        joints: the errors of joints, which are removed with the penetrations; None if there are no joints.
    """

    gap: FloatArray
    normals: Pieces | sp.csc_array[Any]
    inverse_mass: InverseMass
    joints: JointErrors | None = None


class System(Protocol):
    """The interface of a system to steppers."""

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q after a motion with the constant velocity u for ``seconds`` [s]."""
        ...

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M for a step of ``seconds`` that starts with ``velocity``."""
        ...

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the contacts with g(q) < ``limit``, which is not negative."""
        ...

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return the contacts with g(q) < 0, and the joints.

        Return None if no contact is deeper than ``tolerated`` [m], and there are no joints.
        """
        ...


@dataclass(eq=False)
class MechanicalSystem:
    """A general system, given by the functions of its equations of motion.

    Contacts may have different numbers of rows. Joints are further rows with ξ = 0. They constrain velocities, as
    contacts do, so that positions drift by the error of the step.

    Attributes:
        mass: q ↦ M, shape (n_dofs, n_dofs), symmetric positive definite; its inverse is cached as long as the
            function returns the same array.
        force: (q, u) ↦ h, shape (n_dofs,).
        gap: q ↦ g [m], shape (n_contacts,).
        directions: q ↦ W, shape (n_dofs, n_rows), contact by contact in the order N, T1, T2, then joint by joint.
        friction: μ of each contact, shape (n_contacts,).
        restitution_normal: ε_N of each contact, shape (n_contacts,).
        restitution_tangential: ε_T of each contact, shape (n_contacts,).
        rows_per_contact: 1, 2 or 3, one number for all contacts or one per contact.
        joint_rows: rows of each joint, shape (n_joints,).
        direction_rates: (q, u) ↦ Ẇᵀ u [m/s²], shape (n_rows,), for EventDriven; None if W does not depend on q.
        is_reversible: whether M and W are constant and h depends on q alone. Then the midpoint rule is symmetric, and
            its error in smooth phases has even powers of Δt only, which extrapolation uses.

    Raises:
        ProblemError: if restitution is outside [0, 1], arrays have unequal lengths, or a number of rows is out of
            range.
    """

    mass: Callable[[FloatArray], FloatArray]
    force: Callable[[FloatArray, FloatArray], FloatArray]
    gap: Callable[[FloatArray], FloatArray]
    directions: Callable[[FloatArray], FloatArray]
    friction: ArrayLike
    restitution_normal: ArrayLike
    restitution_tangential: ArrayLike
    rows_per_contact: int | Sequence[int] = 2
    joint_rows: Sequence[int] = ()
    direction_rates: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    is_reversible: bool = False
    _inverse: tuple[FloatArray, FloatArray, InverseMass] | None = field(default=None, init=False, repr=False)
    _active: dict[bytes, tuple[IntArray, ActiveContacts]] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the numbers; ``width`` becomes the largest number of rows of a contact or joint."""
        self.friction = np.atleast_1d(np.asarray(real_numbers(self.friction, "friction"), dtype=np.float64))
        for name in ("restitution_normal", "restitution_tangential"):
            values = np.atleast_1d(np.asarray(real_numbers(getattr(self, name), name), dtype=np.float64))
            if values.shape != self.friction.shape or not ((values >= 0) & (values <= 1)).all():
                raise ProblemError(f"{name} must be {len(self.friction)} numbers between 0 and 1, got {values}.")
            setattr(self, name, values)
        n_contacts = len(self.friction)
        contact_rows = frozen(self.rows_per_contact, np.int64, "rows_per_contact")
        joint_rows = frozen(self.joint_rows, np.int64, "joint_rows")
        if contact_rows.shape not in ((), (n_contacts,)) or not np.isin(contact_rows, (1, 2, 3)).all():
            raise ProblemError(f"rows_per_contact must be 1, 2 or 3, for all or each of {n_contacts} contacts.")
        if joint_rows.ndim != 1 or (joint_rows < 1).any():
            raise ProblemError(f"joint_rows must be positive whole numbers, one per joint, got {self.joint_rows}.")
        self._contact_rows, self._n_joints = np.broadcast_to(contact_rows, (n_contacts,)), len(joint_rows)
        self._row_counts = np.concatenate([self._contact_rows, joint_rows])
        self._first_rows = np.append(0, np.cumsum(self._row_counts))
        self.width = int(self._row_counts.max(initial=1))

    @cached_property
    def has_equal_rows(self) -> bool:
        """Whether all contacts have the same number of rows, and there are no joints."""
        return self._n_joints == 0 and bool((self._contact_rows == self.width).all())

    def with_margin(self, margin: float) -> "MechanicalSystem":
        """Return the system with contacts that count as closed at gaps below ``margin`` [m]."""
        return replace(self, gap=lambda position: self.gap(position) - margin)

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q + u · seconds."""
        return position + seconds * velocity

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M: M(q_M), h(q_M, u_B), and W(q_M) of the contacts with g(q_M) < 0.

        Raises:
            ProblemError: if M is not positive definite there, or M, h, g or W contains NaN or has a shape that does not
                match u and the contacts.
        """
        inverse, sparse_inverse = self._inverse_mass(midpoint)
        free_motion = velocity + inverse @ self._force(midpoint, velocity) * seconds
        gap = self._gaps(midpoint)
        active = gap < 0.0
        if not active.any() and not self._n_joints:
            return StepAssembly(free_motion, sparse_inverse, None)
        rows, contacts = self._active_contacts(active)
        columns = self._directions(midpoint)[:, rows]
        directions = _one_chunk(columns, self.width) if self.has_equal_rows else sp.csc_array(columns)
        gaps = np.append(gap[active], np.zeros(self._n_joints))
        return StepAssembly(free_motion, sparse_inverse, replace(contacts, gap=gaps, directions=directions))

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the contacts with g(q) < ``limit``."""
        gap = self._gaps(position)
        near = gap < limit
        return np.flatnonzero(near), gap[near]

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return the contacts with g(q) < 0, or None if none is deeper than ``tolerated`` [m].

        Raises:
            ProblemError: as ``assemble``, for M, g and W.
        """
        gap = self._gaps(position)
        if not (gap < -tolerated).any():
            return None
        columns = self._directions(position)[:, self._first_rows[: len(gap)]]
        closed = gap < 0.0
        return Overlaps(gap[closed], _one_chunk(columns[:, closed], 1), self._inverse_mass(position)[1])

    def check(self, position: FloatArray, velocity: FloatArray) -> None:
        """Check M, h, g and W at (q, u).

        Raises:
            ProblemError: if M is not positive definite there, or one of them contains NaN or has a shape that does not
                match u and the contacts.
        """
        self._inverse_mass(position)
        self._force(position, velocity)
        self._gaps(position)
        self._directions(position)

    def _force(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        return _checked_values(
            "forces h(q, u)", self.force(position, velocity), velocity.shape, "one for each velocity"
        )

    def _gaps(self, position: FloatArray) -> FloatArray:
        shape = np.asarray(self.friction).shape
        return _checked_values("gaps g(q)", self.gap(position), shape, "one for each contact")

    def _directions(self, position: FloatArray) -> FloatArray:
        shape = (len(position), int(self._first_rows[-1]))
        explanation = "one row for each velocity, and one column for each row of contacts and joints"
        return _checked_values("directions W(q)", self.directions(position), shape, explanation)

    def _inverse_mass(self, position: FloatArray) -> tuple[FloatArray, InverseMass]:
        mass = self.mass(position)
        if self._inverse is None or self._inverse[0] is not mass:
            n_dofs = len(position)
            _checked_values("mass matrix M(q)", mass, (n_dofs, n_dofs), "one row and column for each velocity")
            try:
                root = np.linalg.inv(np.linalg.cholesky(mass))
            except np.linalg.LinAlgError:
                raise ProblemError("the mass matrix M(q) is not positive definite.") from None
            inverse = root.T @ root
            self._inverse = (mass, inverse, InverseMass.create(inverse))
        return self._inverse[1], self._inverse[2]

    def _active_contacts(self, active: NDArray[np.bool_]) -> tuple[IntArray, ActiveContacts]:
        """Return the cached rows and contacts of a set of active contacts, without values that depend on q."""
        pattern = active.tobytes()
        if pattern not in self._active:
            contacts = np.flatnonzero(active).astype(np.int64)
            keys = np.append(contacts, len(active) + np.arange(self._n_joints))
            counts = self._row_counts[keys]
            is_active_row = np.zeros(int(self._first_rows[-1]), dtype=np.bool_)
            restitution = np.zeros(len(is_active_row))
            for key in keys.tolist():
                rows = slice(self._first_rows[key], self._first_rows[key + 1])
                is_active_row[rows] = True
                if key < len(active):
                    restitution[rows] = np.asarray(self.restitution_tangential)[key]
                    restitution[rows.start] = np.asarray(self.restitution_normal)[key]
            active_contacts = ActiveContacts(
                keys,
                np.zeros(len(keys)),
                self._laws(contacts),
                _one_chunk(np.zeros((1, 0)), 1),
                restitution[is_active_row],
                self.width,
                None if self.has_equal_rows else counts,
            )
            if len(self._active) == MAX_PATTERNS:
                del self._active[next(iter(self._active))]
            self._active[pattern] = (np.flatnonzero(is_active_row), active_contacts)
        return self._active[pattern]

    def _laws(self, contacts: IntArray) -> Laws:
        """Return the laws of the contacts with the indices ``contacts``, and of all joints."""
        friction = np.asarray(self.friction)[contacts]
        if self.has_equal_rows:
            return Laws.contacts(friction, self.width, len(contacts))
        counts = self._contact_rows[contacts].tolist()
        parts = [Laws.contacts([mu], count, 1) for mu, count in zip(friction.tolist(), counts, strict=True)]
        return Laws.concatenate([*parts, Laws.joints(int(self._row_counts[len(self._contact_rows) :].sum()))])


def _checked_values(what: str, values: FloatArray, shape: tuple[int, ...], explanation: str) -> FloatArray:
    """Return ``values``; raise ``ProblemError`` if their shape is not the explained one, or they contain NaN."""
    if np.shape(values) != shape:
        raise ProblemError(f"the shape of the {what} is {np.shape(values)}, not {shape}: {explanation}.")
    if np.isnan(values).any():
        raise ProblemError(f"the {what} contain NaN.")
    return values


def _one_chunk(directions: FloatArray, width: int) -> Pieces:
    """Return a dense W as pieces: all degrees of freedom are one chunk, and each contact has one piece."""
    n_dofs, n_rows = directions.shape
    n_blocks = n_rows // width
    values = np.ascontiguousarray(directions.T).reshape(n_blocks, width, n_dofs)
    return Pieces(np.arange(n_blocks + 1), np.zeros(n_blocks, dtype=np.int64), values, 1)
