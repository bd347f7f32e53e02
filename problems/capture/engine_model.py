"""What an engine sets out to solve in a step, and how well its forces solve that: the first of two tracks.

MuJoCo minimises over the forces f of its constraint rows

    ½ fᵀ (A + diag R) f + fᵀ b,      f_i ∈ Ω_i,

with A = J M⁻¹ Jᵀ [1/kg], a regularisation R and b = J q̈ − a_ref [m/s²] (Todorov, Convex and analytically-invertible
dynamics with contacts and constraints, 2014). The sets Ω are the line (equality), an interval (friction loss), the
half-line (limits, contacts without friction, edges of a pyramid) and the elliptic cone ‖(f_k/μ_k)‖ ≤ f_N. Coulomb's law
is another problem: it has neither R nor a_ref, and its friction is not associated.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ..arrays import FloatArray, IntArray
from ..errors import ProblemError


class EngineSet(IntEnum):
    """The form of the set Ω of some rows of an engine."""

    LINE = 0
    INTERVAL = 1
    HALF_LINE = 2
    ELLIPTIC_CONE = 3


@dataclass(frozen=True, eq=False)
class EngineModel:
    """The convex program of one step of an engine, and the forces that the engine found.

    Attributes:
        matrix: A [1/kg], scipy CSR, shape (n, n) over the rows of the engine.
        regularisation: R [1/kg], shape (n,).
        offset: b [m/s²], shape (n,).
        scale: largest sum of the absolute terms of an entry of b [m/s²], where b may be no more than their rounding.
        kind: ``EngineSet`` of each set, shape (n_sets,).
        first_row: first row of each set, shape (n_sets,); the sets tile the rows.
        coefficient: μ_k of each friction row of an elliptic cone, 1 for other rows, shape (n,).
        bound: largest force of a row in an interval [N], 0 for other rows, shape (n,).
        forces: f that the engine found [N], shape (n,).
        impulses: the same forces over the rows of the captured problem [N s], shape (n_rows,).
        engine: name and version of the engine.
        solver: name of its solver.
        iterations: iterations of its solver.
    """

    matrix: sp.csr_array[Any]
    regularisation: FloatArray
    offset: FloatArray
    scale: float
    kind: NDArray[np.int8]
    first_row: IntArray
    coefficient: FloatArray
    bound: FloatArray
    forces: FloatArray
    impulses: FloatArray
    engine: str
    solver: str
    iterations: int

    def __post_init__(self) -> None:
        n_rows = len(self.offset)
        for name in ("regularisation", "coefficient", "bound", "forces"):
            if np.shape(getattr(self, name)) != (n_rows,):
                raise ProblemError(f"{name} of an engine's model must have shape ({n_rows},), one entry per row.")
        if self.matrix.shape != (n_rows, n_rows):
            raise ProblemError(f"A of an engine's model must have shape ({n_rows}, {n_rows}), got {self.matrix.shape}.")
        ends = np.append(self.first_row, n_rows)
        if len(self.kind) != len(self.first_row) or ends[0] != 0 or (np.diff(ends) < (n_rows > 0)).any():
            raise ProblemError("the sets of an engine's model must tile its rows.")

    def gradient(self, forces: FloatArray) -> FloatArray:
        """Return (A + diag R) f + b [m/s²], shape (n,)."""
        gradient: FloatArray = self.matrix @ forces + self.regularisation * forces + self.offset
        return gradient


def judge_own_model(model: EngineModel, forces: ArrayLike | None = None) -> float:
    """Return how far forces are from solving the model of their engine.

    With α_i the largest diagonal entry of A + diag R over the rows of set i, friction rows of a cone scaled by μ,

        residual = max_i α_i ‖f_i − P_i(f_i − g_i/α_i)‖ / scale,      g = (A + diag R) f + b,

    which is 0 where f solves the model, and does not depend on units.

    Args:
        model: the engine's model.
        forces: f [N], shape (n,); those that the engine found by default.
    """
    found = model.forces if forces is None else np.asarray(forces, dtype=np.float64)
    if found.shape != model.offset.shape:
        raise ProblemError(f"forces must have shape {model.offset.shape}, one entry per row; got {found.shape}.")
    if not np.isfinite(found).all():
        return np.inf
    unit = model.coefficient
    force, slope = found / unit, model.gradient(found) * unit
    diagonal = (model.matrix.diagonal() + model.regularisation) * unit**2
    ends, worst = np.append(model.first_row, len(found)), 0.0
    for kind, first, end in zip(model.kind, ends[:-1], ends[1:], strict=True):
        rows = slice(first, end)
        alpha = float(diagonal[rows].max())
        if alpha == 0.0:
            worst = max(worst, float(np.abs(slope[rows]).max()))
            continue
        moved = _projection(EngineSet(kind), force[rows] - slope[rows] / alpha, model.bound[rows])
        worst = max(worst, alpha * float(np.linalg.norm(force[rows] - moved)))
    return worst / model.scale if model.scale else (np.inf if worst else 0.0)


def _projection(kind: EngineSet, point: FloatArray, bound: FloatArray) -> FloatArray:
    """Return the nearest point of a set, a cone being circular in scaled rows."""
    if kind == EngineSet.LINE:
        return point
    if kind == EngineSet.INTERVAL:
        return np.clip(point, -bound, bound)
    if kind == EngineSet.HALF_LINE:
        return np.maximum(point, 0.0)
    normal, radius = float(point[0]), float(np.linalg.norm(point[1:]))
    if radius <= normal:
        return point
    if radius <= -normal:
        return np.zeros_like(point)
    height = 0.5 * (normal + radius)
    return np.append(height, point[1:] * (height / radius))
