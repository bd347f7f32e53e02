"""The associated (convex) contact model as a second-order cone program, solved by Clarabel's interior point method.

    minimise ½ ΛᵀGΛ + cᵀΛ      subject to      Λ_N ≥ 0,   ‖Λ_T‖ ≤ a + μ Λ_N      for every contact.

Its optimality condition is −ξ ∈ N_K(Λ), which agrees with Coulomb's law where contacts stick or open; a sliding contact
separates with ξ_N = μ‖ξ_T‖ instead of staying closed. Clarabel: Goulart & Chen 2024.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import clarabel
import numpy as np
import scipy.sparse as sp

from ...problems.contact import ContactProblem
from ...problems.judge import Residual, convex_obstacle, judge
from ...problems.laws import FloatArray
from ...problems.model import Model
from ..interface import Observer, Solution, Status, Stop, described

FIRST_ACCURACY = 1e-2
"""Clarabel's tolerances at the first try, relative to the residual asked for."""

TIGHTENING = 1e-2
"""Factor on Clarabel's tolerances when the residual is not yet reached."""

TIGHTEST = 1e-15
"""Below this Clarabel's tolerances mean nothing in double precision."""

_ENDED = {
    clarabel.SolverStatus.MaxIterations: Status.ITERATION_LIMIT,
    clarabel.SolverStatus.MaxTime: Status.TIME_LIMIT,
}


@dataclass(frozen=True)
class ClarabelSOCP:
    """Clarabel on the convex model, through its direct interface, in Delassus form.

    Its interior point iterates satisfy no force law, so they are not shown to observers.
    """

    model: ClassVar[Model] = Model.CONVEX
    has_iterates: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """Class name."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
            return "G is not symmetric, so the convex model has no energy to minimise"
        return convex_obstacle(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedSOCP":
        """Assemble G and the cones; impulses are scaled to numbers of order one."""
        return PreparedSOCP(problem)


class PreparedSOCP:
    """The cone program of one problem."""

    def __init__(self, problem: ContactProblem) -> None:
        self._problem = problem
        self._residual = Residual(problem)
        matrix = problem.delassus()
        diagonal = problem.delassus_diagonal
        mean = float(diagonal.mean()) if len(diagonal) else 0.0
        velocity = self._residual.scale
        self._scale = velocity / mean if velocity > 0.0 and mean > 0.0 else 1.0
        unit = velocity if velocity > 0.0 else 1.0
        self._quadratic = sp.csc_matrix(sp.triu(matrix * (self._scale / unit), format="csc"))
        self._linear = problem.free_velocity / unit
        self._constraints, self._bounds, self._cones = _cones(problem, self._scale)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve to the judge's residual of the convex model; Clarabel cannot use a start, and shows no iterates."""
        n_rows = self._problem.n_rows
        if self._residual.infeasible:
            return Solution(np.zeros(n_rows), Status.INFEASIBLE, 0, "a unilateral law has G_ii = 0 and c_i < 0")
        if n_rows == 0 or self._residual.scale == 0.0:
            return Solution(np.zeros(n_rows), Status.SOLVED, 0)
        accuracy, seconds, iterations = FIRST_ACCURACY * stop.tolerance, 0.0, 0
        best, best_residual, ended = np.zeros(n_rows), np.inf, (Status.STALLED, "")
        while True:
            result = self._run(accuracy, stop, seconds, iterations)
            seconds += result.solve_time
            iterations += result.iterations
            impulses = self._scale * np.asarray(result.x)
            if np.isfinite(impulses).all():
                residual = judge(self._problem, impulses, Model.CONVEX).residual
                if residual < best_residual:
                    best, best_residual = impulses, residual
            if best_residual <= stop.tolerance:
                return Solution(best, Status.SOLVED, iterations)
            limit = _ENDED.get(result.status)
            if limit is None and result.status not in (
                clarabel.SolverStatus.Solved,
                clarabel.SolverStatus.AlmostSolved,
            ):
                ended = (Status.STALLED, f"Clarabel ended with {result.status} at residual {best_residual:.1e}")
                break
            if limit is not None or iterations >= stop.max_iterations or seconds >= stop.max_seconds:
                ended = (limit or Status.ITERATION_LIMIT, f"residual {best_residual:.1e} in the convex model")
                break
            accuracy *= TIGHTENING
            if accuracy < TIGHTEST:
                ended = (Status.STALLED, f"Clarabel's tolerances are at their floor, residual {best_residual:.1e}")
                break
        return Solution(best, ended[0], iterations, ended[1])

    def _run(self, accuracy: float, stop: Stop, seconds: float, iterations: int) -> Any:
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = accuracy
        settings.max_iter = max(1, min(200, stop.max_iterations - iterations))
        settings.time_limit = max(stop.max_seconds - seconds, 1e-3)
        program = clarabel.DefaultSolver(
            self._quadratic, self._linear, self._constraints, self._bounds, self._cones, settings
        )
        return program.solve()


def _cones(problem: ContactProblem, scale: float) -> tuple[Any, FloatArray, list[Any]]:
    """Return A, b and the cones of A y + s = b, s ∈ cones, for impulses Λ = scale · y.

    Λ_N ≥ 0 is implied by ‖Λ_T‖ ≤ μ Λ_N and is written out only where the cone does not say it; friction without any
    bound to speak of (a = μ = 0) is the equation Λ_T = 0.
    """
    layout = problem.layout
    rows, columns, values = [], [], []
    bounds: list[float] = []
    cones: list[Any] = []
    row_of_slot = np.full(layout.n_blocks * layout.width, -1)
    row_of_slot[layout.slot] = np.arange(problem.n_rows)
    lanes = row_of_slot.reshape(layout.n_blocks, layout.width)

    def add(kind: Any, entries: list[tuple[int, float]], offset: float) -> None:
        for column, value in entries:
            rows.append(len(bounds))
            columns.append(column)
            values.append(value)
        bounds.append(offset)
        if kind is not None:
            cones.append(kind)

    for block in range(layout.n_blocks):
        normal, tangents = int(lanes[block, 0]), [int(row) for row in lanes[block, 1:] if row >= 0]
        mu, fixed = float(layout.friction_coefficient[block]), float(layout.fixed_bound[block]) / scale
        if normal >= 0 and (fixed > 0.0 or mu == 0.0 or not tangents):
            add(clarabel.NonnegativeConeT(1), [(normal, -1.0)], 0.0)
        if tangents and mu == 0.0 and fixed == 0.0:
            for row in tangents:
                add(clarabel.ZeroConeT(1), [(row, 1.0)], 0.0)
        elif tangents:
            add(None, [(normal, -mu)] if mu > 0.0 else [], fixed)
            for row in tangents:
                add(None, [(row, -1.0)], 0.0)
            cones.append(clarabel.SecondOrderConeT(1 + len(tangents)))
    constraints = sp.csc_matrix((values, (rows, columns)), shape=(len(bounds), problem.n_rows))
    return constraints, np.array(bounds), cones
