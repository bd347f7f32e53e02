"""The associated (convex) contact model as a second-order cone program, solved by Clarabel's interior point method.

Its optimality condition is −ξ ∈ N_K(Λ), which agrees with Coulomb's law where contacts stick or open; a sliding contact
separates with ξ_N = μ‖ξ_T‖ instead of staying closed. The programs are those of ``programs``. Clarabel: Goulart & Chen
2024.
"""

from dataclasses import dataclass
from typing import ClassVar, get_args

from ...problems.contact.judge import ModelResidual, convex_obstacle
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..interface import SolverError
from .convex import PreparedConvex
from .programs import Form, conic_program, factors_obstacle


def check_form(form: str) -> None:
    """Raise ``SolverError`` unless ``form`` is one of both."""
    if form not in get_args(Form):
        raise SolverError(f"form must be 'delassus' or 'factors', got {form!r}.")


def obstacle(problem: ContactProblem, form: Form) -> str | None:
    """Say why the cone program of ``problem`` does not exist in ``form``, or None."""
    if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
        return "G is not symmetric, so the convex model has no energy to minimise"
    return convex_obstacle(problem) or (factors_obstacle(problem) if form == "factors" else None)


@dataclass(frozen=True)
class ClarabelSOCP:
    """Clarabel on the convex model, through its direct interface.

    Its interior point iterates satisfy no force law, so they are not shown to observers.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.

    Raises:
        SolverError: for an unknown form.
    """

    form: Form = "delassus"

    model: ClassVar[Model] = Model.CONVEX
    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_form(self.form)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem, self.form)

    def prepare(self, problem: ContactProblem) -> "PreparedConvex":
        """Set the program up."""
        reason = self.supports(problem)
        if reason:
            raise SolverError(f"{self.name} cannot treat {problem.name!r}: {reason}.")
        residual = ModelResidual(problem, self.model)
        return PreparedConvex(problem, residual, conic_program(problem, self.form))
