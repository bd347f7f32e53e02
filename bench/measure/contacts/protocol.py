"""What happens inside a case's process: warm up, one observed solve, and rounds of timed solves.

Timed solves are never observed and observed ones never timed. Each timed solve gets a fresh copy of the problem, so
that everything a solver assembles is on its clock, and garbage collection stays off while the clock runs. The clock
stops when the impulses are copied, and those of every timed solve leave the process, equal ones once.
"""

import gc
import io
import os
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter, process_time, sleep
from typing import Any

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.catalog.storage import read_problem
from ....problems.contact.problem import ContactProblem
from ....solvers.contract import prepared_fault, reason_fault, solution_fault, type_fault
from ....solvers.interface import Solution, Solver, Status, Stop, shows_iterates
from ...isolation.child import MisbehaviourError, refuse
from ...isolation.worker import NO_ANSWER
from ...plugins.contestants import Contestant
from ...plugins.remote_solver import answer_fault
from ..ladder import LONGEST_REASON
from ..pace import free_probe_seconds, free_share, probe_seconds

FIRST_MARKS = 30
"""Iterations that all appear in the convergence curve; later ones are thinned to a geometric sequence."""

MARK_RATIO = 1.04
"""Ratio of that sequence."""

LATEST = 40
"""Last iterations that all appear in it: where several methods take turns the last one may need no more."""

SUPPORTS_SECONDS = 0.1
"""Processor time that ``supports`` may take [s]: it looks at a problem, and solves nothing."""

REST_SECONDS = 0.05
"""Wall time of a rest, in which what a solver has started may end [s]."""

TIMED = ("times", "work", "probes")
"""What the answer to "round" has of each solve."""

MOST_NUMBERS = 2**22
"""Numbers of different answers after which a round ends."""


@dataclass
class Round:
    """Timed solves.

    Attributes:
        solution: the last one, with impulses of the harness's own.
        times: seconds of preparing and of solving of each.
        work: processor seconds of both together of each, of all threads and of processes that were waited for.
        probes: mean time of a probe before and after each [s].
        answers: the different impulses of solves that ended SOLVED, and those of a last one that did not, each of shape
            (n_rows,).
    """

    solution: Solution
    times: list[tuple[float, float]]
    work: list[float]
    probes: list[float]
    answers: list[FloatArray]


@dataclass
class Measurement:
    """One case in its process.

    Attributes:
        problem: the problem; first another one of the same kinds, to warm up on.
        solver: the solver.
        threads: the threads that ran before the solver was made.
    """

    problem: ContactProblem
    solver: Solver
    threads: frozenset[threading.Thread] = field(default_factory=lambda: frozenset(threading.enumerate()))
    _digest: str = field(init=False)

    def __post_init__(self) -> None:
        self._digest = self.problem.digest

    def turn_to(self, problem: ContactProblem) -> None:
        """Go on with another problem."""
        self.problem, self._digest = problem, problem.digest

    def refusal(self) -> str:
        """Return why the solver does not support the problem; nothing if it does."""
        problem = self.problem.fresh()
        began = _processor_seconds()
        reason = self.solver.supports(problem)
        seconds = _processor_seconds() - began
        refuse(reason_fault(reason) or self._left_behind())
        if seconds > SUPPORTS_SECONDS:
            raise MisbehaviourError(f"its supports worked for {seconds:.3g} s, where {SUPPORTS_SECONDS:g} s are enough")
        return reason or ""

    def warm_up(self, stop: Stop) -> None:
        """Run everything once, so that compilation and first touches are off the clock."""
        prepared = self.solver.prepare(self.problem.fresh())
        refuse(prepared_fault(prepared))
        refuse(type_fault(prepared.solve(stop)) or self._left_behind())

    def observe(self, stop: Stop) -> tuple[list[int], FloatArray, int, int]:
        """Return iterations of one observed solve, and their impulses, one row each, for the judge outside.

        Beside them the number of times that the observer was called, and the iterations that the solver claims.
        """
        problem = self.problem.fresh()
        iterates: dict[int, FloatArray] = {}
        latest: deque[tuple[int, FloatArray]] = deque(maxlen=LATEST)
        mark, calls, claimed = 1.0, 0, 0

        def note(iteration: int, impulses: FloatArray) -> None:
            nonlocal mark, calls
            calls += 1
            shown = np.array(impulses, dtype=np.float64)
            if shown.shape != (problem.n_rows,):
                raise MisbehaviourError(f"it showed its observer impulses of shape {shown.shape}, not a row each")
            latest.append((int(iteration), shown))
            if iteration >= mark:
                iterates[int(iteration)] = shown
                mark = iteration + 1.0 if iteration < FIRST_MARKS else iteration * MARK_RATIO

        if shows_iterates(self.solver):
            solution = self.solver.prepare(problem).solve(stop, observe=note)
            refuse(type_fault(solution) or self._left_behind())
            claimed = int(solution.iterations)
        iterates = dict(sorted({**iterates, **dict(latest)}.items()))
        rows = np.array([*iterates.values()]).reshape(len(iterates), problem.n_rows)
        return [*iterates], rows, calls, claimed

    def round(self, stop: Stop, seconds: float) -> Round:
        """Do timed solves for ``seconds`` of wall time, at least one.

        A solve that does not end SOLVED ends the round: a failure is measured once.
        """
        times: list[tuple[float, float]] = []
        work: list[float] = []
        probes: list[float] = []
        answers: dict[bytes, FloatArray] = {}
        end = perf_counter() + seconds
        while True:
            problem = self.problem.fresh()
            before = probe_seconds()
            worked = _processor_seconds()
            solution, prepare_seconds, solve_seconds = self._solve(problem, stop)
            work.append(_processor_seconds() - worked)
            times.append((prepare_seconds, solve_seconds))
            probes.append((before + probe_seconds()) / 2.0)
            if solution.status is not Status.SOLVED:
                break
            answers.setdefault(solution.impulses.tobytes(), solution.impulses)
            if perf_counter() >= end or len(answers) * problem.n_rows > MOST_NUMBERS:
                break
        is_changed = problem.fresh().digest != self._digest
        refuse("it changed the numbers of the problem" if is_changed else self._left_behind())
        last = [] if solution.status is Status.SOLVED else [solution.impulses]
        return Round(solution, times, work, probes, [*answers.values(), *last])

    def _solve(self, problem: ContactProblem, stop: Stop) -> tuple[Solution, float, float]:
        """Return the solution with a copy of its impulses that was made on the clock, and the seconds of both parts.

        Raises:
            MisbehaviourError: if it cannot be a solution.
        """
        collecting = gc.isenabled()
        impulses = np.zeros(problem.n_rows)
        gc.disable()
        try:
            began = perf_counter()
            prepared = self.solver.prepare(problem)
            ready = perf_counter()
            solution = prepared.solve(stop)
            synchronise = getattr(prepared, "synchronise", None)
            if synchronise is not None:
                synchronise()
            if _is_copied(solution, impulses):
                np.copyto(impulses, solution.impulses)
            done = perf_counter()
        finally:
            if collecting:
                gc.enable()
        refuse(solution_fault(problem, solution))
        return replace(solution, impulses=impulses), ready - began, done - ready

    def _left_behind(self) -> str | None:
        """Say which threads outlive a call, or None."""
        left = [thread.name for thread in threading.enumerate() if thread not in self.threads]
        return f"it leaves {len(left)} threads running, {left[0]!r:.60} first" if left else None


@dataclass
class MeasuringTask:
    """A case as it travels to its process, where it becomes a ``Measurement``.

    Attributes:
        problem_data: the problem that it begins with, as the content of a file.
        contestant: the solver.
    """

    problem_data: bytes
    contestant: Contestant

    @cached_property
    def _measurement(self) -> Measurement:
        threads = frozenset(threading.enumerate())
        return Measurement(read_problem(io.BytesIO(self.problem_data), "problem"), self.contestant.make(), threads)

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer a request: "supports", "warm_up", "problem" (another from here on), "observe", "round" or "rest".

        "rounds" (stop to warm up, stop, problems or none each with seconds) warms up, and does a round on each problem,
        or on the one before; the answer is that of the last round, with times and work of all.
        """
        if request == "supports":
            return {"refusal": self._measurement.refusal()}, b""
        if request == "warm_up":
            self._measurement.warm_up(*arguments)
            return {}, b""
        if request == "problem":
            self._turn_to(*arguments)
            return {}, b""
        if request == "rest":
            sleep(REST_SECONDS)
            return {}, b""
        if request == "observe":
            iterations, iterates, calls, claimed = self._measurement.observe(*arguments)
            return {"iterations": iterations, "calls": calls, "claimed": claimed}, iterates.tobytes()
        return (self._rounds if request == "rounds" else self._round)(*arguments)

    def _turn_to(self, problem_data: bytes) -> None:
        self._measurement.turn_to(read_problem(io.BytesIO(problem_data), "problem"))

    def _rounds(self, short: Stop, stop: Stop, rounds: Sequence[tuple[bytes, float]]) -> tuple[dict[str, Any], bytes]:
        self._measurement.warm_up(short)
        answer: dict[str, Any] = {}
        impulses, rounds_done = b"", []
        for problem_data, seconds in rounds:
            if problem_data:
                self._turn_to(problem_data)
            answer, impulses = self._round(stop, seconds)
            rounds_done.append({name: answer[name] for name in TIMED})
        return {**answer, "rounds": rounds_done}, impulses

    def _round(self, stop: Stop, seconds: float) -> tuple[dict[str, Any], bytes]:
        found = self._measurement.round(stop, seconds)
        answer = {
            "status": found.solution.status.value,
            "iterations": int(found.solution.iterations),
            "message": str(found.solution.message)[:LONGEST_REASON],
            "times": found.times,
            "work": found.work,
            "probes": found.probes,
        }
        return answer, b"".join(impulses.tobytes() for impulses in found.answers)


def round_fault(answer: dict[str, Any], wall_seconds: float) -> str | None:
    """Say why the answer to "round", which took ``wall_seconds`` from outside, cannot be one, or None."""
    fault = answer_fault(answer)
    if fault:
        return fault
    try:
        times, work, probes = (np.array(answer[name], dtype=np.float64) for name in TIMED)
    except (KeyError, TypeError, ValueError):
        return NO_ANSWER
    if times.ndim != 2 or times.shape[1] != 2 or not len(times) or not work.shape == probes.shape == times.shape[:1]:
        return NO_ANSWER
    if not (np.isfinite(work) & (work >= 0.0) & np.isfinite(probes) & (probes > 0.0)).all():
        return NO_ANSWER
    if not (times >= 0.0).all() or not times.sum() <= wall_seconds:
        return f"the clock in its process counted {times.sum():g} s of solving in {wall_seconds:g} s of wall time"
    return None


def medians_on_free_core(answer: dict[str, Any]) -> tuple[float, float]:
    """Return the median time and the median work [s] of the solves of a round, as they are on a free core."""
    times, work, probes = (np.array(answer[name]) for name in TIMED)
    totals, met = times.sum(axis=1), probes / free_probe_seconds()
    return float(np.median(totals * free_share(totals, work, met))), float(np.median(work / met))


def _processor_seconds() -> float:
    """Return the processor time of this process, and of processes that it has waited for [s]."""
    children = os.times()
    return process_time() + children.children_user + children.children_system


def _is_copied(solution: Any, impulses: FloatArray) -> bool:
    """Whether the impulses of a solution can be copied; what is wrong with others is said when the clock stands."""
    if type(solution) is not Solution:
        return False
    given = solution.impulses
    return type(given) is np.ndarray and given.shape == impulses.shape and given.dtype.kind == "f"
