"""The associated (convex) contact model as a second-order cone program, solved by Clarabel's interior point method.

Its optimality condition is −ξ ∈ N_K(Λ), which agrees with Coulomb's law where contacts stick or open; a sliding contact
separates with ξ_N = μ‖ξ_T‖ instead of staying closed. The programs are those of ``programs``. Clarabel: Goulart & Chen
2024.
"""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ..iteration.method import check_form
from .convex import ConvexMethod
from .programs import ClarabelProgram, Form, obstacle


@dataclass(frozen=True)
class ClarabelSOCP(ConvexMethod):
    """Clarabel on the convex model, through its direct interface.

    Its interior point iterates satisfy no force law, so they are not shown to observers.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.

    Raises:
        SolverError: for an unknown form.
    """

    form: Form = "delassus"

    model: ClassVar[Model] = Model.CONVEX

    def __post_init__(self) -> None:
        check_form(self.form)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem, self.form)

    def program(self, problem: ContactProblem) -> ClarabelProgram:
        """Return the program in the form."""
        return ClarabelProgram(problem, self.form)
