"""The contact problem: one time-stepping inclusion, as an immutable object.

Find the impulses Λ [N s] with

    −(G Λ + c)_i ∈ N_{C_i}(Λ_i)      for every law i,      ξ = G Λ + c,

where G [1/kg] is the Delassus matrix, c [m/s] the free velocity and C_i the set of law i (see ``laws``). G is given
either as a matrix or by its factors, G = Wᵀ M⁻¹ W (Studer & Glocker 2005, equations 26–30).
"""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType, UnionType
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..arrays import FloatArray, ReadOnlyRecord, finite_vector, frozen, read_only, real_numbers, real_vector, sealed
from ..engine_model import EngineModel
from ..errors import ProblemError
from ..representation import counted, html_table
from .answer import Answer
from .blocks import BlockLayout, layout_of
from .laws import Laws
from .matrices.accurate import accurate_over_factors, accurate_over_matrix
from .matrices.delassus import DelassusBlocks, blocks_from_matrix, blocks_from_pieces, diagonal_of
from .matrices.factors import Factors
from .matrices.pieces import Pieces
from .matrices.symmetric import checked_delassus
from .matrices.user_matrices import read_only_copy, sparse_arrays

FREE_FALL = "free_fall"
"""The key of the provenance for the velocity that free bodies gain in the problem's time step [m/s]."""

UNNAMED = "unnamed"
"""The default name of a problem."""


@dataclass(frozen=True, eq=False, repr=False)
class ContactProblem(ReadOnlyRecord):
    """One frictional contact problem; create it with ``from_delassus`` or ``from_factors``.

    Attributes:
        free_velocity: c [m/s], shape (n_rows,).
        laws: the force laws, which tile the rows.
        matrix: G [1/kg] as given, or ``None`` if the factors are given.
        factors: W, M⁻¹ and the free motion, or ``None`` if G is given.
        name: name of the problem in tables and files.
        provenance: origin of the problem (scene, step, seed, …).
        answer: the known parts of the solution, or ``None``.
        allow_asymmetric: whether G may differ from Gᵀ (public data sometimes does).
        keys: name of each contact, the same in all steps of a sequence; empty if contacts have no names.
        engine: the model that an engine solved in this step, or ``None`` if it is not known.

    Raises:
        ProblemError: if a field has the wrong shape or a value that is not finite, or both or neither of ``matrix`` and
            ``factors`` are given.
    """

    free_velocity: FloatArray
    laws: Laws
    matrix: sp.csr_array | None = None
    factors: Factors | None = None
    name: str = UNNAMED
    provenance: Mapping[str, str | int | float] = field(default_factory=dict)
    answer: Answer | None = None
    allow_asymmetric: bool = False
    keys: tuple[str, ...] = ()
    engine: EngineModel | None = None

    def __post_init__(self) -> None:
        _require_type("laws", self.laws, Laws, "Laws, as from Laws.contacts(mu, dim, n_contacts)")
        _require_type("name", self.name, str, "a string")
        _require_type("provenance", self.provenance, Mapping, "a dictionary")
        _require_type("allow_asymmetric", self.allow_asymmetric, bool | np.bool_, "True or False")
        free_velocity = finite_vector(self.free_velocity, "c", self.laws.n_rows)
        object.__setattr__(self, "free_velocity", sealed(free_velocity.copy()))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))
        if (self.matrix is None) == (self.factors is None):
            raise ProblemError("a contact problem needs either G or the factors W and M⁻¹, and not both.")
        if self.matrix is not None:
            object.__setattr__(self, "matrix", checked_delassus(self.matrix, self.n_rows, self.allow_asymmetric))
        if self.factors is not None:
            _require_type("factors", self.factors, Factors, "Factors, as from Factors.create(W, inverse_mass)")
        if self.factors is not None and self.factors.n_rows != self.laws.n_rows:
            raise ProblemError(f"W has {self.factors.n_rows} columns but the laws have {self.laws.n_rows} rows.")
        if self.answer is not None:
            _require_type("answer", self.answer, Answer, "an Answer, as Answer(impulses=...)")
            self.answer.check(self.laws.n_rows)
        if not isinstance(self.keys, tuple) or self.keys:
            _check_keys(self.keys, self.n_contacts)
            object.__setattr__(self, "keys", tuple(self.keys))
        if self.engine is not None:
            _require_type("engine", self.engine, EngineModel, "an EngineModel, as from from_mujoco(...).problem.engine")
        if self.engine is not None and self.engine.n_rows != self.laws.n_rows:
            raise ProblemError(f"the engine's model has {self.engine.n_rows} impulses for {self.laws.n_rows} rows.")

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "provenance": dict(self.provenance)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        super().__setstate__({**state, "provenance": MappingProxyType(state["provenance"])})

    def __repr__(self) -> str:
        joints, rows = self.laws.n_joint_rows, counted(self.n_rows, "row")
        counts = [counted(self.n_contacts - joints, "contact"), f"{rows}, {joints} of joints" if joints else rows]
        return f"<ContactProblem {self.name!r}: {', '.join(counts)}, holds {self._form}>"

    def _repr_html_(self) -> str:
        counts = {"contacts": self.n_contacts - self.laws.n_joint_rows, "rows": self.n_rows}
        facts = {**counts, "laws": self.laws.summary, "holds": self._form}
        return html_table(f"Contact problem {self.name}", {**facts, **self.provenance})

    @property
    def _form(self) -> str:
        return "G" if self.factors is None else "W and M⁻¹"

    @staticmethod
    def from_delassus(
        delassus: Any,
        free_velocity: ArrayLike,
        friction: ArrayLike | None = None,
        dim: int | None = None,
        *,
        laws: Laws | None = None,
        **attributes: Any,
    ) -> "ContactProblem":
        """Return the problem with Delassus matrix G.

        Args:
            delassus: G [1/kg], dense or scipy sparse, shape (n_rows, n_rows), symmetric positive semidefinite. A
                float32 matrix may be asymmetric by its rounding and is replaced by (G + Gᵀ)/2.
            free_velocity: c [m/s], shape (n_rows,).
            friction: μ, one number or one for each contact; 0 if None.
            dim: rows per contact: 1 (N), 2 (N, T) or 3 (N, T1, T2); 3 if None.
            laws: any mixture of laws, instead of ``friction`` and ``dim``.
            attributes: name, provenance, answer, allow_asymmetric and keys, see ``ContactProblem``.

        Raises:
            ProblemError: if an argument has the wrong shape or a value that is not finite, G is not symmetric positive
                semidefinite, μ is negative, or ``laws`` is given together with ``friction`` or ``dim``.
        """
        c = _as_vector(free_velocity, "c")
        return ContactProblem(c, _laws_of(c, friction, dim, laws), matrix=delassus, **attributes)

    @staticmethod
    def from_factors(
        force_directions: Any,
        inverse_mass: Any,
        free_velocity: ArrayLike,
        friction: ArrayLike | None = None,
        dim: int | None = None,
        *,
        laws: Laws | None = None,
        free_motion: ArrayLike | None = None,
        **attributes: Any,
    ) -> "ContactProblem":
        """Return the problem with G = Wᵀ M⁻¹ W, assembled on demand only.

        Args:
            force_directions: W, dense or scipy sparse, shape (n_dofs, n_rows).
            inverse_mass: M⁻¹, its diagonal of shape (n_dofs,), or a (block diagonal) matrix, dense or sparse.
            free_velocity: c [m/s], shape (n_rows,).
            friction: μ, one number or one for each contact; 0 if None.
            dim: rows per contact: 1 (N), 2 (N, T) or 3 (N, T1, T2); 3 if None.
            laws: any mixture of laws, instead of ``friction`` and ``dim``.
            free_motion: u_B + M⁻¹ h Δt with forces h, the velocity without contacts, shape (n_dofs,); optional.
            attributes: name, provenance, answer and keys, see ``ContactProblem``.

        Raises:
            ProblemError: if an argument has the wrong shape or a value that is not finite, M⁻¹ is not positive
                definite, μ is negative, or ``laws`` is given together with ``friction`` or ``dim``.
        """
        c = _as_vector(free_velocity, "c")
        factors = Factors.create(force_directions, inverse_mass, free_motion)
        return ContactProblem(c, _laws_of(c, friction, dim, laws), factors=factors, **attributes)

    @property
    def n_rows(self) -> int:
        """Number of rows, the length of c, Λ and ξ."""
        return len(self.free_velocity)

    @property
    def n_contacts(self) -> int:
        """Number of blocks: a unilateral law with its friction, a lone friction law or a bilateral law counts once."""
        return self.layout.n_blocks

    @property
    def free_fall(self) -> float:
        """Velocity that free bodies gain in the time step of the problem [m/s]; 0 if unknown."""
        speed = self.provenance.get(FREE_FALL, 0.0)
        return float(speed) if isinstance(speed, int | float) and 0.0 < speed < np.inf else 0.0

    @cached_property
    def layout(self) -> BlockLayout:
        """The laws in blocks of equal, padded width, for kernels."""
        return layout_of(self.laws)

    def delassus_blocks(self) -> DelassusBlocks:
        """Return G in padded block rows, assembled at the first call and cached."""
        return self._delassus_blocks

    @cached_property
    def _delassus_blocks(self) -> DelassusBlocks:
        if self.matrix is not None:
            return blocks_from_matrix(self.matrix, self.layout)
        return blocks_from_pieces(self.factor_pieces())

    def factor_pieces(self) -> Pieces:
        """Return W̃ = Sᵀ W, with M⁻¹ = S Sᵀ, in pieces, computed at the first call and cached.

        Raises:
            ProblemError: if the problem holds G only.
        """
        return self._factor_pieces

    @cached_property
    def _factor_pieces(self) -> Pieces:
        if self.factors is None:
            raise ProblemError(f"{self.name!r} holds G only; its factors W and M⁻¹ are not known.")
        return self.factors.scaled_pieces(self.layout)

    def delassus(self) -> sp.csr_array:
        """Return G [1/kg], a read-only scipy CSR array, (n_rows, n_rows), assembled at the first call and cached."""
        return self.matrix if self.matrix is not None else self._assembled

    @cached_property
    def _assembled(self) -> sp.csr_array:
        return self.delassus_blocks().to_csr(self.layout)

    @cached_property
    def delassus_diagonal(self) -> FloatArray:
        """Diagonal of G [1/kg], shape (n_rows,), computed without assembling G."""
        diagonal = self._diagonal_over_factors() if self.matrix is None else diagonal_of(self.matrix)
        read_only(diagonal)
        return diagonal

    def _diagonal_over_factors(self) -> FloatArray:
        diagonal = None if self.factors is None else self.factors.delassus_diagonal()
        return self.layout.rows_of(self.factor_pieces().square_sums().reshape(-1)) if diagonal is None else diagonal

    def relative_velocity(self, impulses: ArrayLike) -> FloatArray:
        """Return ξ = G Λ + c [m/s], shape (n_rows,); raise ``ProblemError`` if Λ has another shape."""
        impulses = real_vector(impulses, "impulses", self.n_rows)
        if self.factors is not None:
            return self.factors.delassus_times(impulses) + self.free_velocity
        assert self.matrix is not None
        velocity: FloatArray = self.matrix @ impulses + self.free_velocity
        return velocity

    def accurate_velocity(self, impulses: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return ξ = G Λ + c [m/s], computed in twice the working precision, and a bound on its error.

        Returns:
            ξ [m/s], rounded to double precision, and a bound on the remaining error [m/s], both of shape (n_rows,); see
            ``matrices.accurate``.

        Raises:
            ProblemError: if Λ has another shape.
        """
        impulses = real_vector(impulses, "impulses", self.n_rows)
        if self.factors is not None:
            factors = self.factors.force_directions, self.factors.inverse_mass.matrix
            return accurate_over_factors(*factors, self.free_velocity, impulses)
        assert self.matrix is not None
        return accurate_over_matrix(self.matrix, self.free_velocity, impulses)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the numbers that define the problem: G or its factors, c, the laws, and the engine's model."""
        sha = hashlib.sha256(b"proxbench contact problem 1")
        for label, array in self._labelled_arrays():
            sha.update(f"{label}:{array.dtype.str}:{array.shape};".encode())
            sha.update(np.ascontiguousarray(array).tobytes())
        return sha.hexdigest()

    def _labelled_arrays(self) -> list[tuple[str, np.ndarray[Any, Any]]]:
        laws = self.laws
        arrays: list[tuple[str, np.ndarray[Any, Any]]] = [
            ("c", self.free_velocity),
            ("kind", laws.kind),
            ("mu", laws.friction_coefficient),
            ("a", laws.fixed_bound),
            ("partner", laws.partner),
        ]
        arrays += sparse_arrays("G", self.matrix) if self.factors is None else self.factors.labelled_arrays()
        return arrays + ([] if self.engine is None else list(self.engine.labelled_arrays().items()))

    def renamed(self, name: str, **provenance: str | int | float) -> "ContactProblem":
        """Return the same problem under another name, with ``provenance`` added.

        Raises:
            ProblemError: if the name is not a string.
        """
        _require_type("name", name, str, "a string")
        return self._described(name=name, provenance={**self.provenance, **provenance})

    def with_free_velocity(self, free_velocity: ArrayLike) -> "ContactProblem":
        """Return the problem with a new c [m/s], shape (n_rows,), and a matching engine model, without an answer.

        Raises:
            ProblemError: if c has the wrong shape or a value that is not finite.
        """
        c = finite_vector(free_velocity, "c", self.n_rows)
        engine = None if self.engine is None else self.engine.shifted(c - self.free_velocity)
        return replace(self, free_velocity=c, answer=None, engine=engine)

    def answered(self, answer: Answer | None, **provenance: str | int | float) -> "ContactProblem":
        """Return the same problem with a new known answer, and ``provenance`` added.

        Raises:
            ProblemError: if ``answer`` is not an ``Answer``, or does not fit the rows of the problem.
        """
        if answer is not None:
            _require_type("answer", answer, Answer, "an Answer, as Answer(impulses=...)")
        return self._described(answer=answer, provenance={**self.provenance, **provenance})

    def keyed(self, keys: Sequence[str]) -> "ContactProblem":
        """Return the same problem with names for its contacts, which identify them in all steps of a sequence.

        Raises:
            ProblemError: unless there is one name for each contact, and all names differ.
        """
        _check_keys(keys, self.n_contacts)
        return self._described(keys=tuple(keys))

    def anonymous(self) -> "ContactProblem":
        """Return the same problem without name, provenance, answer and keys."""
        return self._described(name="problem", provenance={}, answer=None, keys=())

    def fresh(self) -> "ContactProblem":
        """Return an equal problem with copies of all its numbers, except the answer, and without assembled matrices."""
        return self._described(
            free_velocity=frozen(self.free_velocity, np.float64),
            laws=self.laws.fresh(),
            matrix=None if self.matrix is None else read_only_copy(self.matrix),
            factors=None if self.factors is None else self.factors.fresh(),
            engine=None if self.engine is None else self.engine.fresh(),
        )

    def _described(self, **changes: Any) -> "ContactProblem":
        """Return a copy with changed fields, without checking the numbers again; the changes must keep them valid."""
        other = object.__new__(ContactProblem)
        values = {item.name: getattr(self, item.name) for item in fields(self)} | changes
        values["provenance"] = MappingProxyType(dict(values["provenance"]))
        for name, value in values.items():
            object.__setattr__(other, name, value)
        if other.answer is not None:
            other.answer.check(other.n_rows)
        return other


def _as_vector(values: ArrayLike, name: str) -> FloatArray:
    vector = np.asarray(real_numbers(values, name), dtype=np.float64)
    if vector.ndim != 1:
        raise ProblemError(f"{name} must be a vector, got shape {vector.shape}.")
    return vector


def _check_keys(keys: Sequence[str], n_contacts: int) -> None:
    if not isinstance(keys, Sequence) or isinstance(keys, str) or not all(isinstance(key, str) for key in keys):
        raise ProblemError(f"`keys` must be a sequence of strings, one for each contact, got {keys!r:.60}.")
    if len(keys) != n_contacts:
        raise ProblemError(f"`keys` must name each of {counted(n_contacts, 'contact')}, got {len(keys)}.")
    repeated = [key for key, count in Counter(keys).items() if count > 1]
    if repeated:
        raise ProblemError(f"`keys` has {repeated[0]!r} more than once; give each contact its own key.")


def _laws_of(free_velocity: FloatArray, friction: ArrayLike | None, dim: int | None, laws: Laws | None) -> Laws:
    """Return ``laws``, or the laws of contacts with ``friction`` and ``dim`` if ``laws`` is None."""
    if laws is None:
        return _contact_laws(free_velocity, 0.0 if friction is None else friction, 3 if dim is None else dim)
    _require_type("laws", laws, Laws, "Laws, as from Laws.contacts(mu, dim, n_contacts)")
    for name, value in (("friction", friction), ("dim", dim)):
        if value is not None:
            raise ProblemError(f"{name} has no effect if laws are given; omit it, or give friction and dim only.")
    return laws


def _require_type(name: str, value: object, kind: type | UnionType, expected: str) -> None:
    if not isinstance(value, kind):
        raise ProblemError(f"{name} must be {expected}; got a value of type {type(value).__name__}.")


def _contact_laws(free_velocity: FloatArray, friction: ArrayLike, dim: int) -> Laws:
    is_dim = isinstance(dim, int | np.integer) and dim in (1, 2, 3)
    if is_dim and len(free_velocity) % dim:
        raise ProblemError(
            f"c has {len(free_velocity)} rows, which is not a multiple of dim = {dim}; give {dim} rows per contact, or "
            "another dim."
        )
    return Laws.contacts(friction, dim, int(len(free_velocity) // dim) if is_dim else 0)
