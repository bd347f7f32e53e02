"""The force laws of the rows of an FCLIB problem, and checks for unsupported laws.

Contacts come first, each with ``spacedim`` rows, beginning with the normal row. Their laws are a unilateral law, the
Coulomb friction that it bounds, and rolling friction if the file has μ_r. Joints follow: a bilateral law for each
column of the file's matrix V (local problem) or G (global problem).

    spacedim 2    N, T                 planar
    spacedim 3    N, T1, T2            spatial
    spacedim 3    N, T, R              planar, with rolling friction
    spacedim 5    N, T1, T2, R1, R2    spatial, with rolling friction
"""

from dataclasses import dataclass

import numpy as np

from ...arrays import FloatArray, IntArray
from ...contact.laws import LawKind, Laws
from ...contact.problem import ContactProblem
from ...errors import ProblemError
from .contents import Contents, GlobalContents, LocalContents


@dataclass(frozen=True)
class ContactLaws:
    """The laws of contacts of one kind.

    Attributes:
        dimension: rows of a contact: 2 or 3 without rolling friction, 3 or 5 with it.
        friction: μ, shape (n_contacts,).
        rolling_friction: μ_r [m], shape (n_contacts,); ``None`` without rolling friction.
    """

    dimension: int
    friction: FloatArray
    rolling_friction: FloatArray | None = None


_ROWS_BY_KINDS = {
    (LawKind.UNILATERAL, LawKind.PLANAR_FRICTION): 2,
    (LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION): 3,
    (LawKind.UNILATERAL, LawKind.PLANAR_FRICTION, LawKind.PLANAR_ROLLING): 3,
    (LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION, LawKind.SPATIAL_ROLLING): 5,
}
"""Rows of a contact by the kinds of its laws."""


def laws_of(contents: LocalContents | GlobalContents) -> Laws:
    """Return the laws of a problem, in the order of its rows.

    Raises:
        ProblemError: if ``spacedim`` is not supported, or a friction coefficient is negative or not finite.
    """
    contacts = _laws_of_contacts(contents)
    return Laws.concatenate([contacts, Laws.joints(contents.n_joints)]) if contents.n_joints else contacts


def _laws_of_contacts(contents: Contents) -> Laws:
    rolling, rows, count = contents.rolling_friction, contents.dimension, len(contents.friction)
    if rolling is None:
        if rows not in (2, 3):
            raise ProblemError(f"spacedim = {rows} must be 2 or 3, the rows of a contact.")
        return Laws.contacts(contents.friction, rows, count)
    if rows not in (3, 5):
        raise ProblemError(f"spacedim = {rows} must be 3 or 5, the rows of a contact with rolling friction.")
    bad = np.flatnonzero(~(np.isfinite(rolling) & (rolling >= 0.0)))
    if len(bad):
        raise ProblemError(f"mu_r[{bad[0]}] = {rolling[bad[0]]} must be finite and not negative.")
    axes = rows // 2
    return Laws.contacts(contents.friction, rows - axes, count).with_rolling(rolling, axes)


def fclib_row_order(problem: ContactProblem) -> IntArray:
    """Return the rows of a problem in the order of FCLIB: those of contacts, then those of joints, shape (n_rows,)."""
    is_joint_row = np.repeat(problem.laws.is_bilateral, problem.laws.row_count)
    return np.argsort(is_joint_row, kind="stable")


def contact_laws_of(problem: ContactProblem) -> ContactLaws:
    """Return the laws of the contacts of a problem.

    Raises:
        ProblemError: if FCLIB does not support the laws. It supports joints, and contacts of one kind with Coulomb
            friction, with or without rolling friction.
    """
    laws, name = problem.laws, problem.name
    if not problem.n_rows:
        raise ProblemError(f"{name!r} has no contacts, so there is nothing to write.")
    if laws.fixed_bound.any():
        law = int(np.argmax(laws.fixed_bound > 0))
        raise ProblemError(f"law {law} of {name!r} has a fixed friction bound; FCLIB supports Coulomb friction only.")
    count = int(laws.is_unilateral.sum())
    if count and not laws.is_friction.any():
        raise ProblemError(
            f"{name!r} has no friction, but every contact of FCLIB has; add friction laws with a coefficient of zero."
        )
    rolling = np.flatnonzero(laws.is_rolling)
    axes, slides = (laws.row_count[at] for at in (rolling, np.maximum(rolling - 1, 0)))
    if (axes != slides).any():
        k = int(np.argmax(axes != slides))
        about = "1 axis" if axes[k] == 1 else f"{axes[k]} axes"
        raise ProblemError(
            f"{name!r} has rolling friction about {about}, but FCLIB supports only as many axes as sliding directions, "
            f"here {slides[k]}."
        )
    if laws.is_rolling.any() and problem.factors is None:
        raise ProblemError(
            f"{name!r} has rolling friction and a Delassus matrix, but FCLIB supports rolling friction only in global "
            "problems; create the problem from its factors."
        )
    found = _contacts_of_one_kind(laws, count)
    if found is None:
        raise ProblemError(
            f"{name!r} mixes laws; FCLIB has contacts of one kind only, each a unilateral law followed by its friction."
        )
    return found


def _contacts_of_one_kind(laws: Laws, count: int) -> ContactLaws | None:
    """Return the laws of ``count`` contacts, with or without joints in between; None if contacts differ in kind."""
    if not count and not laws.is_friction.any():
        return ContactLaws(3, np.zeros(0))
    indices = np.flatnonzero(~laws.is_bilateral)
    if not count or len(indices) % count:
        return None
    members = indices.reshape(count, -1)  # the laws of each contact
    kinds = laws.kind[members]
    dimension = _ROWS_BY_KINDS.get(tuple(LawKind(kind) for kind in kinds[0]))
    is_equal = (kinds == kinds[0]).all() and np.array_equal(laws.partner[members[:, 1]], members[:, 0])
    if dimension is None or not is_equal:
        return None
    friction = laws.friction_coefficient[members]
    return ContactLaws(dimension, friction[:, 1], friction[:, 2] if members.shape[1] == 3 else None)
