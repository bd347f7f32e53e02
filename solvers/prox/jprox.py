"""Jprox: the projected Jacobi iteration of Studer & Glocker 2005, [46], with the sweeps of ``sweeps.jacobi``.

With r_i = 1/α_i and G_ii = α_i I + B_i the argument of the prox reads −1/α_i ( Σ_{j≠i} G_ij Λ_j + c_i + B_i Λ_i ).
"""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.judge import Residual
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..iteration.loop import PreparedIteration
from ..sweeps.jacobi import JacobiIterates
from ..sweeps.step_size import diagonal_step_sizes


@dataclass(frozen=True)
class Jprox:
    """Projected Jacobi, [46]: JORprox with r_i = 1/α_i, the paper's first and simplest method."""

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """Class name."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        sizes = diagonal_step_sizes(problem, 1.0)
        return PreparedIteration(problem, Residual(problem), lambda start: JacobiIterates(problem, sizes, start))
