"""SafeguardedSORprox: SORprox whose contacts give up over-relaxation one by one where they oscillate."""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.contact.judge import Residual
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..iteration.loop import PreparedIteration
from ..sweeps.delassus import DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes


@dataclass(frozen=True)
class SafeguardedSORprox:
    """SORprox over the Delassus matrix, with the step size of each contact cut where its impulses oscillate.

    Attributes:
        relaxation: ω that every contact begins with.

    Raises:
        SolverError: for an option out of range.
    """

    relaxation: float = 1.5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the first step sizes."""
        sizes = diagonal_step_sizes(problem, self.relaxation)
        sweep = DelassusSweep.over(problem, problem.delassus_blocks(), sizes)
        return PreparedIteration(problem, Residual(problem), lambda start: SafeguardedIterates(sweep.iterates(start)))
