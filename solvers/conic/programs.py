"""The associated contact model as a cone program for Clarabel, in Delassus and in factor form.

    Delassus    minimise ½ ΛᵀGΛ + cᵀΛ   subject to   Λ ∈ K,            K = {Λ_N ≥ 0, ‖Λ_T‖ ≤ a + μ Λ_N} per contact
    factors     minimise ½ ‖v‖²         subject to   W̃ᵀv + c ∈ K*,     K* = {ξ_N ≥ μ ‖ξ_T‖},  G = W̃ᵀW̃,  a = 0

Rolling friction adds the cone ‖Λ_R‖ ≤ a_r + μ_r Λ_N. The dual of the intersection of both cones,
{ξ_N ≥ μ ‖ξ_T‖ + μ_r ‖ξ_R‖}, is the sum of their duals. Representing this sum requires variables that the
factor form does not have. A bilateral law has K = ℝ, and therefore ξ = 0 in the dual.

The factor form is the dual of the Delassus form, where v is the scaled velocity that the impulses cause, and Λ are the
multipliers. It never assembles G. Both forms accept another c without a new set-up.

Units. With α_i the largest diagonal entry of contact i's block of G, e = max_i ‖c_i‖²/α_i is an estimate of the energy
that impulses can remove from the free motion. Energies are divided by e, and the variables are y_i = Λ_i √(α_i/e). The
largest diagonal entry of each block is then one, and c is of the order of one, for any masses and units. Each cone is
scaled as a whole and keeps its form.

Either program may be regularised: G + diag(w) replaces G. In factor form, the rows diag(√w) are appended to W̃.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal, Protocol

import clarabel
import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.coupling import row_lengths
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle

Form = Literal["delassus", "factors"]

MAX_ITERATIONS = 200
"""Limit of interior-point iterations of one run. Clarabel needs 10 to 30 unless it makes no progress."""

MAX_REFINEMENTS = 50
"""Largest number of refinements of one linear solve with ``refines_more``, as long as each halves the error."""

REFINEMENT_TOLERANCE = 1e-15
"""The error at which refinements end."""


class ConicStatus(StrEnum):
    """How one run of a conic solver ended."""

    CONVERGED = "converged"
    NEARLY_CONVERGED = "nearly converged"
    ITERATION_LIMIT = "reached its iteration limit"
    TIME_LIMIT = "reached its time limit"
    UNBOUNDED = "reported the energy as unbounded"
    GAVE_UP = "made no further progress"


@dataclass(frozen=True, eq=False)
class ConicResult:
    """The result of one run of a conic solver.

    Attributes:
        impulses: Λ [N s], shape (n_rows,); NaN if the solver returned none.
        iterations: number of iterations of the run.
        seconds: time of the run [s].
        status: how the run ended.
    """

    impulses: FloatArray
    iterations: int
    seconds: float
    status: ConicStatus


class ConicProgram(Protocol):
    """A cone program that has been set up."""

    def run(self, velocity: FloatArray, accuracy: float, max_iterations: int, max_seconds: float) -> ConicResult:
        """Solve with c = ``velocity`` [m/s], shape (n_rows,), to the conic solver's tolerance ``accuracy``.

        ``max_iterations`` and ``max_seconds`` [s] limit the run.
        """
        ...

    def regularised(self, weight: FloatArray) -> "ConicProgram":
        """Return the program with G + diag(``weight``) [1/kg], shape (n_rows,), in place of G, newly set up."""
        ...


def unsupported_reason(problem: ContactProblem, form: Form) -> str | None:
    """Return why ``problem`` has no cone program in ``form``, or None."""
    if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
        return "G is not symmetric, so the convex model has no energy to minimise"
    reason = convex_obstacle(problem)
    if reason or form == "delassus":
        return reason
    if problem.factors is None:
        return "the problem holds G only, and this form needs the factors W and M⁻¹"
    if problem.layout.rolling:
        return "it has rolling friction, whose dual is not a second-order cone; use form='delassus'"
    if (problem.laws.fixed_bound > 0.0).any():
        law = int(np.argmax(problem.laws.fixed_bound > 0.0))
        return f"friction law {law} has a fixed bound, so its set is not a cone; use form='delassus'"
    return None


def largest_curvatures(problem: ContactProblem) -> FloatArray:
    """Return α [1/kg], shape (n_blocks,): the largest diagonal entry of each block of G.

    If it is zero, α is the largest one of all blocks, or 1 if all are zero.

    Rolling rows are scaled by the lengths ℓ of their laws (``residual``), here and in ``Scaling``.
    """
    diagonal = problem.delassus_diagonal
    if problem.layout.rolling:
        diagonal = diagonal * row_lengths(problem) ** 2
    largest = problem.layout.pad(diagonal).max(axis=1, initial=0.0)
    return np.where(largest > 0.0, largest, largest.max(initial=0.0) or 1.0)


class Scaling:
    """Units of energy and impulse, and the rows of the blocks.

    Attributes:
        energy: e [J].
        block_impulse: unit of the impulses of each block [N s], shape (n_blocks,).
        block_moment: unit of their rolling impulses [N m s], shape (n_blocks,).
        impulse: unit of each row's impulse, shape (n_rows,).
        lanes: row of each lane of each block, −1 if there is none, shape (n_blocks, width).
    """

    def __init__(self, problem: ContactProblem) -> None:
        layout, width = problem.layout, problem.layout.width
        alpha = largest_curvatures(problem)
        lengths = row_lengths(problem) if layout.rolling else np.ones(problem.n_rows)
        energies = (layout.pad(lengths * problem.free_velocity) ** 2).sum(axis=1) / alpha
        self.energy = float(energies.max(initial=0.0)) or 1.0
        self.block_impulse: FloatArray = np.sqrt(self.energy / alpha)
        self.block_moment = self.block_impulse
        if layout.rolling:
            rolling_lengths = layout.pad(lengths)[:, -layout.rolling :].max(axis=1)  # 0 without rolling friction
            self.block_moment = self.block_impulse * np.where(rolling_lengths > 0.0, rolling_lengths, 1.0)
        self.impulse: FloatArray = lengths * layout.unpad(np.repeat(self.block_impulse, width))
        row_of_slot = np.full(layout.n_blocks * width, -1)
        row_of_slot[layout.slot] = np.arange(problem.n_rows)
        self.lanes = row_of_slot.reshape(layout.n_blocks, width)


class ClarabelProgram:
    """The program of ``problem`` in one of the two forms, optionally regularised by w [1/kg], shape (n_rows,)."""

    def __init__(self, problem: ContactProblem, form: Form, weight: FloatArray | None = None) -> None:
        self._problem, self._form, self._scaling = problem, form, Scaling(problem)
        make_solver = _factor_solver if form == "factors" else _delassus_solver
        self._solver, self._rows, self._cone_scale = make_solver(problem, self._scaling, weight)

    def run(
        self, velocity: FloatArray, accuracy: float, max_iterations: int, max_seconds: float, refines_more: bool = False
    ) -> ConicResult:
        """See ``ConicProgram``; with ``refines_more``, linear systems are solved with more iterative refinement."""
        rows, is_dual = self._rows, self._form == "factors"
        linear = self._cone_scale * (velocity * (self._scaling.impulse / self._scaling.energy))[rows]
        settings = _make_settings(accuracy, max_iterations, max_seconds, refines_more)
        self._solver.update(**{"b" if is_dual else "q": linear}, settings=settings)
        result = self._solver.solve()
        impulses = np.zeros(self._problem.n_rows)
        impulses[rows] = self._scaling.impulse[rows] * self._cone_scale * np.asarray(result.z if is_dual else result.x)
        status = _STATUSES.get(result.status, ConicStatus.GAVE_UP)
        return ConicResult(impulses, result.iterations, result.solve_time, status)

    def regularised(self, weight: FloatArray) -> "ClarabelProgram":
        """See ``ConicProgram``."""
        return ClarabelProgram(self._problem, self._form, weight)


def _delassus_solver(
    problem: ContactProblem, scaling: Scaling, weight: FloatArray | None
) -> tuple[Any, Any, FloatArray]:
    """Return the solver of the Delassus form, the indices of all rows, and the scale 1 of each row."""
    n_rows, units = problem.n_rows, sp.diags_array(scaling.impulse / np.sqrt(scaling.energy))
    delassus = problem.delassus() if weight is None else problem.delassus() + sp.diags_array(weight)
    solver = _make_solver(units @ delassus @ units, np.zeros(n_rows), *_impulse_cones(problem, scaling))
    return solver, np.arange(n_rows), np.ones(n_rows)


def _factor_solver(problem: ContactProblem, scaling: Scaling, weight: FloatArray | None) -> tuple[Any, Any, FloatArray]:
    """Return the solver of the factor form, the rows in its cones, and the scale of each row in its cone."""
    assert problem.factors is not None
    rows, cone_scale, cones = _dual_cones(problem, scaling)
    scaled_directions = problem.factors.scaled_directions
    if weight is not None:
        scaled_directions = sp.vstack([scaled_directions, sp.diags_array(np.sqrt(weight))], format="csc")
    scaled_directions = scaled_directions @ sp.diags_array(scaling.impulse / np.sqrt(scaling.energy))
    constraints = -sp.diags_array(cone_scale) @ scaled_directions.T.tocsr()[rows]
    n_dofs = scaled_directions.shape[0]
    solver = _make_solver(sp.eye_array(n_dofs), np.zeros(n_dofs), constraints, np.zeros(len(rows)), cones)
    return solver, rows, cone_scale


_STATUSES = {
    clarabel.SolverStatus.Solved: ConicStatus.CONVERGED,
    clarabel.SolverStatus.AlmostSolved: ConicStatus.NEARLY_CONVERGED,
    clarabel.SolverStatus.MaxIterations: ConicStatus.ITERATION_LIMIT,
    clarabel.SolverStatus.MaxTime: ConicStatus.TIME_LIMIT,
    # the forms are dual to each other, so either infeasibility means an unbounded energy
    clarabel.SolverStatus.PrimalInfeasible: ConicStatus.UNBOUNDED,
    clarabel.SolverStatus.AlmostPrimalInfeasible: ConicStatus.UNBOUNDED,
    clarabel.SolverStatus.DualInfeasible: ConicStatus.UNBOUNDED,
    clarabel.SolverStatus.AlmostDualInfeasible: ConicStatus.UNBOUNDED,
}


def _make_settings(accuracy: float, max_iterations: int, max_seconds: float, refines_more: bool = False) -> Any:
    """Return Clarabel settings for one thread with these tolerances and limits."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.presolve_enable = False  # data updates require this
    if refines_more:
        settings.iterative_refinement_max_iter = MAX_REFINEMENTS
        settings.iterative_refinement_reltol = settings.iterative_refinement_abstol = REFINEMENT_TOLERANCE
        settings.iterative_refinement_stop_ratio = 2.0
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = accuracy
    settings.max_iter = max(1, min(MAX_ITERATIONS, max_iterations))
    settings.time_limit = max(max_seconds, 1e-3)
    return settings


def _make_solver(quadratic: Any, linear: FloatArray, constraints: Any, bounds: FloatArray, cones: list[Any]) -> Any:
    """Return a Clarabel solver of a program ½ yᵀPy + qᵀy with A y + s = b, whose q or b can be updated."""
    upper = sp.csc_matrix(sp.triu(quadratic, format="csc"))
    settings = _make_settings(1e-8, MAX_ITERATIONS, 60.0)
    return clarabel.DefaultSolver(upper, linear, sp.csc_matrix(constraints), bounds, cones, settings)


def _impulse_cones(problem: ContactProblem, scaling: Scaling) -> tuple[Any, FloatArray, list[Any]]:
    """Return A, b and the cones of A y + s = b, s ∈ cones, for impulses Λ = y times their unit.

    ‖Λ_T‖ ≤ μ Λ_N implies Λ_N ≥ 0, so Λ_N ≥ 0 is added only for blocks without such a cone. Friction with a bound of
    zero (a = μ = 0) is the equation Λ_T = 0. Bilateral laws have no constraint.
    """
    layout = problem.layout
    rows, columns, values = [], [], []
    bounds: list[float] = []
    cones: list[Any] = []

    def add(kind: Any, entries: list[tuple[int, float]], offset: float) -> None:
        for column, value in entries:
            rows.append(len(bounds))
            columns.append(column)
            values.append(value)
        bounds.append(offset)
        if kind is not None:
            cones.append(kind)

    parts = friction_parts(problem, scaling)
    for block in range(layout.n_blocks):
        normal, implies_normal = int(scaling.lanes[block, 0]), bool(layout.is_bilateral[block])
        for lanes, coefficients, bounds_of_blocks in parts:
            implies_normal |= coefficients[block] > 0.0 and bounds_of_blocks[block] == 0.0 and lanes[block].max() >= 0
        if normal >= 0 and not implies_normal:
            add(clarabel.NonnegativeConeT(1), [(normal, -1.0)], 0.0)
        for lanes, coefficients, bounds_of_blocks in parts:
            tangents = [int(row) for row in lanes[block] if row >= 0]
            mu, fixed_bound = float(coefficients[block]), float(bounds_of_blocks[block])
            if tangents and mu == 0.0 and fixed_bound == 0.0:
                for row in tangents:
                    add(clarabel.ZeroConeT(1), [(row, 1.0)], 0.0)
            elif tangents:
                add(None, [(normal, -mu)] if mu > 0.0 else [], fixed_bound)
                for row in tangents:
                    add(None, [(row, -1.0)], 0.0)
                cones.append(clarabel.SecondOrderConeT(1 + len(tangents)))
    constraints = sp.csc_matrix((values, (rows, columns)), shape=(len(bounds), problem.n_rows))
    return constraints, np.array(bounds), cones


def friction_parts(problem: ContactProblem, scaling: Scaling) -> list[tuple[Any, FloatArray, FloatArray]]:
    """Return the rows of the lanes, μ and a of sliding and of rolling friction, in the units of ``scaling``."""
    layout, first = problem.layout, 1 + problem.layout.sliding
    parts = []
    if layout.sliding:
        fixed_bound = layout.fixed_bound / scaling.block_impulse
        parts.append((scaling.lanes[:, 1:first], layout.friction_coefficient, fixed_bound))
    if layout.rolling:
        coefficient = layout.rolling_coefficient * (scaling.block_impulse / scaling.block_moment)
        parts.append((scaling.lanes[:, first:], coefficient, layout.rolling_bound / scaling.block_moment))
    return parts


def _dual_cones(problem: ContactProblem, scaling: Scaling) -> tuple[Any, FloatArray, list[Any]]:
    """Return rows, a scale for each row, and the cones of (scale · ξ)[rows]: (ξ_N/μ, ξ_T), ξ_N alone, or 0.

    Rows of friction with μ = 0 are in no cone and have no impulse.
    """
    layout = problem.layout
    rows: list[int] = []
    cone_scale: list[float] = []
    cones: list[Any] = []
    for block in range(layout.n_blocks):
        normal, mu = int(scaling.lanes[block, 0]), float(layout.friction_coefficient[block])
        if normal < 0:
            continue
        tangents = [int(row) for row in scaling.lanes[block, 1:] if row >= 0] if mu > 0.0 else []
        rows += [normal, *tangents]
        cone_scale += [1.0 / mu if tangents else 1.0, *[1.0] * len(tangents)]
        if tangents:
            cones.append(clarabel.SecondOrderConeT(1 + len(tangents)))
        else:
            cones.append(clarabel.ZeroConeT(1) if layout.is_bilateral[block] else clarabel.NonnegativeConeT(1))
    return np.array(rows, dtype=np.int64), np.array(cone_scale), cones
