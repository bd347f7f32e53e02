"""SORprox: the projected successive over-relaxation of Studer & Glocker 2005, [54, 55].

One sweep visits the laws in order and updates each with the newest impulses of the other laws,

    Λ_i ← prox_{C_i}( Λ_i − r_i ( Σ_{j<i} G_ij Λ_j^{ν+1} + Σ_{j≥i} G_ij Λ_j^ν + c_i ) ).

The unilateral law of a contact precedes its friction law, so the friction bound μ Λ_N is up to date.
"""

from dataclasses import dataclass
from typing import Literal

from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method, check_form
from ..iteration.momentum import Momentum, begin_with_momentum, check_momentum
from ..sweeps.batches.balls import BallSweep
from ..sweeps.delassus import DelassusSweep
from ..sweeps.factors import FactorSweep
from ..sweeps.step_size import StepSize, check_options, compute_step_sizes, row_sums_of_blocks, row_sums_of_factors


@dataclass(frozen=True)
class SORprox(Method):
    """Projected Gauss–Seidel with relaxation, the method that the paper prefers for many contacts.

    Attributes:
        step_size: r from the "diagonal" [52] or from the "row_sum" [53] of G.
        relaxation: ω; values between 1 and 2 accelerate systems with many contacts, values below 1 stabilise friction.
        form: sweep over the assembled "delassus" matrix, or over the "factors" W and M⁻¹, which update the generalised
            velocity and never assemble G. Both give the same iterates up to rounding.
        momentum: β, the fraction of the last change that is added before each sweep (see ``iteration.momentum``); 0 is
            the method of the paper. On a thousand flowing balls, ω = 1.2 with β = 0.75 needs half the sweeps of ω = 1.5
            without momentum. With "measured" and ω = 1.1, β follows the rate of convergence (see
            ``iteration.measured_momentum``).
        momentum_delay: d; after k sweeps, β is at most k/(k + d). With β = 0.8 and ω = 1.1, d = 4 needs fewer sweeps
            than d = 0 for loose tolerances, and about as many for tight ones.

    Raises:
        SolverError: if an option is out of range.
    """

    step_size: StepSize = "diagonal"
    relaxation: float = 1.0
    form: Literal["delassus", "factors"] = "delassus"
    momentum: Momentum = 0.0
    momentum_delay: float = 0.0

    def __post_init__(self) -> None:
        check_options(self.step_size, self.relaxation)
        check_form(self.form)
        check_momentum(self.momentum, self.momentum_delay)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        if self.form == "factors" and problem.factors is None:
            return "the problem holds G only, and form='factors' needs the factors W and M⁻¹"
        return super().supports(problem)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Compute the step sizes and assemble the data of the form."""
        self.check_supports(problem)
        sweep: DelassusSweep | FactorSweep | BallSweep
        if self.form == "factors":
            step_sizes = compute_step_sizes(problem, self.step_size, self.relaxation, row_sums_of_factors)
            sweep = BallSweep.over(problem, step_sizes) or FactorSweep.over(problem, step_sizes)
        else:
            step_sizes = compute_step_sizes(problem, self.step_size, self.relaxation, row_sums_of_blocks)
            sweep = DelassusSweep.over(problem, step_sizes)
        begin = begin_with_momentum(sweep.begin, self.momentum, self.momentum_delay)
        return PreparedIteration(problem, Residual(problem), begin)
