"""Mechanical systems with unilateral contacts, as time stepping sees them.

M(q) u̇ = h(q, u) + W(q) λ, q̇ = u, with gaps g(q) and set-valued laws between λ and the relative velocities Wᵀu
(Studer & Glocker 2005, [1–6]). A stepper needs of a system one ``StepAssembly`` per step.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arrays import FloatArray, IntArray
from ...contact.factors import InverseMass
from ...contact.laws import Laws
from ...contact.matrices.pieces import Pieces
from ...errors import ProblemError


@dataclass(frozen=True, eq=False)
class ActiveContacts:
    """The contacts of one step, those with g(q_M) < 0.

    Attributes:
        keys: identity of each contact, ascending, shape (n_contacts,); a contact keeps its key from step to step.
        gap: g(q_M) [m], shape (n_contacts,).
        laws: their force laws, ``rows_per_contact`` rows each.
        directions: W at the midpoint, shape (n_dofs, n_rows), in pieces, one block a contact.
        restitution: ε of each row, shape (n_rows,).
        rows_per_contact: 1, 2 or 3.
    """

    keys: IntArray
    gap: FloatArray
    laws: Laws
    directions: Pieces
    restitution: FloatArray
    rows_per_contact: int


@dataclass(frozen=True, eq=False)
class StepAssembly:
    """A system linearised at the midpoint of one step.

    Attributes:
        free_motion: u_B + M_M⁻¹ h_M Δt, shape (n_dofs,).
        inverse_mass: M_M⁻¹.
        contacts: the active contacts, None if there are none.
    """

    free_motion: FloatArray
    inverse_mass: InverseMass
    contacts: ActiveContacts | None


@dataclass(frozen=True, eq=False)
class Overlaps:
    """The contacts that penetrate at one position q, and the metric in which to move them apart.

    Attributes:
        gap: g(q) [m], negative, shape (n_contacts,).
        normals: W_N, the normal columns of W(q), in pieces, one block of one lane a contact.
        inverse_mass: M⁻¹(q), whose blocks are the chunks of ``normals``.
    """

    gap: FloatArray
    normals: Pieces
    inverse_mass: InverseMass


class System(Protocol):
    """What a stepper needs of a system."""

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q + u · seconds."""
        ...

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M for a step of ``seconds`` that begins with ``velocity``."""
        ...

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the contacts with g(q) < ``limit``, which is not negative."""
        ...

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return the contacts with g(q) < 0, or None if none of them is deeper than ``tolerated`` [m]."""
        ...


@dataclass(eq=False)
class MechanicalSystem:
    """A general system, given by the functions of its equations of motion.

    Attributes:
        mass: q ↦ M, shape (n_dofs, n_dofs), symmetric positive definite; its inverse is kept for as long as the
            function returns the same array.
        force: (q, u) ↦ h, shape (n_dofs,).
        gap: q ↦ g [m], shape (n_contacts,).
        directions: q ↦ W, shape (n_dofs, rows_per_contact · n_contacts), contact by contact in the order N, T1, T2.
        friction: μ of each contact, shape (n_contacts,).
        restitution_normal: ε_N of each contact, shape (n_contacts,).
        restitution_tangential: ε_T of each contact, shape (n_contacts,).
        rows_per_contact: 1, 2 or 3.
        direction_rates: (q, u) ↦ Ẇᵀ u [m/s²], shape (n_rows,), for EventDriven; None where W does not depend on
            q.
        is_reversible: whether M and W are constant and h depends on q alone. The midpoint rule is symmetric then, and
            its error in smooth phases has even powers of Δt only, which extrapolation makes use of.

    Raises:
        ProblemError: for restitution outside [0, 1], or arrays of unequal length.
    """

    mass: Callable[[FloatArray], FloatArray]
    force: Callable[[FloatArray, FloatArray], FloatArray]
    gap: Callable[[FloatArray], FloatArray]
    directions: Callable[[FloatArray], FloatArray]
    friction: ArrayLike
    restitution_normal: ArrayLike
    restitution_tangential: ArrayLike
    rows_per_contact: int = 2
    direction_rates: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    is_reversible: bool = False
    _inverse: tuple[FloatArray, FloatArray, InverseMass] | None = field(default=None, init=False, repr=False)
    _laws: dict[bytes, tuple[IntArray, IntArray, Laws, FloatArray]] = field(
        default_factory=dict, init=False, repr=False
    )

    def __post_init__(self) -> None:
        self.friction = np.atleast_1d(np.asarray(self.friction, dtype=np.float64))
        for name in ("restitution_normal", "restitution_tangential"):
            values = np.atleast_1d(np.asarray(getattr(self, name), dtype=np.float64))
            if values.shape != self.friction.shape or not ((values >= 0) & (values <= 1)).all():
                raise ProblemError(f"{name} must be {len(self.friction)} numbers between 0 and 1, got {values}.")
            setattr(self, name, values)

    def move(self, position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
        """Return q + u · seconds."""
        return position + seconds * velocity

    def assemble(self, midpoint: FloatArray, velocity: FloatArray, seconds: float) -> StepAssembly:
        """Linearise at q_M: M(q_M), h(q_M, u_B), and W(q_M) of the contacts with g(q_M) < 0.

        Raises:
            ProblemError: if M is not positive definite there, or M, h, g or W has another shape than u and the contacts
                ask for, or holds NaN.
        """
        inverse, sparse_inverse = self._inverse_mass(midpoint)
        free_motion = velocity + inverse @ self._force(midpoint, velocity) * seconds
        gap = self._gaps(midpoint)
        active = gap < 0.0
        if not active.any():
            return StepAssembly(free_motion, sparse_inverse, None)
        keys, rows, laws, restitution = self._active_laws(active)
        directions = _one_chunk(self._directions(midpoint)[:, rows], self.rows_per_contact)
        contacts = ActiveContacts(keys, gap[active], laws, directions, restitution, self.rows_per_contact)
        return StepAssembly(free_motion, sparse_inverse, contacts)

    def gaps_below(self, position: FloatArray, limit: float) -> tuple[IntArray, FloatArray]:
        """Return keys, ascending, and gaps [m] of the contacts with g(q) < ``limit``."""
        gap = self._gaps(position)
        near = gap < limit
        return np.flatnonzero(near), gap[near]

    def overlaps(self, position: FloatArray, tolerated: float) -> Overlaps | None:
        """Return the contacts with g(q) < 0, or None if none of them is deeper than ``tolerated`` [m].

        Raises:
            ProblemError: as ``assemble``, for M, g and W.
        """
        gap = self._gaps(position)
        if not (gap < -tolerated).any():
            return None
        columns = self._directions(position)[:, :: self.rows_per_contact]
        closed = gap < 0.0
        return Overlaps(gap[closed], _one_chunk(columns[:, closed], 1), self._inverse_mass(position)[1])

    def check(self, position: FloatArray, velocity: FloatArray) -> None:
        """Check M, h, g and W at (q, u).

        Raises:
            ProblemError: if M is not positive definite there, or one of them has another shape than u and the contacts
                ask for, or holds NaN.
        """
        self._inverse_mass(position)
        self._force(position, velocity)
        self._gaps(position)
        self._directions(position)

    def _force(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        return _of_shape("forces h(q, u)", self.force(position, velocity), velocity.shape, "one for each velocity")

    def _gaps(self, position: FloatArray) -> FloatArray:
        shape = np.asarray(self.friction).shape
        return _of_shape("gaps g(q)", self.gap(position), shape, "one for each contact")

    def _directions(self, position: FloatArray) -> FloatArray:
        shape = (len(position), self.rows_per_contact * len(np.asarray(self.friction)))
        why = f"one row for each velocity, and {self.rows_per_contact} columns for each contact"
        return _of_shape("directions W(q)", self.directions(position), shape, why)

    def _inverse_mass(self, position: FloatArray) -> tuple[FloatArray, InverseMass]:
        mass = self.mass(position)
        if self._inverse is None or self._inverse[0] is not mass:
            n_dofs = len(position)
            _of_shape("mass matrix M(q)", mass, (n_dofs, n_dofs), "one row and column for each velocity")
            try:
                root = np.linalg.inv(np.linalg.cholesky(mass))
            except np.linalg.LinAlgError:
                raise ProblemError("the mass matrix M(q) is not positive definite.") from None
            inverse = root.T @ root
            self._inverse = (mass, inverse, InverseMass.create(inverse))
        return self._inverse[1], self._inverse[2]

    def _active_laws(self, active: NDArray[np.bool_]) -> tuple[IntArray, IntArray, Laws, FloatArray]:
        """Keys, rows, laws and restitution of a set of active contacts; few sets recur, so each is kept."""
        pattern = active.tobytes()
        if pattern not in self._laws:
            width = self.rows_per_contact
            keys = np.flatnonzero(active).astype(np.int64)
            rows = (width * keys[:, None] + np.arange(width)).ravel()
            laws = Laws.contacts(np.asarray(self.friction)[active], width, len(keys))
            restitution = np.repeat(np.asarray(self.restitution_tangential)[active], width)
            restitution[::width] = np.asarray(self.restitution_normal)[active]
            self._laws[pattern] = (keys, rows, laws, restitution)
        return self._laws[pattern]


def _of_shape(what: str, values: FloatArray, shape: tuple[int, ...], why: str) -> FloatArray:
    """Return ``values`` if they have the shape that they must have, and are numbers."""
    if np.shape(values) != shape:
        raise ProblemError(f"the shape of the {what} is {np.shape(values)}, not {shape}: {why}.")
    if np.isnan(values).any():
        raise ProblemError(f"NaN is among the {what}.")
    return values


def _one_chunk(directions: FloatArray, width: int) -> Pieces:
    """Return a dense W as pieces: all degrees of freedom are one chunk, and each contact has one piece."""
    n_dofs, n_rows = directions.shape
    n_blocks = n_rows // width
    values = np.ascontiguousarray(directions.T).reshape(n_blocks, width, n_dofs)
    return Pieces(np.arange(n_blocks + 1), np.zeros(n_blocks, dtype=np.int64), values, 1)
