"""FBF: forward–backward–forward splitting of De Saxcé's formulation (Tseng 2000; Song, Fan, Ascher & Pai, SCA 2026).

The method solves A(Λ) + B(Λ) ∋ 0, where A(Λ) = GΛ + c + N_K(Λ) is monotone and De Saxcé's term B(Λ) = μ‖ξ_T‖ e_N is
not. K is the product of the friction cones, and P_K the projection onto it:

    Λ̃ = argmin over K of  ½ Λᵀ(G + I/γ)Λ + (c + B(Λ_k) − Λ_k/γ)ᵀΛ,      Λ_{k+1} = P_K(Λ̃ − γ (B(Λ̃) − B(Λ_k))),

Block sweeps compute the argmin. The step γ must stay below the inverse of the Lipschitz constant of B. The method
reduces γ while γ‖B(Λ̃) − B(Λ_k)‖ exceeds 0.9 ‖Λ̃ − Λ_k‖.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from proxbench.problems import ContactProblem, Model
from proxbench.problems.arrays import FloatArray
from proxbench.problems.contact.matrices.delassus import blocks_from_matrix
from proxbench.problems.contact.residual import convex_obstacle
from proxbench.solvers import Prepared, iterate, name_with_options
from proxbench.solvers.iteration.method import unsupported_laws
from proxbench.solvers.sweeps.cone import ConeProblem

INNER_SWEEPS = 20
"""Block sweeps for each Λ̃."""

FIRST_STEP = 0.5
"""γ₀ relative to 1/(μ_max λ_max(G))."""

MAX_RATIO, REDUCTION = 0.9, 0.7
"""The largest accepted γ‖ΔB‖/‖ΔΛ‖, and the factor that reduces γ if the ratio is larger."""


@dataclass(frozen=True)
class FBF:
    """Forward–backward–forward splitting; one iteration is one step of the splitting with its inner sweeps."""

    model = Model.COULOMB
    name = property(name_with_options)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return unsupported_laws(problem) or convex_obstacle(problem)

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Assemble G and estimate its largest eigenvalue."""
        cone = ConeProblem.of(problem)
        sweep = ConeSweep(cone)
        steepest = float(cone.layout.friction_coefficient.max(initial=0.0)) * cone.largest_eigenvalue()
        step = FIRST_STEP / steepest if steepest > 0.0 else 1.0
        return iterate(problem, lambda start: (cone.size * x for x in _steps(cone, sweep, step, start / cone.size)))


class ConeSweep:
    """Block sweeps that minimise ½ xᵀ(G + w I) x + qᵀx over K by a projected gradient step for each contact in turn.

    x_i ← P_{K_i}( x_i − (row i of the gradient) / (β_i + w) ), with β_i at least the largest eigenvalue of block ii.
    """

    def __init__(self, cone: ConeProblem) -> None:
        self._cone, blocks = cone, blocks_from_matrix(cone.matrix, cone.layout)
        own = blocks.values[blocks.starts[:-1]]
        self._curvature = np.abs(own).sum(axis=2).max(axis=1, initial=0.0)
        self._matrix = (blocks.starts, blocks.columns, blocks.values)

    def run(self, count: int, x: FloatArray, linear: FloatArray, weight: float) -> FloatArray:
        """Return x after ``count`` sweeps, with q = ``linear``, both of shape (n_rows,), and w = ``weight``."""
        layout, padded = self._cone.layout, self._cone.layout.pad(x)
        laws = (layout.friction_coefficient, self._cone.fixed_bound)
        _sweep(count, *self._matrix, self._curvature, *laws, weight, layout.pad(linear), padded)
        return layout.unpad(padded)


def _steps(cone: ConeProblem, sweep: ConeSweep, step: float, start: FloatArray) -> Iterator[FloatArray]:
    x = start
    lifted = cone.lift(cone.matrix @ x + cone.free)
    while True:
        middle = sweep.run(INNER_SWEEPS, x, cone.free + lifted - x / step, 1.0 / step)
        change = cone.lift(cone.matrix @ middle + cone.free) - lifted
        if step * np.linalg.norm(change) > MAX_RATIO * np.linalg.norm(middle - x):
            step *= REDUCTION
        else:
            x = cone.projected(middle - step * change)
            lifted = cone.lift(cone.matrix @ x + cone.free)
        yield x


@njit
def _sweep(count, starts, columns, values, curvature, friction, fixed, weight, linear, x):  # type: ignore[no-untyped-def]
    width = x.shape[1]
    moved = np.empty(width)
    for _ in range(count):
        for i in range(len(curvature)):
            if curvature[i] + weight <= 0.0:
                continue
            length = 0.0
            for lane in range(width):
                slope = linear[i, lane] + weight * x[i, lane]
                for p in range(starts[i], starts[i + 1]):
                    for other in range(width):
                        slope += values[p, lane, other] * x[columns[p], other]
                moved[lane] = x[i, lane] - slope / (curvature[i] + weight)
                length += moved[lane] * moved[lane] if lane > 0 else 0.0
            length, normal = np.sqrt(length), moved[0]
            if length > fixed[i] + friction[i] * normal:
                normal = (normal + friction[i] * (length - fixed[i])) / (1.0 + friction[i] * friction[i])
            normal = max(normal, 0.0)
            bound = fixed[i] + friction[i] * normal
            x[i, 0] = normal
            for lane in range(1, width):
                x[i, lane] = moved[lane] * (bound / length if length > bound else 1.0)


SOLVERS = [FBF]
