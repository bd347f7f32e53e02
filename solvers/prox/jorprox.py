"""JORprox: projected Jacobi over-relaxation (Studer & Glocker 2005, [51–53]), with the sweeps of ``sweeps.jacobi``."""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.judge import Residual
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..iteration.loop import PreparedIteration
from ..sweeps.jacobi import JacobiIterates
from ..sweeps.step_size import StepSize, check_options, diagonal_step_sizes, row_sum_step_sizes, row_sums_of_blocks


@dataclass(frozen=True)
class JORprox:
    """Projected Jacobi over-relaxation.

    Attributes:
        step_size: r by the "diagonal" [52] or by the "row_sum" [53] of G.
        relaxation: ω; many contacts need values well below 1.

    Raises:
        SolverError: for an option out of range.
    """

    step_size: StepSize = "diagonal"
    relaxation: float = 1.0

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_options(self.step_size, self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        if self.step_size == "diagonal":
            sizes = diagonal_step_sizes(problem, self.relaxation)
        else:
            sums = row_sums_of_blocks(problem.delassus_blocks(), problem)
            sizes = row_sum_step_sizes(problem, sums, self.relaxation)
        return PreparedIteration(problem, Residual(problem), lambda start: JacobiIterates(problem, sizes, start))
