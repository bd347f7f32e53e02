"""Coulomb friction by the fixed point of ``fixed_point`` over Clarabel's solutions of the convex model."""

from dataclasses import dataclass

from ...problems.contact.problem import ContactProblem
from ..iteration.method import check_form
from .fixed_point import FixedPointMethod, check_memory
from .programs import ClarabelProgram, Form, obstacle


@dataclass(frozen=True)
class ClarabelCoulomb(FixedPointMethod):
    """Exact Coulomb friction by a fixed point over Clarabel's solutions of the convex model.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.
        memory: pairs that Anderson acceleration of the outer iteration remembers; 0 leaves it plain.

    Raises:
        SolverError: for an option out of range.
    """

    form: Form = "delassus"
    memory: int = 5

    def __post_init__(self) -> None:
        check_form(self.form)
        check_memory(self.memory)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem, self.form)

    def program(self, problem: ContactProblem) -> ClarabelProgram:
        """Return the program in the form."""
        return ClarabelProgram(problem, self.form)
