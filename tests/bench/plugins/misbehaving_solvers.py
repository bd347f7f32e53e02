"""Solvers that break every rule, each in its own way, to be run in a child process."""

import ctypes
import os
import signal
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from proxbench.problems import ContactProblem
from proxbench.solvers import Model, Solution, Status, Stop, create


@dataclass(frozen=True)
class Misbehaving:
    """Solves as SORprox does, after having done what ``deed`` names."""

    deed: str

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = False

    @property
    def name(self) -> str:
        return f"Misbehaving({self.deed})"

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> "_Prepared":
        return _Prepared(problem, self.deed)


@dataclass
class _Prepared:
    problem: ContactProblem
    deed: str

    def solve(self, stop: Stop, start: object = None, observe: object = None) -> object:
        solution = create("SORprox").prepare(self.problem).solve(stop)
        return getattr(self, f"do_{self.deed}")(solution)

    def do_raise(self, solution: Solution) -> object:
        raise RuntimeError("the plugin gave up")

    def do_exit(self, solution: Solution) -> object:
        os._exit(7)

    def do_segfault(self, solution: Solution) -> object:
        return ctypes.string_at(0)

    def do_sleep(self, solution: Solution) -> object:
        time.sleep(1000)
        return solution

    def do_spin(self, solution: Solution) -> object:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        while True:
            pass

    def do_allocate(self, solution: Solution) -> object:
        held = []
        while True:
            held.append(np.ones(2**24))

    def do_none(self, solution: Solution) -> object:
        return None

    def do_shape(self, solution: Solution) -> object:
        return Solution(np.zeros(1), Status.SOLVED, 1)

    def do_nan(self, solution: Solution) -> object:
        return Solution(np.full(self.problem.n_rows, np.nan), Status.SOLVED, 1)

    def do_lie(self, solution: Solution) -> object:
        return Solution(np.zeros(self.problem.n_rows), Status.SOLVED, 1)

    def do_write(self, solution: Solution) -> object:
        values = self.problem.free_velocity
        values.setflags(write=True)
        values[0] += 1.0
        return solution

    def do_print(self, solution: Solution) -> object:
        print("noise " * 1000)
        raise RuntimeError("after much noise")

    def do_patch(self, solution: Solution) -> object:
        from proxbench.problems import judge as judging

        judging.__dict__.clear() if hasattr(judging, "__dict__") else None
        return self.do_lie(solution)
