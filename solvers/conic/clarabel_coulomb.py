"""ClarabelCoulomb: Coulomb friction by the fixed point of ``fixed_point``, with Clarabel for the cone programs."""

from dataclasses import dataclass

from ...problems.contact.problem import ContactProblem
from ..iteration.method import check_form
from .fixed_point import FixedPointMethod, check_memory
from .programs import ClarabelProgram, Form, unsupported_reason


@dataclass(frozen=True)
class ClarabelCoulomb(FixedPointMethod):
    """Exact Coulomb friction by a fixed point over Clarabel's solutions of the convex model.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.
        memory: number of pairs that Anderson acceleration of the outer iteration keeps, 0 for no acceleration.

    Raises:
        SolverError: if an option is out of range.
    """

    form: Form = "delassus"
    memory: int = 5

    def __post_init__(self) -> None:
        check_form(self.form)
        check_memory(self.memory)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or unsupported_reason(problem, self.form)

    def program(self, problem: ContactProblem) -> ClarabelProgram:
        """Return the program of ``problem``, set up for Clarabel."""
        return ClarabelProgram(problem, self.form)
