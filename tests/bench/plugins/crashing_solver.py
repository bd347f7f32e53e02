"""A solver that fails only at fine tolerances."""

from dataclasses import dataclass
from typing import Any, ClassVar

from proxbench.problems import ContactProblem
from proxbench.solvers import Model, Solution, Stop, create


@dataclass
class CrashingBelow:
    """SORprox that raises an exception below ``tolerance`` if more than 1000 iterations are allowed."""

    tolerance: float
    problem: ContactProblem | None = None

    model: ClassVar[Model] = Model.COULOMB
    name: ClassVar[str] = "CrashingBelow"

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> Any:
        return CrashingBelow(self.tolerance, problem)

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        assert self.problem is not None
        if stop.tolerance < self.tolerance and stop.max_iterations > 1000:
            raise RuntimeError("too fine")
        return create("SORprox").prepare(self.problem).solve(stop)
