"""What happens inside a case's process: warm up, one observed solve, and rounds of timed solves.

Timed solves are never observed and observed ones never timed. Each timed solve gets a fresh copy of the problem, so
that everything a solver assembles is on its clock, and garbage collection stays off while the clock runs.
"""

import gc
import io
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.catalog.storage import read_problem
from ...problems.contact.problem import ContactProblem
from ...solvers.contract import prepared_fault, reason_fault, solution_fault, type_fault
from ...solvers.interface import Solution, Solver, Status, Stop, shows_iterates
from ..isolation.child import MisbehaviourError
from ..plugins.contestants import Contestant
from ..plugins.remote_solver import answer_fault

FIRST_MARKS = 30
"""Iterations that all appear in the convergence curve; later ones are thinned to a geometric sequence."""

MARK_RATIO = 1.04
"""Ratio of that sequence."""


@dataclass
class Measurement:
    """One case in its process."""

    problem: ContactProblem
    solver: Solver
    _digest: str = field(init=False)

    def __post_init__(self) -> None:
        self._digest = self.problem.digest

    def refusal(self) -> str:
        """Return why the solver does not support the problem; nothing if it does."""
        reason = self.solver.supports(self.problem.fresh())
        fault = reason_fault(reason)
        if fault:
            raise MisbehaviourError(fault)
        return reason or ""

    def warm_up(self, stop: Stop) -> None:
        """Run everything once, so that compilation and first touches are off the clock."""
        prepared = self.solver.prepare(self.problem.fresh())
        fault = prepared_fault(prepared)
        if fault:
            raise MisbehaviourError(fault)
        _checked_type(prepared.solve(stop))

    def observe(self, stop: Stop) -> tuple[list[int], FloatArray]:
        """Return iterations of one observed solve, and their impulses, one row each, for the judge outside."""
        problem = self.problem.fresh()
        iterations: list[int] = []
        iterates: list[FloatArray] = []
        mark = 1.0

        def note(iteration: int, impulses: FloatArray) -> None:
            nonlocal mark
            if iteration < mark:
                return
            shown = np.array(impulses, dtype=np.float64)
            if shown.shape != (problem.n_rows,):
                raise MisbehaviourError(f"it showed its observer impulses of shape {shown.shape}, not a row each")
            iterations.append(int(iteration))
            iterates.append(shown)
            mark = iteration + 1.0 if iteration < FIRST_MARKS else iteration * MARK_RATIO

        if shows_iterates(self.solver):
            self.solver.prepare(problem).solve(stop, observe=note)
        return iterations, np.array(iterates).reshape(len(iterates), problem.n_rows)

    def round(self, stop: Stop, seconds: float) -> tuple[Solution, list[tuple[float, float]]]:
        """Do timed solves for ``seconds`` of wall time, at least one; return the last solution and all times.

        A solve that does not end SOLVED ends the round: a failure is measured once.
        """
        times = []
        end = perf_counter() + seconds
        while True:
            problem = self.problem.fresh()
            solution, prepare_seconds, solve_seconds = self._solve(problem, stop)
            times.append((prepare_seconds, solve_seconds))
            if solution.status is not Status.SOLVED or perf_counter() >= end:
                break
        self._check(problem, solution)
        return solution, times

    def _solve(self, problem: ContactProblem, stop: Stop) -> tuple[Solution, float, float]:
        collecting = gc.isenabled()
        gc.disable()
        try:
            began = perf_counter()
            prepared = self.solver.prepare(problem)
            ready = perf_counter()
            solution = prepared.solve(stop)
            done = perf_counter()
        finally:
            if collecting:
                gc.enable()
        return _checked_type(solution), ready - began, done - ready

    def _check(self, problem: ContactProblem, solution: Solution) -> None:
        """Raise ``MisbehaviourError`` if the solution cannot be one, or the solver wrote to its inputs."""
        fault = solution_fault(problem, solution)
        if fault:
            raise MisbehaviourError(fault)
        if problem.fresh().digest != self._digest:
            raise MisbehaviourError("it changed the numbers of the problem")


@dataclass
class MeasuringTask:
    """A case as it travels to its process, where it becomes a ``Measurement``."""

    problem_data: bytes
    contestant: Contestant

    @cached_property
    def _measurement(self) -> Measurement:
        return Measurement(read_problem(io.BytesIO(self.problem_data), "problem"), self.contestant.make())

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer a request: "supports", "warm_up", "observe" or "round"."""
        if request == "supports":
            return {"refusal": self._measurement.refusal()}, b""
        if request == "warm_up":
            self._measurement.warm_up(*arguments)
            return {}, b""
        if request == "observe":
            iterations, iterates = self._measurement.observe(*arguments)
            return {"iterations": iterations}, iterates.tobytes()
        solution, times = self._measurement.round(*arguments)
        answer = {
            "status": solution.status.value,
            "iterations": int(solution.iterations),
            "message": str(solution.message),
            "times": times,
        }
        return answer, np.ascontiguousarray(solution.impulses, dtype=np.float64).tobytes()


def round_fault(answer: dict[str, Any], wall_seconds: float) -> str | None:
    """Say why the answer to "round", which took ``wall_seconds`` from outside, cannot be one, or None."""
    fault = answer_fault(answer)
    if fault:
        return fault
    try:
        times = np.array(answer["times"], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        return "its process sent something that is no answer"
    if times.ndim != 2 or times.shape[1] != 2 or not len(times):
        return "its process sent something that is no answer"
    if not (times >= 0.0).all() or not times.sum() <= wall_seconds:
        return f"the clock in its process counted {times.sum():g} s of solving in {wall_seconds:g} s of wall time"
    return None


def _checked_type(solution: Any) -> Solution:
    fault = type_fault(solution)
    if fault:
        raise MisbehaviourError(fault)
    checked: Solution = solution
    return checked
