"""Runs of an interior point method within one solve.

An iterate that is stuck near the boundary of a cone may move again after a step to the inside. A run that stalls is
therefore followed by another run: from zero if it began at a given start, otherwise from the best Λ. The solve ends
with the first run that finds no better Λ, because the next run would repeat it. If other methods follow, a single run
is enough, and it ends when its steps become negligible.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Literal

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Stop, check_stop
from ..iteration.loop import infeasible_solution, initial_impulses
from ..iteration.method import Method, check_form
from .progress import Progress
from .scaled_problem import ScaledProblem
from .systems.body_system import BodySystem
from .systems.delassus_system import DelassusSystem

NEGLIGIBLE_STEP = 1e-9
"""Steps below this fraction of a Newton step are negligible."""

NewtonSystem = DelassusSystem | BodySystem
"""The Newton system of one problem, over contacts or over bodies."""


class InteriorMethod(Method, ABC):
    """An interior point method.

    Attributes:
        form: "delassus" factorises over contacts with the assembled G, "factors" over bodies with W and M⁻¹.
    """

    form: Literal["delassus", "factors"]

    def __post_init__(self) -> None:
        check_form(self.form)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        if self.form == "factors" and problem.factors is None:
            return "the problem holds G only, and form='factors' needs the factors W and M⁻¹"
        return super().supports(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedRuns":
        """Scale the problem, assemble what the form needs, and order the factorisation."""
        self.check_supports(problem)
        residual = Residual(problem)
        scaled_problem = ScaledProblem(problem, residual)
        system = (
            BodySystem(problem, scaled_problem) if self.form == "factors" else DelassusSystem(problem, scaled_problem)
        )
        return PreparedRuns(self, problem, residual, scaled_problem, system)

    @abstractmethod
    def run(self, prepared: "PreparedRuns", progress: Progress) -> None:
        """Continue from the best Λ until ``progress`` has an outcome."""


@dataclass(frozen=True, eq=False)
class PreparedRuns:
    """The scaled problem and its ordered factorisation; a solve has several runs, or one if ``has_single_run``."""

    method: InteriorMethod
    problem: ContactProblem
    residual: Residual = field(repr=False)
    scaled_problem: ScaledProblem = field(repr=False)
    system: NewtonSystem = field(repr=False)
    has_single_run: bool = False

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Run until the residual reaches the tolerance or a run fails to reduce it; see ``Prepared.solve``."""
        progress = self.begin(stop, start, observe, NEGLIGIBLE_STEP if self.has_single_run else 0.0)
        if progress is None:
            return infeasible_solution(self.problem)
        while progress.may_run():
            self.method.run(self, progress)
            if self.has_single_run:
                break
        return progress.solution()

    def begin(self, stop: Stop, start: FloatArray | None, observe: Observer | None, shortest: float) -> Progress | None:
        """Begin a solve; return its progress, or None if the problem is infeasible.

        Steps below the fraction ``shortest`` of a Newton step are negligible.
        """
        check_stop(stop)
        first, flops = initial_impulses(self.problem, self.residual, start), self.system.flops
        if self.residual.infeasible:
            return None
        is_warm = bool(first.any()) and not self.has_single_run
        return Progress(
            self.problem, self.residual, stop, observe, flops=flops, first=first, shortest=shortest, is_warm=is_warm
        )


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

    def prepare(self, problem: ContactProblem) -> PreparedRuns:
        """Prepare the method."""
        return replace(self.method.prepare(problem), has_single_run=True)
