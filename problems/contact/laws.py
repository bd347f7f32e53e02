"""The set-valued force laws of a contact problem.

Every law is an inclusion −ξ ∈ N_C(Λ) (Studer & Glocker 2005, equations 28–30) with

    unilateral contact   C = R₀⁺                     1 row
    planar friction      C = [−b, b]                 1 row
    spatial friction     C = {x ∈ R² : ‖x‖ ≤ b}      2 rows
    bilateral            C = R                       1 row
    rolling friction     C = {x ∈ Rᵏ : ‖x‖ ≤ b}      k = 1, 2 or 3 rows

The friction bound is b = a + μ max(Λ_partner, 0). Its fixed part a represents dry friction in a joint. In its Coulomb
part, the partner is a unilateral law. A bilateral law is a row of a joint: ξ = 0, and Λ is free. Kernels represent a
law by its ``ConvexSet``, its rows and its bound.

Rolling friction resists the relative angular velocity ξ_R [rad/s] of two bodies in contact by an impulsive moment
Λ_R [N m s]. It acts about one axis (rolling in the plane, or spinning), two (rolling in space) or three (rolling and
spinning with one bound). Its μ is a length [m]. Sliding and rolling friction share the normal impulse of their contact,
so that Λ lies in both cones, ‖Λ_T‖ ≤ μ Λ_N and ‖Λ_R‖ ≤ μ_r Λ_N (Acary & Bourrier 2021, *Coulomb friction with rolling
resistance as a cone complementarity problem*).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import FloatArray, IntArray, ReadOnlyRecord, check_count, frozen, sealed
from ..errors import ProblemError
from ..representation import html_table
from .matrices.memory import require_memory


class LawKind(IntEnum):
    """The kinds of force law, as files store them."""

    UNILATERAL = 0
    PLANAR_FRICTION = 1
    SPATIAL_FRICTION = 2
    BILATERAL = 3
    PLANAR_ROLLING = 4
    SPATIAL_ROLLING = 5
    ROLLING_AND_SPINNING = 6

    @property
    def description(self) -> str:
        """The kind in words: ``"spatial friction"``."""
        return self.name.lower().replace("_", " ")


class ConvexSet(IntEnum):
    """The form of the set C of a law."""

    HALF_LINE = 0
    LINE = 1
    BALL = 2


HALF_LINE, LINE, BALL = map(int, ConvexSet)
"""Plain numbers, for kernels."""

SET_OF_KIND = np.array([HALF_LINE, BALL, BALL, LINE, BALL, BALL, BALL], dtype=np.int8)
"""Form of the set of each kind of law."""

ROWS_OF_KIND = np.array([1, 1, 2, 1, 1, 2, 3], dtype=np.int64)
"""Number of rows of each kind of law."""

_ROLLING_OF_ROWS = (LawKind.PLANAR_ROLLING, LawKind.SPATIAL_ROLLING, LawKind.ROLLING_AND_SPINNING)

ROLLS_OF_KIND = np.array([kind in _ROLLING_OF_ROWS for kind in LawKind])
"""Whether each kind of law is rolling friction."""

_UNILATERAL, _BILATERAL = map(int, (LawKind.UNILATERAL, LawKind.BILATERAL))
"""Plain numbers: NumPy compares them six times as fast as members of an enumeration."""

FEW_CONTACTS, MANY_CONTACTS = 64, 4096
"""Numbers of contacts of equal friction up to which their laws are cached, in a larger and in a smaller cache."""

BYTES_PER_LAW = 90.0
"""Memory that is needed at least to make a law."""

_KNOWN = "one of " + ", ".join(f"{kind.value} ({kind.description})" for kind in LawKind)
"""The valid kinds, for an error message."""

_FIELDS = {
    "kind": np.int8,
    "first_row": np.int64,
    "friction_coefficient": np.float64,
    "fixed_bound": np.float64,
    "partner": np.int64,
}
"""Type of each array of ``Laws``."""


@dataclass(frozen=True, eq=False)
class Laws(ReadOnlyRecord):
    """The force laws of a problem, one entry for each law, in the order of their rows.

    Attributes:
        kind: ``LawKind`` of each law, shape (n_laws,).
        first_row: first row of each law in c, Λ and ξ, shape (n_laws,). The laws tile the rows without gaps.
        friction_coefficient: μ ≥ 0 of each friction law, μ_r [m] of a rolling one, 0 for all others, shape (n_laws,).
        fixed_bound: a ≥ 0 of each friction law [N s], of a rolling one [N m s], 0 for all others, shape (n_laws,).
        partner: index of the unilateral law whose impulse bounds this friction law, −1 for none, shape (n_laws,).
            A rolling law always has a partner. It directly follows the partner or the partner's sliding law.

    Raises:
        ProblemError: if the arrays are inconsistent; the message names the field, the law and the value.
    """

    kind: NDArray[np.int8]
    first_row: IntArray
    friction_coefficient: FloatArray
    fixed_bound: FloatArray
    partner: IntArray

    equal_laws: ClassVar["Laws | None"] = None
    """The longer list of laws of equal contacts that begins with these laws, if any."""

    def __post_init__(self) -> None:
        for name, dtype in _FIELDS.items():
            array = frozen(getattr(self, name), dtype, f"laws.{name}")
            if array.ndim != 1 or len(array) != len(self.kind):
                required = f"({'n_laws' if name == 'kind' else len(self.kind)},), one entry per law"
                raise ProblemError(f"laws.{name} must have shape {required}; got {array.shape}.")
            object.__setattr__(self, name, array)
        self._check()

    def _check(self) -> None:
        _require((self.kind >= 0) & (self.kind < len(LawKind)), "kind", self.kind, _KNOWN)
        rows = np.cumsum(ROWS_OF_KIND[self.kind]) - ROWS_OF_KIND[self.kind]
        _require(self.first_row == rows, "first_row", self.first_row, "the first row after the previous law")
        for name in ("friction_coefficient", "fixed_bound"):
            values = getattr(self, name)
            _require(np.isfinite(values) & (values >= 0), name, values, "finite and not negative")
            _require((values == 0) | self.is_friction, name, values, "0 for a law without friction")
        partner = self.partner
        _require((partner >= -1) & (partner < len(rows)), "partner", partner, "the index of a law, or -1")
        _require((partner == -1) | self.is_friction, "partner", partner, "-1 for a law without friction")
        is_unilateral = np.append(self.kind == _UNILATERAL, True)  # partner −1 selects the last entry
        _require(is_unilateral[partner], "partner", partner, "the index of a unilateral law")
        has_partner = (partner >= 0) | (self.friction_coefficient == 0)
        _require(has_partner, "friction_coefficient", self.friction_coefficient, "0 for a law without a partner")
        if self.is_rolling.any():
            self._check_rolling()

    def _check_rolling(self) -> None:
        law, partner = np.arange(len(self.kind)), self.partner
        slides_before = self.is_friction & ~self.is_rolling & (partner == law - 1) & (partner >= 0)
        follows = (partner == law - 1) | ((partner == law - 2) & np.append(False, slides_before[:-1]))
        requirement = "the preceding unilateral law, directly or before its sliding law"
        _require(~self.is_rolling | ((partner >= 0) & follows), "partner", partner, requirement)

    @cached_property
    def sets(self) -> NDArray[np.int8]:
        """``ConvexSet`` of each law, shape (n_laws,); a ball of one row is an interval, of two a disc."""
        return sealed(SET_OF_KIND.take(self.kind))

    @cached_property
    def row_count(self) -> IntArray:
        """Number of rows of each law, shape (n_laws,)."""
        return sealed(ROWS_OF_KIND.take(self.kind))

    @cached_property
    def kinds(self) -> frozenset[int]:
        """The values of ``LawKind`` that occur."""
        return frozenset(np.flatnonzero(np.bincount(self.kind)).tolist())

    @cached_property
    def is_friction(self) -> NDArray[np.bool_]:
        """True for friction laws, sliding and rolling, shape (n_laws,)."""
        return sealed((self.kind != _UNILATERAL) & (self.kind != _BILATERAL))

    @cached_property
    def is_rolling(self) -> NDArray[np.bool_]:
        """True for rolling friction, shape (n_laws,)."""
        return sealed(ROLLS_OF_KIND.take(self.kind))

    @cached_property
    def is_unilateral(self) -> NDArray[np.bool_]:
        """True for unilateral laws, shape (n_laws,)."""
        return sealed(self.kind == _UNILATERAL)

    @cached_property
    def is_bilateral(self) -> NDArray[np.bool_]:
        """True for bilateral laws, shape (n_laws,)."""
        return sealed(self.kind == _BILATERAL)

    def friction_bounds(self, impulses: FloatArray) -> FloatArray:
        """Return the friction bound a + μ max(Λ_partner, 0) of every law [N s; N m s for rolling], shape (n_laws,)."""
        normal = np.maximum(impulses[self.first_row[np.maximum(self.partner, 0)]], 0.0) if self.n_laws else np.zeros(0)
        bounds: FloatArray = self.fixed_bound + np.where(self.partner >= 0, self.friction_coefficient * normal, 0.0)
        return bounds

    def friction_norms(self, rows: FloatArray) -> FloatArray:
        """Return the norm over the rows of every friction law, sliding and rolling, shape (n_friction_laws,)."""
        first, count = self.first_row[self.is_friction], self.row_count[self.is_friction]
        squares = rows[first] ** 2
        for row in range(1, int(count.max(initial=1))):
            has_row = count > row
            squares[has_row] += rows[first[has_row] + row] ** 2
        return np.sqrt(squares)

    def counts(self) -> dict[str, int]:
        """Return the number of laws of each kind that occurs: ``{"unilateral": 59, "spatial friction": 59}``."""
        return {LawKind(kind).description: int((self.kind == kind).sum()) for kind in sorted(self.kinds)}

    @property
    def summary(self) -> str:
        """Number of laws of each kind: ``"59 unilateral, 59 spatial friction"``."""
        return ", ".join(f"{count} {kind}" for kind, count in self.counts().items()) or "none"

    def __repr__(self) -> str:
        return f"<Laws: {self.summary}>"

    def _repr_html_(self) -> str:
        facts: dict[str, object] = {"laws": self.summary, "rows": self.n_rows}
        if self.is_friction.any():
            coefficients = self.friction_coefficient[self.is_friction]
            facts["friction coefficients"] = f"{coefficients.min():g} to {coefficients.max():g}"
        return html_table("Force laws", facts)

    @property
    def n_laws(self) -> int:
        """Number of laws."""
        return len(self.kind)

    @property
    def n_joint_rows(self) -> int:
        """Number of bilateral laws, one for each row of the joints."""
        return int(self.is_bilateral.sum())

    @cached_property
    def n_rows(self) -> int:
        """Number of rows, the length of c, Λ and ξ."""
        return int(self.first_row[-1] + ROWS_OF_KIND[self.kind[-1]]) if len(self.kind) else 0

    @staticmethod
    def in_order(
        kind: ArrayLike, friction_coefficient: FloatArray, fixed_bound: FloatArray, partner: IntArray
    ) -> "Laws":
        """Return laws that tile the rows in the order given; the arguments are attributes of ``Laws``.

        Raises:
            ProblemError: if the arguments are inconsistent, as for ``Laws``.
        """
        kinds = frozen(kind, np.int8, "laws.kind")
        rows = ROWS_OF_KIND.take(kinds, mode="clip")  # ``Laws`` reports unknown kinds
        first_row = np.cumsum(np.append(0, rows))[:-1]
        return Laws(kinds, first_row, friction_coefficient, fixed_bound, partner)

    def fresh(self) -> "Laws":
        """Return equal laws that share no memory with these, without checking them again."""
        return self._with_arrays(lambda array: frozen(array, array.dtype))

    def _first(self, n_laws: int) -> "Laws":
        """Return the first laws; their arrays are views of this object's, and their ``equal_laws`` is this object."""
        laws = self._with_arrays(lambda array: array[:n_laws])
        for name in ("sets", "row_count", "is_friction", "is_rolling", "is_unilateral", "is_bilateral"):
            laws.__dict__[name] = getattr(self, name)[:n_laws]
        laws.__dict__.update(equal_laws=self, kinds=self.kinds if n_laws else frozenset())
        return laws

    def _with_arrays(self, change: Callable[[NDArray[Any]], NDArray[Any]]) -> "Laws":
        """Return laws with changed arrays, which are valid by construction."""
        laws = object.__new__(Laws)
        for name in _FIELDS:
            object.__setattr__(laws, name, change(getattr(self, name)))
        return laws

    def subset(self, laws: IntArray, partner: IntArray) -> "Laws":
        """Return the laws of these indices, in the order given, with new partners; an index may occur twice."""
        return Laws.in_order(self.kind[laws], self.friction_coefficient[laws], self.fixed_bound[laws], partner)

    @staticmethod
    def contacts(friction: ArrayLike, dim: int, n_contacts: int) -> "Laws":
        """Return the laws of ``n_contacts`` contacts with rows N (dim 1), N, T (dim 2) or N, T1, T2 (dim 3).

        Args:
            friction: μ, one number or shape (n_contacts,); ignored for dim 1.
            dim: rows per contact, 1, 2 or 3.
            n_contacts: number of contacts.

        Raises:
            ProblemError: if ``dim``, μ or ``n_contacts`` is not valid.
        """
        if not isinstance(dim, int | np.integer) or dim not in (1, 2, 3):
            raise ProblemError(f"dim must be 1 (frictionless), 2 (planar) or 3 (spatial), got {dim!r}.")
        check_count("n_contacts", n_contacts)
        mu = np.float64(friction) if type(friction) is float else frozen(friction, np.float64, "friction")
        if mu.ndim == 0 and 0.0 <= mu < np.inf:
            make = _some_equal_laws if n_contacts <= MANY_CONTACTS else _equal_laws
            make = _few_equal_laws if n_contacts <= FEW_CONTACTS else make
            return make(float(mu) + 0.0, int(dim), int(n_contacts))  # −0 would change the digest of problems
        try:
            coefficient = np.broadcast_to(mu, (n_contacts,))
        except ValueError:
            required = f"one number or have shape ({n_contacts},)"
            raise ProblemError(f"friction must be {required}, got shape {np.shape(friction)}.") from None
        given = mu.ravel()[:n_contacts]
        invalid = np.flatnonzero(~(np.isfinite(given) & (given >= 0)))
        if len(invalid):
            raise ProblemError(f"friction[{invalid[0]}] = {given[invalid[0]]} must be finite and not negative.")
        return _laws_of_contacts(coefficient, dim)

    @staticmethod
    def joints(n_rows: int) -> "Laws":
        """Return ``n_rows`` bilateral laws, one for each row of the joints."""
        check_count("n_rows", n_rows)
        require_memory(BYTES_PER_LAW * n_rows, f"the laws of {n_rows:,} rows of joints", "make fewer joints")
        zeros = np.zeros(n_rows)
        return Laws.in_order(np.full(n_rows, LawKind.BILATERAL), zeros, zeros, np.full(n_rows, -1))

    @staticmethod
    def concatenate(parts: Iterable["Laws"]) -> "Laws":
        """Return the laws of all parts, concatenated; raise ``ProblemError`` if there is no part."""
        given, parts = parts, tuple(parts) if isinstance(parts, Iterable) else ()
        if not parts or not all(isinstance(part, Laws) for part in parts):
            raise ProblemError(f"Laws.concatenate takes a list of at least one Laws, got {given!r:.60}.")
        first = np.cumsum([0, *(part.n_laws for part in parts)])
        partners = [
            np.where(part.partner >= 0, part.partner + offset, -1) for part, offset in zip(parts, first, strict=False)
        ]
        return Laws.in_order(
            np.concatenate([part.kind for part in parts]),
            np.concatenate([part.friction_coefficient for part in parts]),
            np.concatenate([part.fixed_bound for part in parts]),
            np.concatenate(partners),
        )

    def with_rolling(self, friction: ArrayLike, n_rows: int) -> "Laws":
        """Return these laws with rolling friction added to each contact, after its other laws.

        Args:
            friction: μ_r [m], one number or one for each unilateral law.
            n_rows: number of rolling axes, 1, 2 or 3.

        Raises:
            ProblemError: if ``n_rows`` is not 1, 2 or 3, the laws already have rolling friction, or ``friction`` has
                another shape.
        """
        if not isinstance(n_rows, int | np.integer) or n_rows not in (1, 2, 3):
            raise ProblemError(f"rolling friction has 1, 2 or 3 rows, got {n_rows!r}.")
        if self.is_rolling.any():
            raise ProblemError("the laws already have rolling friction; add it to laws without it.")
        normal = np.flatnonzero(self.is_unilateral)
        follower = np.append(self.partner[1:], -1)[normal] == normal
        insertion = normal + 1 + follower  # index before which each rolling law is inserted
        new_index = np.arange(self.n_laws) + np.searchsorted(insertion, np.arange(self.n_laws), side="right")
        values = frozen(friction, np.float64, "friction")
        if values.shape not in ((), (1,), normal.shape):
            raise ProblemError(
                f"friction is one number, or one for each of the {len(normal)} unilateral laws, "
                f"got shape {values.shape}."
            )
        return Laws.in_order(
            np.insert(self.kind, insertion, _ROLLING_OF_ROWS[n_rows - 1]),
            np.insert(self.friction_coefficient, insertion, np.broadcast_to(values, normal.shape)),
            np.insert(self.fixed_bound, insertion, 0.0),
            np.insert(np.where(self.partner >= 0, new_index[self.partner], -1), insertion, new_index[normal]),
        )


def _laws_of_contacts(coefficient: FloatArray, dim: int) -> Laws:
    """Return one contact for each μ, with rows N (dim 1), N, T (dim 2) or N, T1, T2 (dim 3)."""
    n_contacts = len(coefficient)
    n_laws = n_contacts if dim == 1 else 2 * n_contacts
    require_memory(BYTES_PER_LAW * n_laws, f"the laws of {n_contacts:,} contacts", "make fewer contacts")
    zeros, none = np.zeros(n_contacts), np.full(n_contacts, -1)
    if dim == 1:
        return Laws.in_order(np.zeros(n_contacts, dtype=np.int8), zeros, zeros, none)
    mu = np.column_stack([zeros, coefficient]).ravel()
    partner = np.column_stack([none, 2 * np.arange(n_contacts)]).ravel()
    return Laws.in_order(np.tile([0, dim - 1], n_contacts), mu, np.zeros(2 * n_contacts), partner)


def _equal_laws(friction: float, dim: int, n_contacts: int) -> Laws:
    """Return contacts of one μ as the first part of a longer list, which has been validated before."""
    capacity = max(FEW_CONTACTS, 1 << (n_contacts - 1).bit_length()) if n_contacts else FEW_CONTACTS
    return _many_equal_laws(friction, dim, capacity)._first(n_contacts if dim == 1 else 2 * n_contacts)


_few_equal_laws, _some_equal_laws = (lru_cache(maxsize=size)(_equal_laws) for size in (256, 64))
"""Return the same object for the same arguments, so that its layout is computed only once."""


@lru_cache(maxsize=16)
def _many_equal_laws(friction: float, dim: int, n_contacts: int) -> Laws:
    """Return contacts of one μ, the same object for the same arguments."""
    return _laws_of_contacts(np.broadcast_to(friction, n_contacts), dim)


def _require(holds: NDArray[np.bool_], field: str, values: NDArray[Any], requirement: str) -> None:
    """Raise a ``ProblemError`` that names the first law for which ``holds`` is false."""
    if not holds.all():
        law = int(np.argmin(holds))
        raise ProblemError(f"laws.{field}[{law}] = {values[law]} must be {requirement}.")
