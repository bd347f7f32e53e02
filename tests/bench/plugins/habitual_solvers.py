"""SORprox with differences between first and repeated solves, for tests."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numba import njit
from proxbench.problems import ContactProblem
from proxbench.solvers import Model, Solution, Stop, create

STOP = Stop(1e-6, max_seconds=30.0)
"""Stopping criterion of timed solves."""


@njit(cache=True)
def sorted_sum(numbers: Any) -> Any:
    """Return the sum of some numbers in ascending order, with a kernel that no other solver uses."""
    return np.sort(numbers).sum()


@dataclass
class Wrapped:
    """SORprox whose first solves differ from repeated ones.

    ``habit`` is "remember" (return the previous answer to a problem), "compile" (take long in the first timed solve of
    a process), or "load" (load a kernel for problems whose ``directions`` are ``sides``).
    """

    habit: str = ""
    sides: tuple[float, ...] = ()

    model: ClassVar[Model] = Model.COULOMB
    name: ClassVar[str] = "Wrapped"

    @cached_property
    def kept(self) -> dict[Any, Solution]:
        return {}

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> Any:
        return Ready(self, problem)


def directions(problem: ContactProblem) -> tuple[float, ...]:
    """Return the velocities of the first contact divided by the first of them; these ratios do not depend on units."""
    velocities = problem.free_velocity[:3]
    return tuple((velocities / velocities[0]).tolist())


@dataclass
class Ready:
    solver: Wrapped
    problem: ContactProblem

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        habit, kept = self.solver.habit, self.solver.kept
        if habit == "load" and np.allclose(directions(self.problem), self.solver.sides, rtol=1e-9):
            sorted_sum(self.problem.free_velocity)
        key = self.problem.digest if habit == "remember" else "compiled"
        if habit == "compile" and stop == STOP and key not in kept:
            for _ in range(100):
                kept[key] = self.solved(stop)
        if habit == "remember" and key in kept:
            return kept[key]
        found = self.solved(stop)
        if habit == "remember":
            kept[key] = found
        return found

    def solved(self, stop: Stop) -> Solution:
        return create("SORprox").prepare(self.problem).solve(stop)
