"""Solvers with known times, to test the times that the harness charges; child processes import this module."""

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from proxbench.problems import ContactProblem
from proxbench.problems.arrays import FloatArray
from proxbench.solvers import Model, Observer, Solution, Status, Stop


@dataclass(frozen=True)
class Known:
    """Returns zeros after computing for a known time; the message contains the seconds of both parts.

    Attributes:
        prepare_seconds: busy time of ``prepare`` [s]; 0 returns immediately.
        solve_seconds: busy time of ``solve`` [s]; 0 returns immediately.
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
        return PreparedKnown(problem.n_rows, kept_busy(self.prepare_seconds), self.solve_seconds)


@dataclass(frozen=True)
class PreparedKnown:
    n_rows: int
    prepared_in: float
    seconds: float

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        message = f"{self.prepared_in} {kept_busy(self.seconds)}"
        return Solution(np.zeros(self.n_rows), Status.SOLVED, 0, message)


def kept_busy(seconds: float) -> float:
    """Count until the time has passed; return the elapsed time by another clock than that of the harness [s].

    It takes longer than the given time if other programs interrupt it.
    """
    began = time.monotonic_ns()
    while time.monotonic_ns() < began + 1e9 * seconds:
        pass
    return 1e-9 * (time.monotonic_ns() - began) if seconds else 0.0
