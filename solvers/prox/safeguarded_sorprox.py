"""SafeguardedSORprox: SORprox that reduces the over-relaxation of contacts that oscillate."""

from dataclasses import dataclass

from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes


@dataclass(frozen=True)
class SafeguardedSORprox(Method):
    """SORprox over the Delassus matrix, with a reduced step size for each contact whose impulses oscillate.

    Attributes:
        relaxation: initial ω of every contact.

    Raises:
        SolverError: if an option is out of range.
    """

    relaxation: float = 1.5

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the initial step sizes."""
        self.check_supports(problem)
        sweep = DelassusSweep.over(problem, diagonal_step_sizes(problem, self.relaxation))
        return PreparedIteration(
            problem, Residual(problem), lambda start: SafeguardedIterates(DelassusIterates(sweep, start))
        )
