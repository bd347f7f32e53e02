"""Start from zero."""

from dataclasses import dataclass

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Observer, Prepared, Solution, Stop
from .step_solver import StepSolver


class Cold(StepSolver):
    """Each solve starts from zero impulses; those of the last step are not used."""

    name = "cold"

    def _prepared(self, problem: ContactProblem) -> Prepared:
        return _FromZero(self.solver.prepare(problem))


@dataclass(frozen=True)
class _FromZero:
    prepared: Prepared

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        return self.prepared.solve(stop, None, observe)
