"""AdaptiveSORprox: SORprox with the safeguard of ``sweeps.safeguarded`` and an ω that adapts (``relaxation``).

Contacts that oscillate give up part of their steps, each by itself, and ω follows the rate of all: over-relaxation
where sweeps are slow and only there, without a choice that has to suit every problem.
"""

from dataclasses import dataclass

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method
from ..iteration.relaxation import AdaptiveRelaxation
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import diagonal_step_sizes, lane_weights


@dataclass(frozen=True)
class AdaptiveSORprox(Method):
    """SORprox over the Delassus matrix, whose relaxation follows the rate of convergence, from ω = 1 to 1.9."""

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes for ω = 1."""
        sizes = diagonal_step_sizes(problem, 1.0)
        sweep, weights = DelassusSweep.over(problem, sizes), lane_weights(problem.layout, sizes)

        def begin(start: FloatArray) -> AdaptiveIterates:
            return AdaptiveIterates(AdaptiveRelaxation(DelassusIterates(sweep, start), weights))

        return PreparedIteration(problem, Residual(problem), begin)


class AdaptiveIterates(SafeguardedIterates):
    """Safeguarded iterates whose relaxation adapts."""

    def __init__(self, iterates: AdaptiveRelaxation) -> None:
        super().__init__(iterates)
        self._relaxation = iterates

    def reduce_acceleration(self) -> bool:
        """See ``AdaptiveRelaxation``; contacts that oscillated with a larger ω are given their steps back."""
        is_less = self._relaxation.reduce_acceleration()
        if is_less:
            self.restore_steps()
        return is_less
