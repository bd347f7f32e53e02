"""Solvers that look better than they are, each by one trick."""

import threading
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from proxbench.problems import ContactProblem, load
from proxbench.solvers import Model, Solution, Status, Stop, create


class Honest:
    """SORprox under another name, for tricks to begin from."""

    model: ClassVar[Model] = Model.COULOMB

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


class SometimesZero(Honest):
    """Answers zero in three of ten solves, never in the last ones of a round."""

    is_randomised = True

    def __init__(self) -> None:
        self.count = 0

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        self.count += 1
        if observe is None and self.count % 10 in (4, 5, 6):
            return Solution(np.zeros(problem.n_rows), Status.SOLVED, 1)
        return super().solve(problem, stop, observe)


class Jittering(Honest):
    """Changes the last bits of its answers from solve to solve."""

    def __init__(self, is_randomised: bool = False) -> None:
        self.count, self.is_randomised = 0, is_randomised

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        self.count += 1
        found = super().solve(problem, stop, observe)
        return Solution(found.impulses * (1.0 + 1e-15 * (self.count % 3)), found.status, found.iterations)


class Lazy(Honest):
    """Solves when its impulses are read."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        return LazySolution(np.zeros(problem.n_rows), Status.SOLVED, 1)


class LazySolution(Solution):
    """A solution that is a promise."""


class Late(Honest):
    """Takes longer than its limit, and says that it solved."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        time.sleep(3.0 * stop.max_seconds)
        return super().solve(problem, Stop(stop.tolerance, stop.max_iterations), observe)


class LateInPrepare(Honest):
    """Takes longer than its limit to prepare, and says that it solved."""

    def prepare(self, problem: ContactProblem) -> Any:
        time.sleep(0.06)
        return super().prepare(problem)


class Hopeless(Honest):
    """Says of every problem that it has no solution."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        return Solution(np.zeros(problem.n_rows), Status.INFEASIBLE, 1)


class Loose(Honest):
    """Solves to a thousand times the tolerance, and says that it solved."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        return super().solve(problem, Stop(1e3 * stop.tolerance, stop.max_iterations), observe)


class Disguised(Honest):
    """Returns impulses that show every reader what it wants."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        return Solution(np.zeros(problem.n_rows).view(Flattering), Status.SOLVED, 1)


class Flattering(np.ndarray):
    """An array of a kind of its own."""


class FewIterations(Honest):
    """Counts ten sweeps as one iteration."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        found = super().solve(problem, stop, observe)
        return Solution(found.impulses, found.status, found.iterations // 10)


class Reader(Honest):
    """Returns the known answer of a problem, from it or from the library under its name."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known = problem.answer
        if known is None and problem.name.startswith("hard-"):
            known = load(problem.name).answer
        if known is None:
            return Solution(np.zeros(problem.n_rows), Status.SOLVED, 0)
        return Solution(known.impulses[0], Status.SOLVED, 0)


class RemembersLaws(Honest):
    """Keeps its answers by the identity of the problem's laws; zero where it has none."""

    def __init__(self) -> None:
        self.kept: dict[int, Any] = {}
        self.seen: list[Any] = []

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        self.seen.append(problem.laws)  # so that no number is given twice
        key = id(problem.laws)
        if key in self.kept:
            raise AssertionError("the laws of one solve came again in another")
        self.kept[key] = super().solve(problem, stop, observe)
        return self.kept[key]


class Background(Honest):
    """Goes on in a thread when a call has returned."""

    def supports(self, problem: ContactProblem) -> str | None:
        threading.Thread(target=time.sleep, args=(60.0,), name="ahead", daemon=True).start()
        return None


class ChangesLater(Honest):
    """Returns its own array, and spoils it in the next call."""

    @cached_property
    def array(self) -> list[Any]:
        return []

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        for old in self.array:
            old[:] = 0.0
        found = super().solve(problem, stop, observe)
        self.array.append(found.impulses.copy())
        return Solution(self.array[-1], found.status, found.iterations)


class Elsewhere(Honest):
    """Works on when ``solve`` has returned, as on a GPU, and waits in ``synchronise``."""

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
