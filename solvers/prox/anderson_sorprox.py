"""AndersonSORprox: SORprox with ω = 1, the safeguard of ``sweeps.safeguarded``, and mixing (``iteration.mixing``)."""

from dataclasses import dataclass

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method, check_option
from ..iteration.mixing import MixedIterates
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import diagonal_step_sizes, lane_weights


@dataclass(frozen=True)
class AndersonSORprox(Method):
    """SORprox over the Delassus matrix with Anderson acceleration every three sweeps.

    Attributes:
        memory: differences between windows that are mixed, 0 for none.

    Raises:
        SolverError: for an option out of range.
    """

    memory: int = 5

    def __post_init__(self) -> None:
        is_valid = type(self.memory) is int and 0 <= self.memory <= 50
        check_option("memory", self.memory, is_valid, "a whole number from 0 to 50")

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        sizes = diagonal_step_sizes(problem, 1.0)
        sweep, weights = DelassusSweep.over(problem, sizes), lane_weights(problem.layout, sizes)

        def begin(start: FloatArray) -> MixedIterates:
            return MixedIterates(SafeguardedIterates(DelassusIterates(sweep, start)), weights, self.memory)

        return PreparedIteration(problem, Residual(problem), begin)
