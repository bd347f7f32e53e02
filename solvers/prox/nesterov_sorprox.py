"""NesterovSORprox: SORprox with ω = 1 and momentum that is begun again where the way turns (``restarted_momentum``)."""

from dataclasses import dataclass

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method
from ..iteration.restarted_momentum import RestartedMomentum
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.step_size import diagonal_step_sizes


@dataclass(frozen=True)
class NesterovSORprox(Method):
    """SORprox over the Delassus matrix with Nesterov's momentum, which needs no number that suits the problem."""

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        sweep = DelassusSweep.over(problem, diagonal_step_sizes(problem, 1.0))

        def begin(start: FloatArray) -> RestartedMomentum:
            return RestartedMomentum(DelassusIterates(sweep, start))

        return PreparedIteration(problem, Residual(problem), begin)
