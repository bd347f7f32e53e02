"""The runs that a solve by interior points is made of.

What no longer moves near the boundary of a cone may move again from the inside. So a run that stalls is followed by
one from the best Λ, and only one that brings no better Λ ends the solve: another from there would do the same.
Where other methods take over a single run is enough, and ends where its steps hardly move.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Stop
from ..iteration.loop import first_impulses, refuted
from ..iteration.method import Method
from .progress import Progress

HARDLY = 1e-9
"""Steps below this fraction of a Newton step hardly move."""


class PreparedRuns(ABC):
    """An interior point method made ready for one problem.

    Attributes:
        problem: the problem.
        residual: its residual.
    """

    problem: ContactProblem
    residual: Residual

    @property
    @abstractmethod
    def flops(self) -> float:
        """Multiplications and additions of one factorisation."""

    @abstractmethod
    def run(self, progress: Progress) -> None:
        """Go on from the best Λ until the progress has ended."""

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Run until the residual reaches the tolerance, or a run brings nothing; see ``Prepared.solve``."""
        progress = self.begun(stop, start, observe, 0.0)
        while progress is not None and progress.goes_on():
            self.run(progress)
        return refuted(self.problem) if progress is None else progress.solution()

    def solve_in_one(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Do the same in one run."""
        progress = self.begun(stop, start, observe, HARDLY)
        if progress is not None and progress.ended is None:
            self.run(progress)
        return refuted(self.problem) if progress is None else progress.solution()

    def begun(self, stop: Stop, start: FloatArray | None, observe: Observer | None, shortest: float) -> Progress | None:
        """Return the progress of a solve that begins, None if the problem is infeasible.

        Steps below the fraction ``shortest`` of a Newton step hardly move.
        """
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return None
        return Progress(self.problem, self.residual, stop, observe, self.flops, first, shortest)


class InRuns(Method, ABC):
    """An interior point method."""

    @abstractmethod
    def prepare(self, problem: ContactProblem) -> PreparedRuns:
        """Do what depends on the problem alone."""


@dataclass(frozen=True)
class SingleRun(Method):
    """The first run of an interior point method, by its name."""

    method: InRuns

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.method.name

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return self.method.supports(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedSingleRun":
        """Prepare the method."""
        return PreparedSingleRun(self.method.prepare(problem))


@dataclass(frozen=True, eq=False)
class PreparedSingleRun:
    """A method of which one run is done."""

    method: PreparedRuns

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Run once; see ``Prepared.solve``."""
        return self.method.solve_in_one(stop, start, observe)
