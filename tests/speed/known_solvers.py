"""Solvers whose time is known, to see what the harness charges for them. Child processes import them from here."""

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from proxbench.problems import ContactProblem
from proxbench.problems.laws import FloatArray
from proxbench.solvers import Model, Observer, Solution, Status, Stop


@dataclass(frozen=True)
class Known:
    """Returns zeros after having kept the processor busy for a known time.

    Attributes:
        prepare_seconds: busy time of preparing [s]; 0 returns at once.
        solve_seconds: busy time of solving [s]; 0 returns at once.
    """

    prepare_seconds: float = 0.0
    solve_seconds: float = 0.0

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = False

    @property
    def name(self) -> str:
        return f"Known({self.prepare_seconds}, {self.solve_seconds})"

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> "PreparedKnown":
        if self.prepare_seconds:
            keep_busy(self.prepare_seconds)
        return PreparedKnown(Solution(np.zeros(problem.n_rows), Status.SOLVED, 0), self.solve_seconds)


@dataclass(frozen=True)
class PreparedKnown:
    solution: Solution
    seconds: float

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        if self.seconds:
            keep_busy(self.seconds)
        return self.solution


def keep_busy(seconds: float) -> None:
    """Count until the time has passed, by another clock than that of the harness."""
    end = time.monotonic_ns() + round(1e9 * seconds)
    while time.monotonic_ns() < end:
        pass
