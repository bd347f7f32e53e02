"""JORprox and Jprox: projected Jacobi (over-)relaxation (Studer & Glocker 2005, [46], [51–53]); see ``sweeps.jacobi``.

With r_i = 1/α_i and G_ii = α_i I + B_i, the argument of the prox is −1/α_i ( Σ_{j≠i} G_ij Λ_j + c_i + B_i Λ_i ), which
is the form [46] of Jprox.
"""

from dataclasses import dataclass
from functools import partial

from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method
from ..sweeps.delassus import DelassusSweep
from ..sweeps.jacobi import JacobiIterates
from ..sweeps.step_size import StepSize, check_options, compute_step_sizes, row_sums_of_blocks


@dataclass(frozen=True)
class JORprox(Method):
    """Projected Jacobi over-relaxation.

    Attributes:
        step_size: r from the "diagonal" [52] or from the "row_sum" [53] of G.
        relaxation: ω; problems with many contacts need values well below 1.

    Raises:
        SolverError: if an option is out of range.
    """

    step_size: StepSize = "diagonal"
    relaxation: float = 1.0

    def __post_init__(self) -> None:
        check_options(self.step_size, self.relaxation)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        self.check_supports(problem)
        step_sizes = compute_step_sizes(problem, self.step_size, self.relaxation, row_sums_of_blocks)
        sweep = DelassusSweep.over(problem, step_sizes)
        return PreparedIteration(problem, Residual(problem), partial(JacobiIterates, sweep))


@dataclass(frozen=True)
class Jprox(Method):
    """Projected Jacobi [46]: JORprox with r_i = 1/α_i, the paper's first and simplest method."""

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        return JORprox().prepare(problem)
