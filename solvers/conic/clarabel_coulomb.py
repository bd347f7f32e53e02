"""Coulomb friction by the fixed point of ``fixed_point`` over Clarabel's solutions of the convex model."""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.judge import Residual
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..interface import SolverError
from ..iteration.correction import BeginCorrection, NoCorrection
from .clarabel_socp import check_form, obstacle
from .fixed_point import PreparedFixedPoint, check_memory
from .programs import Form, conic_program


@dataclass(frozen=True)
class ClarabelCoulomb:
    """Exact Coulomb friction by a fixed point over Clarabel's solutions of the convex model.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.
        memory: pairs that Anderson acceleration of the outer iteration remembers; 0 leaves it plain.

    Raises:
        SolverError: for an option out of range.
    """

    form: Form = "delassus"
    memory: int = 5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_form(self.form)
        check_memory(self.memory)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem, self.form)

    def prepare(self, problem: ContactProblem) -> PreparedFixedPoint:
        """Set the program up, once for all outer iterations."""
        return self.prepare_corrected(problem, NoCorrection)

    def prepare_corrected(self, problem: ContactProblem, begin: BeginCorrection) -> PreparedFixedPoint:
        """See ``iteration.correction``."""
        reason = self.supports(problem)
        if reason:
            raise SolverError(f"{self.name} cannot treat {problem.name!r}: {reason}.")
        residual = Residual(problem)
        program = conic_program(problem, self.form)
        return PreparedFixedPoint(problem, residual, program, self.memory, begin)
