"""What happens inside a case's process: warm up, one observed solve, and rounds of timed solves.

Timed solves are never observed and observed ones never timed. Each timed solve gets a fresh copy of the problem, so
that everything a solver assembles is on its clock, and garbage collection stays off while the clock runs.
"""

import gc
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..problems.contact import ContactProblem
from ..problems.judge import Residual
from ..problems.laws import FloatArray
from ..solvers.interface import Solution, Solver, Status, Stop

FIRST_MARKS = 30
"""Iterations that all appear in the convergence curve; later ones are thinned to a geometric sequence."""

MARK_RATIO = 1.04
"""Ratio of that sequence."""


class MisbehaviourError(Exception):
    """A solver broke its contract; the text says how."""


@dataclass
class Measurement:
    """One case in its process."""

    problem: ContactProblem
    solver: Solver
    _digest: str = field(init=False)

    def __post_init__(self) -> None:
        self._digest = self.problem.digest

    def warm_up(self, stop: Stop) -> None:
        """Run everything once, so that compilation and first touches are off the clock."""
        self._solve(self.problem.fresh(), stop)

    def observe(self, stop: Stop) -> dict[str, list[float]]:
        """Return the convergence curve of one observed solve: iterations, and the judge's residual at each."""
        problem = self.problem.fresh()
        residual = Residual(problem)
        curve: dict[str, list[float]] = {"iteration": [], "residual": []}
        mark = 1.0

        def note(iteration: int, impulses: FloatArray) -> None:
            nonlocal mark
            if iteration < mark:
                return
            curve["iteration"].append(iteration)
            curve["residual"].append(residual(impulses, problem.relative_velocity(impulses)))
            mark = iteration + 1.0 if iteration < FIRST_MARKS else iteration * MARK_RATIO

        if self.solver.has_iterates:
            self.solver.prepare(problem).solve(stop, observe=note)
        return curve

    def round(self, stop: Stop, seconds: float) -> tuple[Solution, list[tuple[float, float]]]:
        """Do timed solves for ``seconds`` of wall time, at least one; return the last solution and all times.

        A solve that does not end SOLVED ends the round: a failure is measured once.
        """
        times = []
        end = time.perf_counter() + seconds
        while True:
            problem = self.problem.fresh()
            solution, prepare_seconds, solve_seconds = self._solve(problem, stop)
            times.append((prepare_seconds, solve_seconds))
            if solution.status is not Status.SOLVED or time.perf_counter() >= end:
                break
        self._check(problem, solution)
        return solution, times

    def _solve(self, problem: ContactProblem, stop: Stop) -> tuple[Solution, float, float]:
        collecting = gc.isenabled()
        gc.disable()
        try:
            began = time.perf_counter()
            prepared = self.solver.prepare(problem)
            ready = time.perf_counter()
            solution = prepared.solve(stop)
            done = time.perf_counter()
        finally:
            if collecting:
                gc.enable()
        return _checked_type(solution), ready - began, done - ready

    def _check(self, problem: ContactProblem, solution: Solution) -> None:
        """Raise ``MisbehaviourError`` if the solution cannot be one, or the solver wrote to its inputs."""
        impulses = np.asarray(solution.impulses)
        if impulses.shape != (problem.n_rows,):
            raise MisbehaviourError(f"it returned impulses of shape {impulses.shape}, not ({problem.n_rows},)")
        if impulses.dtype.kind != "f":
            raise MisbehaviourError(f"it returned impulses of type {impulses.dtype}, not float")
        if solution.status is Status.SOLVED and not np.isfinite(impulses).all():
            raise MisbehaviourError("it claims to have solved with impulses that are not finite")
        if problem.fresh().digest != self._digest:
            raise MisbehaviourError("it changed the numbers of the problem")


def _checked_type(solution: Any) -> Solution:
    if not isinstance(solution, Solution):
        raise MisbehaviourError(f"its solve returned {type(solution).__name__}, not a Solution")
    if not isinstance(solution.status, Status):
        raise MisbehaviourError(f"it returned the status {solution.status!r}, which is none")
    return solution
