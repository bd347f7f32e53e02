"""Convex programs for MuJoCo's constraint stage, from contact problems and from captured steps.

A problem gives the program ½ Λᵀ (G + R) Λ + Λᵀ c with a chosen R. With M⁻¹ = S Sᵀ and velocities S⁻¹ u in place of u,
the mass matrix is the identity, and J = (Sᵀ W)ᵀ gives J Jᵀ = G. If velocities take the place of accelerations, with
q̈_smooth = 0 and a_ref = −c, the forces of MuJoCo are the impulses. A captured step gives the program of its engine:
its A, R, b and sets, with a_ref = −b. The data are scaled: the matrix has a diagonal of about 1, and c or b is at most
1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.laws import LawKind
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle
from ...problems.engine_model import EngineModel, EngineSet

MAX_ENTRIES = 4_000_000
"""Largest number of entries of the dense J, and of the matrices of coordinates and of rows."""

MIN_FRICTION = 1e-5
"""MuJoCo's smallest friction coefficient."""

SAME_MATRIX = 1e-12
"""J is taken from the problem's factors if J Jᵀ differs from A by at most this, relative to the largest entry of A."""


def unsupported_reason(problem: ContactProblem) -> str | None:
    """Return why MuJoCo's rows cannot represent ``problem``, or None."""
    size = max(problem.n_rows, problem.factors.n_dofs if problem.factors is not None else 0) ** 2
    if problem.engine is not None:
        size = max(size, len(problem.engine.offset) ** 2)
    if size > MAX_ENTRIES:
        return f"its dense matrices have {size} entries, more than {MAX_ENTRIES}"
    if problem.engine is not None:
        if (problem.engine.kind == EngineSet.COULOMB_CONE).any():
            return f"the model of {problem.engine.name} follows Coulomb's law, but MuJoCo solves convex programs"
        return None
    laws = problem.laws
    if laws.is_rolling.any():
        return "MuJoCo has one bound for sliding and rolling friction, but this problem has two"
    bounded = laws.is_friction & (laws.partner < 0)
    if (bounded & (laws.kind != LawKind.PLANAR_FRICTION)).any():
        return "MuJoCo bounds single rows of friction, but this problem has discs with a fixed bound"
    if (laws.fixed_bound[laws.partner >= 0] > 0.0).any():
        return "it has contacts whose friction also has a fixed bound, and MuJoCo has no such cone"
    obstacle = convex_obstacle(problem)
    if obstacle:
        return obstacle
    if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
        return "G is not symmetric"
    return None


@dataclass(frozen=True, eq=False)
class ConeProgram:
    """A convex program over forces, with its rows in the order of MuJoCo: equalities, friction losses, contacts.

    Attributes:
        jacobian: J, dense, shape (n, n_dofs); the mass matrix is the identity.
        regularisation: R, shape (n,).
        reference: a_ref, shape (n,).
        n_equalities: number of equalities, one row each.
        bounds: largest force of each friction loss, shape (n_bounded,).
        dims: number of rows of each contact, 1, 3, 4 or 6; limits and edges of pyramids are contacts of one row.
        coefficient: μ of each friction row of a contact, shape (n,).
        impulses: function that returns Λ [N s] of the problem from the forces of the program.
        forces: function that returns the forces of the program from Λ.
    """

    jacobian: FloatArray
    regularisation: FloatArray
    reference: FloatArray
    n_equalities: int
    bounds: FloatArray
    dims: tuple[int, ...]
    coefficient: FloatArray
    impulses: Callable[[FloatArray], FloatArray]
    forces: Callable[[FloatArray], FloatArray]


def program_of(problem: ContactProblem, impedance: float) -> ConeProgram:
    """Return the program of ``problem``.

    A captured step has the R of its engine. Otherwise, R = (1 − d)/d α with d = ``impedance``, between 0 and 1.
    """
    return (
        _program_of_problem(problem, impedance)
        if problem.engine is None
        else _program_of_engine(problem, problem.engine)
    )


def _program_of_problem(problem: ContactProblem, impedance: float) -> ConeProgram:
    laws, mass = problem.laws, float(np.mean(problem.delassus_diagonal)) or 1.0
    speed = float(np.abs(problem.free_velocity).max(initial=0.0)) or 1.0
    unit = speed / mass
    bilateral = np.flatnonzero(laws.is_bilateral)
    bounded = np.flatnonzero(laws.is_friction & (laws.partner < 0))
    normal = np.flatnonzero(laws.is_unilateral)
    is_frictional = np.append(laws.partner, -1)[normal + 1] == normal
    friction = np.where(is_frictional, np.append(laws.friction_coefficient, 0.0)[normal + 1], 0.0)
    dims = tuple(np.where(is_frictional, 3, 1).tolist())
    rows = _rows_of(laws, bilateral, bounded, normal, is_frictional)
    directions = _directions(problem) / np.sqrt(mass)
    jacobian = np.concatenate([directions, np.zeros((len(directions), 1))], axis=1)[:, rows].T
    alpha, coefficient = np.einsum("ij,ij->i", jacobian, jacobian), np.ones(len(rows))
    first = len(bilateral) + len(bounded)
    for dim, mu in zip(dims, friction, strict=True):
        alpha[first : first + dim] = alpha[first : first + dim].max()
        coefficient[first + 1 : first + dim] = max(float(mu), MIN_FRICTION)
        first += dim

    def impulses(forces: FloatArray) -> FloatArray:
        padded = np.zeros(problem.n_rows + 1)
        padded[rows] = forces
        return padded[:-1] * unit

    return ConeProgram(
        jacobian=jacobian,
        regularisation=(1.0 - impedance) / impedance * np.where(alpha > 0.0, alpha, 1.0),
        reference=-np.append(problem.free_velocity, 0.0)[rows] / speed,
        n_equalities=len(bilateral),
        bounds=laws.fixed_bound[bounded] / unit,
        dims=dims,
        coefficient=coefficient,
        impulses=impulses,
        forces=lambda problem_impulses: np.append(problem_impulses / unit, 0.0)[rows],
    )


def _rows_of(laws: Any, bilateral: Any, bounded: Any, normal: Any, is_frictional: Any) -> IntArray:
    """Return the row of the problem for each row of the program; −1 for the second tangent of planar friction."""
    rows = laws.first_row[np.concatenate([bilateral, bounded])].tolist()
    for law, has_friction in zip(normal.tolist(), is_frictional.tolist(), strict=True):
        first = int(laws.first_row[law])
        count = int(laws.row_count[law + 1]) if has_friction else 0
        rows += [first, *range(first + 1, first + 1 + count), *([-1] if count == 1 else [])]
    return np.array(rows, dtype=np.int64)


def _program_of_engine(problem: ContactProblem, engine: EngineModel) -> ConeProgram:
    kinds = engine.kind.tolist()
    sets = sorted(range(len(kinds)), key=lambda index: min(kinds[index], EngineSet.HALF_LINE))
    ends = engine.first_row + engine.row_counts
    rows = np.concatenate([np.arange(engine.first_row[index], ends[index]) for index in sets] or [np.zeros(0)])
    rows = rows.astype(np.int64)
    mass = float(np.mean(engine.matrix.diagonal())) or 1.0
    speed = float(np.abs(engine.offset).max(initial=0.0)) or 1.0
    unit, is_bounded = speed / mass, engine.kind == EngineSet.INTERVAL

    def forces(impulses: FloatArray) -> FloatArray:
        program_forces: FloatArray = engine.forces(impulses)[rows] / unit
        return program_forces

    def impulses(forces: FloatArray) -> FloatArray:
        engine_forces = np.empty(len(rows))
        engine_forces[rows] = forces * unit
        return engine.impulses(engine_forces)

    return ConeProgram(
        jacobian=_engine_jacobian(problem, engine)[rows] / np.sqrt(mass),
        regularisation=engine.regularisation[rows] / mass,
        reference=-engine.offset[rows] / speed,
        n_equalities=kinds.count(EngineSet.LINE),
        bounds=engine.bound[engine.first_row[is_bounded]] / unit,
        dims=tuple(int(engine.row_counts[index]) for index in sets if kinds[index] >= EngineSet.HALF_LINE),
        coefficient=engine.coefficient[rows],
        impulses=impulses,
        forces=forces,
    )


def _engine_jacobian(problem: ContactProblem, engine: EngineModel) -> FloatArray:
    """Return J with J Jᵀ = A, from the problem's factors if they give A; damping in the mass matrix prevents that."""
    scale = float(abs(engine.matrix).max()) if engine.matrix.nnz else 0.0
    if problem.factors is not None and engine.back is None:
        jacobian: FloatArray = engine.combination.T @ _directions(problem).T / engine.time_step
        if np.abs(jacobian @ jacobian.T - engine.matrix).max(initial=0.0) <= SAME_MATRIX * scale:
            return jacobian
    return _root(engine.matrix.toarray()).T


def _directions(problem: ContactProblem) -> FloatArray:
    """Return a dense W̃ with G = W̃ᵀ W̃, shape (n_dofs, n_rows)."""
    if problem.factors is not None:
        dense: FloatArray = problem.factors.scaled_directions.toarray()
        return dense
    return _root(problem.delassus().toarray())


def _root(matrix: FloatArray) -> FloatArray:
    """Return B with Bᵀ B equal to a positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    root: FloatArray = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return root
