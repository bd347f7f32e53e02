"""SORprox over the Delassus matrix with ω = 1 and an acceleration: two methods with different accelerations.

    NesterovSORprox     momentum by Nesterov's sequence, with restarts      (``iteration.momentum``)
    AndersonSORprox     Anderson acceleration every three sweeps            (``iteration.anderson``)

``AndersonSORprox`` has the safeguard of ``sweeps.safeguarded``: the step of each contact that oscillates is reduced.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.anderson import AndersonSweeps
from ..iteration.loop import AcceleratedIterates, PreparedIteration
from ..iteration.method import Method, check_option
from ..iteration.momentum import RestartedMomentum
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import diagonal_step_sizes, lane_weights


class _AcceleratedSORprox(Method, ABC):
    """SORprox with an acceleration."""

    @abstractmethod
    def accelerate(self, iterates: DelassusIterates, weights: FloatArray) -> AcceleratedIterates:
        """Return the accelerated iterates; ``weights`` is √α of each lane of padded Λ."""

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes for ω = 1."""
        self.check_supports(problem)
        step_sizes = diagonal_step_sizes(problem, 1.0)
        sweep, weights = DelassusSweep.over(problem, step_sizes), lane_weights(problem.layout, step_sizes)

        def begin(start: FloatArray) -> AcceleratedIterates:
            return self.accelerate(DelassusIterates(sweep, start), weights)

        return PreparedIteration(problem, Residual(problem), begin)


@dataclass(frozen=True)
class NesterovSORprox(_AcceleratedSORprox):
    """SORprox over the Delassus matrix with Nesterov's momentum, which has no parameter to choose."""

    def accelerate(self, iterates: DelassusIterates, weights: FloatArray) -> AcceleratedIterates:
        """Add momentum."""
        return RestartedMomentum(iterates)


@dataclass(frozen=True)
class AndersonSORprox(_AcceleratedSORprox):
    """SORprox over the Delassus matrix with Anderson acceleration every three sweeps or less often.

    Attributes:
        memory: number of differences between windows to keep, 0 for no acceleration.

    Raises:
        SolverError: if an option is out of range.
    """

    memory: int = 5

    def __post_init__(self) -> None:
        is_valid = type(self.memory) is int and 0 <= self.memory <= 50
        check_option("memory", self.memory, is_valid, "a whole number from 0 to 50")

    def accelerate(self, iterates: DelassusIterates, weights: FloatArray) -> AcceleratedIterates:
        """Add the safeguard, then the acceleration."""
        return AndersonSweeps(SafeguardedIterates(iterates), weights, self.memory)
