"""Runs of an interior point method within one solve.

An iterate that is stuck near the boundary of a cone may move again from the inside. A run that stalls is therefore
followed by another one from the best Λ; the solve ends with the first run that finds no better Λ, because the next
would repeat it. If other methods follow, a single run is enough, and it ends when its steps become negligible.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Stop
from ..iteration.loop import infeasible_solution, initial_impulses
from ..iteration.method import Method
from .progress import Progress

NEGLIGIBLE_STEP = 1e-9
"""Steps below this fraction of a Newton step are negligible."""


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
        """Continue from the best Λ until the progress has ended."""

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Run until the residual reaches the tolerance or a run fails to reduce it; see ``Prepared.solve``."""
        progress = self.begin(stop, start, observe, 0.0)
        while progress is not None and progress.may_run():
            self.run(progress)
        return infeasible_solution(self.problem) if progress is None else progress.solution()

    def solve_in_one_run(
        self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None
    ) -> Solution:
        """Do a single run."""
        progress = self.begin(stop, start, observe, NEGLIGIBLE_STEP)
        if progress is not None and progress.outcome is None:
            self.run(progress)
        return infeasible_solution(self.problem) if progress is None else progress.solution()

    def begin(self, stop: Stop, start: FloatArray | None, observe: Observer | None, shortest: float) -> Progress | None:
        """Begin a solve; return its progress, None if the problem is infeasible.

        Steps below the fraction ``shortest`` of a Newton step are negligible.
        """
        first = initial_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return None
        return Progress(self.problem, self.residual, stop, observe, flops=self.flops, first=first, shortest=shortest)


class InteriorMethod(Method, ABC):
    """An interior point method."""

    @abstractmethod
    def prepare(self, problem: ContactProblem) -> PreparedRuns:
        """Do the work that depends on the problem alone."""


@dataclass(frozen=True)
class SingleRun(Method):
    """The first run of an interior point method, under the name of the method."""

    method: InteriorMethod

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.method.name

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return self.method.supports(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedSingleRun":
        """Prepare the method."""
        return PreparedSingleRun(self.method.prepare(problem))


@dataclass(frozen=True, eq=False)
class PreparedSingleRun:
    """A prepared method that does one run."""

    method: PreparedRuns

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Run once; see ``Prepared.solve``."""
        return self.method.solve_in_one_run(stop, start, observe)
