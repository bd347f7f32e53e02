"""FBF: forward–backward–forward splitting of De Saxcé's formulation (Tseng 2000; Song, Fan, Ascher & Pai, SCA 2026).

With A(Λ) = GΛ + c + N_K(Λ), which is monotone, and De Saxcé's term B(Λ) = μ‖ξ_T‖ e_N, which is not, solve A + B ∋ 0 by

    Λ̃ = argmin over K of  ½ Λᵀ(G + I/γ)Λ + (c + B(Λ_k) − Λ_k/γ)ᵀΛ,      Λ_{k+1} = P_K(Λ̃ − γ (B(Λ̃) − B(Λ_k))),

the argmin by block sweeps. The step γ has to stay below the inverse of B's Lipschitz constant: it is cut as long as
γ‖B(Λ̃) − B(Λ_k)‖ exceeds 0.9 ‖Λ̃ − Λ_k‖.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle
from ..iteration.loop import PreparedIteration, iterate
from ..iteration.method import Method, beyond_contacts
from ..sweeps.cone import ConeProblem, ConeSweep

INNER_SWEEPS = 20
"""Block sweeps for each Λ̃."""

FIRST_STEP = 0.5
"""γ₀ relative to 1/(μ_max λ_max(G))."""

ACCEPTED, CUT = 0.9, 0.7
"""The largest γ‖ΔB‖/‖ΔΛ‖ that is accepted, and what γ is multiplied with if it is larger."""


@dataclass(frozen=True)
class FBF(Method):
    """Forward–backward–forward splitting; one iteration is one step of the splitting with its inner sweeps."""

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return beyond_contacts(problem) or convex_obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and estimate its largest eigenvalue."""
        self.check_supports(problem)
        cone = ConeProblem.of(problem)
        sweep = ConeSweep(cone)
        steepest = float(cone.layout.friction_coefficient.max(initial=0.0)) * cone.largest_eigenvalue()
        step = FIRST_STEP / steepest if steepest > 0.0 else 1.0
        return iterate(problem, lambda start: (cone.size * x for x in _steps(cone, sweep, step, start / cone.size)))


def _steps(cone: ConeProblem, sweep: ConeSweep, step: float, start: FloatArray) -> Iterator[FloatArray]:
    x = start
    lifted = cone.lift(cone.matrix @ x + cone.free)
    while True:
        middle = sweep.swept(INNER_SWEEPS, x, cone.free + lifted - x / step, 1.0 / step)
        change = cone.lift(cone.matrix @ middle + cone.free) - lifted
        if step * np.linalg.norm(change) > ACCEPTED * np.linalg.norm(middle - x):
            step *= CUT
        else:
            x = cone.projected(middle - step * change)
            lifted = cone.lift(cone.matrix @ x + cone.free)
        yield x
