"""Solvers that cheat with their answers or iteration counts; decision 14 describes each of them."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from proxbench.bench.store.plans import Limits
from proxbench.problems import ContactProblem, load
from proxbench.solvers import Model, Solution, Status, Stop, create

BOX, LARGE = "hard-sticking-box", "funnel-1000"

SHORT = Limits(solve_seconds=0.02, case_seconds=120.0)


class Honest:
    """SORprox under another name, the base class of the cheats.

    Attributes:
        tried_on: the problem that it is measured on.
        limits: limits of its case.
    """

    model: ClassVar[Model] = Model.COULOMB
    tried_on: ClassVar[str] = "funnel-100"
    limits: ClassVar[Limits] = Limits(solve_seconds=30.0, case_seconds=120.0)

    @classmethod
    def made(cls, folder: str) -> Self:
        """Return a solver that may store files in a folder."""
        return cls()

    @property
    def name(self) -> str:
        return type(self).__name__

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> Any:
        return Prepared(self, problem)

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        return create("SORprox").prepare(problem).solve(stop, observe=observe)


@dataclass
class Prepared:
    solver: Any
    problem: ContactProblem

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        return self.solver.solve(self.problem, stop, observe)


class OnBox(Honest):
    """A solver that is measured on the problem with a known answer."""

    tried_on = BOX


class SometimesZero(OnBox):
    """Returns zero in some solves, but never in the last ones of a round."""

    is_randomised = True

    def __init__(self) -> None:
        self.count = 0

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        self.count += 1
        if observe is None and self.count % 10 in (4, 5, 6):
            return Solution(np.zeros(problem.n_rows), Status.SOLVED, 1)
        return super().solve(problem, stop, observe)


class Jittering(OnBox):
    def __init__(self, is_randomised: bool = False) -> None:
        self.count, self.is_randomised = 0, is_randomised

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        self.count += 1
        found = super().solve(problem, stop, observe)
        return Solution(found.impulses * (1.0 + 1e-15 * (self.count % 3)), found.status, found.iterations)


class Late(OnBox):
    limits = SHORT

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        time.sleep(3.0 * stop.max_seconds)
        return super().solve(problem, Stop(stop.tolerance, stop.max_iterations), observe)


class LateInPrepare(OnBox):
    limits = SHORT

    def prepare(self, problem: ContactProblem) -> Any:
        time.sleep(0.06)
        return super().prepare(problem)


class FewIterations(Honest):
    tried_on = "funnel-30"

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        found = super().solve(problem, stop, observe)
        return Solution(found.impulses, found.status, found.iterations // 10)


class LazySolution(Solution):
    """A subclass of ``Solution``, which could compute its values later."""


ANSWERS: dict[str, Callable[[int], Solution]] = {
    "Hopeless": lambda n_rows: Solution(np.zeros(n_rows), Status.INFEASIBLE, 1),
    "Lazy": lambda n_rows: LazySolution(np.zeros(n_rows), Status.SOLVED, 1),
}
"""The answers of some cheats to every problem, by the names of the cheats."""


@dataclass
class Answering(OnBox):
    """Returns one of ``ANSWERS`` without solving."""

    name: str = ""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        return ANSWERS[self.name](problem.n_rows)


class Reader(OnBox):
    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known = problem.answer
        if known is None and problem.name.startswith("hard-"):
            known = load(problem.name).answer
        if known is None:
            return Solution(np.zeros(problem.n_rows), Status.SOLVED, 0)
        return Solution(known.impulses[0], Status.SOLVED, 0)


class Elsewhere(OnBox):
    """Finishes its answer in ``synchronise``, as a solver on a GPU does."""

    def prepare(self, problem: ContactProblem) -> Any:
        return PreparedElsewhere(self, problem)


@dataclass
class PreparedElsewhere(Prepared):
    array: Any = None
    found: Any = None

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        solution = super().solve(stop, start, observe)
        self.array, self.found = np.zeros_like(solution.impulses), solution.impulses
        return Solution(self.array, solution.status, solution.iterations)

    def synchronise(self) -> None:
        time.sleep(0.02)
        self.array[:] = self.found
