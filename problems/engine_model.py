"""The model that a physics engine solves in a step, and the residual of forces or impulses under this model.

MuJoCo minimises over the forces f of its constraint rows

    ½ fᵀ (A + diag R) f + fᵀ b,      f_i ∈ Ω_i,

with the constraint Jacobian J, A = J M⁻¹ Jᵀ [1/kg], a regularisation R and b = J q̈ − a_ref [m/s²], where q̈ is the
acceleration without constraints (Todorov, Convex and analytically-invertible dynamics with contacts and constraints,
2014). The sets Ω are the line (equality), an interval (friction loss), the half-line (limits, contacts without
friction, edges of a pyramid) and the elliptic cone ‖(f_k/μ_k)‖ ≤ f_N. Coulomb's law defines another problem: it has
neither R nor a_ref, and its friction is not associated.

Kamino solves Coulomb's law with compliant contacts and limits. With g = (A + diag R) f + b it requires, for
each contact, that f and g + μ ‖g_T‖ e_N are complementary in the cone and its dual (De Saxcé & Feng 1998).

The impulses of the contact problem are Λ = h S f, with the time step h and a matrix S. For an elliptic cone, S is
invertible. A contact with a pyramid has two forces f₊, f₋ ≥ 0 for each tangent, with f_N = Σ (f₊ + f₋) and
f_k = μ_k (f₊ − f₋). fᵀA f and fᵀb depend on f only through f_N and f_k, and the edges of a contact share one R. So the
forces that belong to Λ are those with the least Σ f²: with d_k = f₊ − f₋ and s_k = f₊ + f₋,

    s_k = max(|d_k|, τ),      with the τ for which Σ s_k = f_N.
"""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from .arrays import FloatArray, IntArray, ReadOnlyRecord, compressed_arrays, compressed_matrix, frozen, read_only
from .errors import ProblemError

_VECTORS = ("regularisation", "offset", "kind", "first_row", "coefficient", "bound")
_MATRICES = ("matrix", "combination", "back")


class EngineSet(IntEnum):
    """The form of a set Ω."""

    LINE = 0
    INTERVAL = 1
    HALF_LINE = 2
    ELLIPTIC_CONE = 3
    COULOMB_CONE = 4
    """An elliptic cone with De Saxcé's change of the normal velocity."""


@dataclass(frozen=True, eq=False)
class EngineModel(ReadOnlyRecord):
    """The model of one step of an engine.

    Attributes:
        name: name and version of the engine.
        matrix: A [1/kg], scipy CSR, shape (n, n) over the rows of the engine.
        regularisation: R [1/kg], shape (n,).
        offset: b [m/s²], shape (n,).
        scale: largest sum of the absolute values of the terms of an entry of b [m/s²]. Unlike b, this sum is not small
            if the terms cancel.
        kind: ``EngineSet`` of each set, shape (n_sets,).
        first_row: first row of each set, shape (n_sets,); the sets tile the rows.
        coefficient: μ_k of each friction row of a cone, 1 for other rows, shape (n,).
        bound: largest force of a row in an interval [N], 0 for other rows, shape (n,).
        combination: h S with Λ = h S f, shape (n_rows, n) over the rows of the captured problem.
        time_step: h [s].
        back: T, with orthogonal columns, if the rows of the problem differ from the captured ones: Λ = T Λ' with Λ' of
            the problem; ``None`` if they are the same.

    Raises:
        ProblemError: if shapes do not match, the sets do not tile the rows, or a kind is unknown.
    """

    name: str
    matrix: sp.csr_array[Any]
    regularisation: FloatArray
    offset: FloatArray
    scale: float
    kind: NDArray[np.int8]
    first_row: IntArray
    coefficient: FloatArray
    bound: FloatArray
    combination: sp.csr_array[Any]
    time_step: float
    back: sp.csr_array[Any] | None = None

    def __post_init__(self) -> None:
        n_rows = len(self.offset)
        for name in _MATRICES:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _canonical(getattr(self, name)))
        for name in ("regularisation", "offset", "coefficient", "bound"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64, name))
            if np.shape(getattr(self, name)) != (n_rows,):
                raise ProblemError(f"{name} of an engine's model must have shape ({n_rows},), one entry per row.")
        if self.matrix.shape != (n_rows, n_rows):
            raise ProblemError(f"A of an engine's model must have shape ({n_rows}, {n_rows}), got {self.matrix.shape}.")
        if self.combination.shape[1] != n_rows:
            raise ProblemError(f"S of an engine's model has {self.combination.shape[1]} columns for {n_rows} rows.")
        object.__setattr__(self, "kind", frozen(self.kind, np.int8, "kind"))
        object.__setattr__(self, "first_row", frozen(self.first_row, np.int64, "first_row"))
        ends = np.append(self.first_row, n_rows)
        if len(self.kind) != len(self.first_row) or ends[0] != 0 or (np.diff(ends) < (n_rows > 0)).any():
            raise ProblemError("the sets of an engine's model must tile its rows.")
        if not np.isin(self.kind, list(EngineSet)).all():
            raise ProblemError("a set of an engine's model has an unknown kind.")

    @property
    def n_rows(self) -> int:
        """Number of rows of the problem to which the model belongs."""
        return int(self.combination.shape[0] if self.back is None else self.back.shape[1])

    @cached_property
    def row_counts(self) -> IntArray:
        """Number of rows of each set, shape (n_sets,)."""
        counts: IntArray = np.diff(np.append(self.first_row, len(self.offset)))
        return counts

    @cached_property
    def diagonal(self) -> FloatArray:
        """Diagonal of A + diag R, friction rows of a cone scaled by μ [1/kg], shape (n,)."""
        diagonal: FloatArray = (self.matrix.diagonal() + self.regularisation) * self.coefficient**2
        return diagonal

    def gradient(self, forces: FloatArray) -> FloatArray:
        """Return (A + diag R) f + b [m/s²], shape (n,)."""
        gradient: FloatArray = self.matrix @ forces + self.regularisation * forces + self.offset
        return gradient

    def impulses(self, forces: FloatArray) -> FloatArray:
        """Return Λ [N s], shape (n_rows,), of forces f [N], shape (n,)."""
        captured = self.combination @ forces
        impulses: FloatArray = captured if self.back is None else _pseudoinverse(self.back) @ captured
        return impulses

    def forces(self, impulses: ArrayLike) -> FloatArray:
        """Return the forces f [N], shape (n,), that belong to Λ [N s], shape (n_rows,); see the module docstring."""
        vector = np.asarray(impulses, dtype=np.float64)
        captured = vector if self.back is None else self.back @ vector
        decoding, result = self._decoding, self._forces_without_impulse.copy()
        result[decoding.single] = captured[decoding.single_row] / decoding.single_weight
        for pyramids in decoding.pyramids:
            pyramids.write_forces(captured, result)
        return result

    def transformed(self, back: sp.csr_array[Any]) -> "EngineModel | None":
        """Return the model for a problem with Λ = T Λ', or None if T is not square; its columns must be orthogonal."""
        if back.shape[0] != back.shape[1]:
            return None
        return replace(self, back=sp.csr_array(back if self.back is None else self.back @ back))

    def shifted(self, change: FloatArray) -> "EngineModel":
        """Return the model after a change δ of c [m/s], shape (n_rows,), which adds Sᵀ δ / h to b."""
        captured = change if self.back is None else _pseudoinverse(self.back).T @ change
        return replace(self, offset=self.offset + self.combination.T @ captured / self.time_step**2)

    def labelled_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the numbers that define the model as labelled arrays; ``of_arrays`` reads them."""
        arrays: dict[str, NDArray[Any]] = {f"engine.{name}": getattr(self, name) for name in _VECTORS}
        arrays["engine.scalars"] = np.array([self.scale, self.time_step])
        for name in _MATRICES:
            matrix = getattr(self, name)
            if matrix is not None:
                arrays |= compressed_arrays(f"engine.{name}", matrix)
        return arrays

    @staticmethod
    def of_arrays(name: str, content: Mapping[str, NDArray[Any]]) -> "EngineModel":
        """Return the model with these arrays; ``content`` may contain other arrays.

        Raises:
            KeyError: if an array is missing.
            ValueError: if an array does not match the others.
        """
        scale, time_step = map(float, content["engine.scalars"])
        vectors: dict[str, Any] = {label: content[f"engine.{label}"] for label in _VECTORS}
        stored = [label for label in _MATRICES if f"engine.{label}.data" in content]
        matrices: dict[str, Any] = {
            label: compressed_matrix(sp.csr_array, content, f"engine.{label}") for label in stored
        }
        return EngineModel(name=name, scale=scale, time_step=time_step, **vectors, **matrices)

    def fresh(self) -> "EngineModel":
        """Return an equal model that shares no memory with this one."""
        return EngineModel(**{item.name: deepcopy(getattr(self, item.name)) for item in fields(self)})

    @cached_property
    def _forces_without_impulse(self) -> FloatArray:
        """Solution of each row for A = 0 [N], shape (n,); it is exact for rows that do not move any body."""
        compliance, zeros = self.regularisation, np.zeros(len(self.offset))
        forces = np.divide(-self.offset, compliance, out=zeros, where=compliance > 0.0)
        kinds = np.repeat(self.kind, self.row_counts)
        forces = np.where(kinds == EngineSet.INTERVAL, np.clip(forces, -self.bound, self.bound), forces)
        return np.where(kinds >= EngineSet.HALF_LINE, np.maximum(forces, 0.0), forces)

    @cached_property
    def _decoding(self) -> "_Decoding":
        return _decoding_of(self.combination)

    @cached_property
    def _sets(self) -> "_Sets":
        return _Sets.of(self)


@dataclass(frozen=True, eq=False)
class _Pyramids:
    """Contacts with the same number of pairs of edges: first row and impulses of each pair.

    Attributes:
        first: first row of each pair, shape (n_contacts, n_pairs).
        normal: row of Λ with the sum of all forces of a contact, shape (n_contacts,).
        normal_weight: weight of a force in that sum, shape (n_contacts,).
        tangent: row of Λ with the difference of a pair; −1 if no row has it, shape (n_contacts, n_pairs).
        tangent_weight: weight of the difference, shape (n_contacts, n_pairs).
    """

    first: IntArray
    normal: IntArray
    normal_weight: FloatArray
    tangent: IntArray
    tangent_weight: FloatArray

    def write_forces(self, impulses: FloatArray, forces: FloatArray) -> None:
        """Write the forces of the edges for captured impulses."""
        difference = np.where(self.tangent >= 0, impulses[self.tangent], 0.0) / self.tangent_weight
        total = _pair_sums(impulses[self.normal] / self.normal_weight, np.abs(difference))
        forces[self.first] = 0.5 * (total + difference)
        forces[self.first + 1] = 0.5 * (total - difference)


@dataclass(frozen=True, eq=False)
class _Decoding:
    """The rows of an engine, grouped by the way in which their forces follow from impulses.

    Attributes:
        single: rows whose force alone determines one impulse, shape (n_single,).
        single_row: row of Λ of each.
        single_weight: weight of each force in that row.
        pyramids: edges of pyramids.
    """

    single: IntArray
    single_row: IntArray
    single_weight: FloatArray
    pyramids: tuple[_Pyramids, ...]


def _decoding_of(combination: sp.csr_array[Any]) -> _Decoding:
    columns = sp.csc_array(combination)
    columns.sort_indices()
    counts, starts = np.diff(columns.indptr), columns.indptr[:-1]
    used = np.flatnonzero(counts > 0)
    row, weight = np.zeros((2, combination.shape[1]), dtype=np.int64), np.ones((2, combination.shape[1]))
    for entry in (0, 1):
        long_columns = np.flatnonzero(counts > entry)
        row[entry, long_columns] = columns.indices[starts[long_columns] + entry]
        weight[entry, long_columns] = columns.data[starts[long_columns] + entry]
    row[1, counts < 2] = -1
    has_single_entry = np.diff(combination.indptr)[row[0]] == 1
    single = used[has_single_entry[used]]
    by_normal: dict[int, list[int]] = {}
    for column in used[~has_single_entry[used]].tolist():
        by_normal.setdefault(int(row[0, column]), []).append(column)
    by_size: dict[int, list[list[int]]] = {}
    for edges in by_normal.values():
        if len(edges) % 2 or np.diff(edges).max() > 1:
            raise ProblemError("the edges of a pyramid of an engine's model must be adjacent pairs.")
        by_size.setdefault(len(edges), []).append(edges[::2])
    pyramids = tuple(
        _Pyramids(first, row[0, first[:, 0]], weight[0, first[:, 0]], row[1, first], weight[1, first])
        for first in map(np.array, by_size.values())
    )
    return _Decoding(single, row[0, single], weight[0, single], pyramids)


def _pair_sums(sums: FloatArray, minimum: FloatArray) -> FloatArray:
    """Return s_k = max(minimum_k, τ), shape (n, k), with τ such that Σ s_k is the given sum, shape (n,).

    If Σ minimum_k exceeds the sum, s_k is minimum_k minus the same number for all k.
    """
    count = minimum.shape[1]
    descending = -np.sort(-minimum, axis=1)
    sum_of_larger = np.cumsum(descending, axis=1) - descending
    levels = (sums[:, None] - sum_of_larger) / (count - np.arange(count))
    fits = levels >= descending
    level = np.take_along_axis(levels, fits.argmax(axis=1)[:, None], axis=1)
    correction = (sums - minimum.sum(axis=1))[:, None] / count
    result: FloatArray = np.where(fits.any(axis=1)[:, None], np.maximum(minimum, level), minimum + correction)
    return result


def _canonical(source: sp.csr_array[Any]) -> sp.csr_array[Any]:
    """Return a read-only copy with sorted indices."""
    matrix = sp.csr_array(source, copy=True)
    matrix.sum_duplicates()
    read_only(matrix.data, matrix.indices, matrix.indptr)
    return matrix


def _pseudoinverse(back: sp.csr_array[Any]) -> sp.csr_array[Any]:
    """Return T⁺ of a matrix with orthogonal columns."""
    return sp.csr_array(sp.diags_array(1.0 / (back.multiply(back)).sum(axis=0)) @ back.T)


@dataclass(frozen=True, eq=False)
class _Sets:
    """The sets of a model, as arrays.

    Attributes:
        of_row: set of each row, shape (n,).
        kind_of_row: ``EngineSet`` of each row, shape (n,).
        is_tangent: whether a row is a friction row of a cone, shape (n,).
        alpha: largest entry of ``EngineModel.diagonal`` of each set [1/kg], shape (n_sets,).
    """

    of_row: IntArray
    kind_of_row: NDArray[np.int8]
    is_tangent: NDArray[np.bool_]
    alpha: FloatArray

    @staticmethod
    def of(model: EngineModel) -> "_Sets":
        of_row = np.repeat(np.arange(len(model.kind)), model.row_counts)
        kinds = model.kind[of_row]
        is_tangent = kinds >= EngineSet.ELLIPTIC_CONE
        is_tangent[model.first_row] = False
        return _Sets(of_row, kinds, is_tangent, np.maximum.reduceat(model.diagonal, model.first_row))


def judge_own_model(model: EngineModel, forces: ArrayLike) -> float:
    """Return the residual of forces under the model of their engine.

    With P_i the projection onto set i, and α_i the largest diagonal entry of A + diag R over its rows, friction rows of
    a cone scaled by μ,

        residual = max_i α_i ‖f_i − P_i(f_i − g_i/α_i)‖ / scale,      g = (A + diag R) f + b,

    which is 0 where f solves the model, and does not depend on units. For a ``COULOMB_CONE``, μ ‖g_T‖ is added to g_N.

    Args:
        model: the engine's model.
        forces: f [N], shape (n,).

    Returns:
        The residual; inf if a force is not finite, or if the arithmetic overflows.

    Raises:
        ProblemError: if the forces have the wrong shape.
    """
    f = np.asarray(forces, dtype=np.float64)
    if f.shape != model.offset.shape:
        raise ProblemError(f"forces must have shape {model.offset.shape}, one entry per row; got {f.shape}.")
    if not np.isfinite(f).all():
        return np.inf
    if not len(f):
        return 0.0
    sets = model._sets
    force, slope = f / model.coefficient, model.gradient(f) * model.coefficient
    follows_coulomb = model.kind == EngineSet.COULOMB_CONE
    sliding = np.sqrt(np.add.reduceat(np.where(sets.is_tangent, slope, 0.0) ** 2, model.first_row))
    slope[model.first_row[follows_coulomb]] += sliding[follows_coulomb]
    alpha = sets.alpha[sets.of_row]
    point = force - np.divide(slope, alpha, out=np.zeros_like(slope), where=alpha > 0.0)
    projected = _projection(model, sets, point)
    violation = np.where(alpha > 0.0, alpha * (force - projected), slope)
    worst = float(np.sqrt(np.add.reduceat(violation**2, model.first_row).max()))
    if worst == 0.0:
        return 0.0
    return worst / model.scale if worst < np.inf and model.scale > 0.0 else np.inf  # NaN counts as infinite


def own_residual(model: EngineModel, impulses: ArrayLike) -> float:
    """Return the residual of ``judge_own_model`` for impulses Λ [N s], shape (n_rows,) over the rows of the problem."""
    vector = np.asarray(impulses, dtype=np.float64)
    return judge_own_model(model, model.forces(vector)) if np.isfinite(vector).all() else np.inf


def _projection(model: EngineModel, sets: _Sets, point: FloatArray) -> FloatArray:
    """Return the nearest point of the sets; rows are scaled so that cones are circular."""
    kinds, first = sets.kind_of_row, model.first_row
    nearest = np.where(kinds == EngineSet.INTERVAL, np.clip(point, -model.bound, model.bound), point)
    nearest = np.where(kinds == EngineSet.HALF_LINE, np.maximum(point, 0.0), nearest)
    normal = point[first]
    radius = np.sqrt(np.add.reduceat(np.where(sets.is_tangent, point, 0.0) ** 2, first))
    height = np.where(radius <= -normal, 0.0, 0.5 * (normal + radius))
    is_outside = (model.kind >= EngineSet.ELLIPTIC_CONE) & (radius > normal)
    shrink = np.divide(height, radius, out=np.zeros_like(height), where=radius > 0.0)
    projected = np.where(sets.is_tangent, point * shrink[sets.of_row], height[sets.of_row])
    return np.where(is_outside[sets.of_row], projected, nearest)
