"""Jprox: the projected Jacobi iteration of Studer & Glocker 2005, [46], with the sweeps of ``sweeps.jacobi``.

With r_i = 1/α_i and G_ii = α_i I + B_i the argument of the prox reads −1/α_i ( Σ_{j≠i} G_ij Λ_j + c_i + B_i Λ_i ).
"""

from dataclasses import dataclass

from ...problems.contact.problem import ContactProblem
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method
from .jorprox import JORprox


@dataclass(frozen=True)
class Jprox(Method):
    """Projected Jacobi, [46]: JORprox with r_i = 1/α_i, the paper's first and simplest method."""

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        return JORprox().prepare(problem)
