"""Measurements in the process of a case: warm up, one observed solve, and rounds of timed solves.

Timed solves are never observed, and observed ones are never timed. Each timed solve gets a fresh copy of the problem,
so that all assembly is timed. Garbage collection is off while the clock runs. The clock stops when the impulses are
copied. The process returns the distinct impulses of all timed solves.
"""

import _thread
import gc
import io
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter, sleep
from typing import Any

import msgspec
import numpy as np

from ....problems.arrays import FloatArray, frozen
from ....problems.compilation.cached_kernels import load_cached_kernels
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Solution, Solver, Status, Stop, shows_iterates
from ....problems.exchange.files.problem_file import read_problem
from ....problems.representation import counted
from ....solvers.contract import prepared_fault, reason_fault, solution_fault, type_fault
from ...isolation.child import MisbehaviourError, raise_fault
from ...isolation.process_state import ProcessState, exempt_from_collection, replacement_text
from ...isolation.process_usage import ContextSwitches, used_processor_seconds
from ...plugins.solver_specs import SolverSpec
from ...store.outcome import LATE_PREPARING
from ..ladder import MAX_REASON_LENGTH
from ..timed_round import TimedRound

FIRST_ITERATIONS = 30
"""Number of first iterations in the convergence curve; later ones are thinned to a geometric sequence."""

MARK_RATIO = 1.04
"""Ratio of the geometric sequence of iterations."""

LAST_ITERATIONS = 40
"""Number of last iterations in the curve, because the last part of a composite solver may be short."""

REST_SECONDS = 0.05
"""Wall time of a pause in which processes of a solver may end [s]."""

WARM_SECONDS = 0.004
"""Wall time of solving another problem before a first solve, to warm the caches [s]."""

MAX_NUMBERS = 2**22
"""A round ends when its distinct answers contain more than this number of values in total."""


@dataclass
class TimedSolve:
    """One timed solve.

    Attributes:
        solution: the solution, with a copy of its impulses.
        prepare: wall time of ``prepare``; 0 if only the library of an external solver is timed [s].
        solve: wall time of ``solve`` and of copying its impulses, or of the library only [s].
        processor: processor time of both, including all threads, processes that were waited for, and the program of
            an executable [s].
        uncounted: wall time outside the library; 0 if more than the library is timed [s].
        threads: number of threads that the prepared solver declares; None if it declares none.
    """

    solution: Solution
    prepare: float
    solve: float
    processor: float
    uncounted: float
    threads: int | None


@dataclass
class Measurement:
    """One case in its process.

    Attributes:
        problem: the current problem; for the warm-up, a perturbed copy.
        solver: the solver.
        before: state of the process before the solver was created.
        times_library: whether only the ``library_seconds`` of a prepared solver count, if it has them.
    """

    problem: ContactProblem
    solver: Solver
    before: ProcessState = field(default_factory=ProcessState.now)
    times_library: bool = False

    def unsupported_reason(self) -> str:
        """Return why the solver does not support the problem; empty if it does."""
        reason = self.solver.supports(self.problem.fresh())
        raise_fault(reason_fault(reason))
        self._check_threads()
        return reason or ""

    def warm_up(self, stop: Stop) -> None:
        """Prepare and solve once, so that compilation and first memory accesses are not timed.

        Exempt the objects that then exist, such as imported modules, from later garbage collections. A full collection
        takes 1 to 5 ms with them and 1 µs without, and would count as untimed work between solves.
        """
        prepared = self.solver.prepare(self.problem.fresh())
        raise_fault(prepared_fault(prepared))
        raise_fault(type_fault(prepared.solve(stop)))
        self._check_threads()
        self.before = self.before.after_imports()
        exempt_from_collection()

    def observe(self, stop: Stop, start: FloatArray | None = None) -> tuple[list[int], FloatArray, int, int]:
        """Observe one solve from ``start`` [N s], shape (n_rows,); from zero if None.

        Returns:
            The numbers of n recorded iterations, their impulses [N s], shape (n, n_rows), the number of calls of the
            observer, and the number of iterations that the solver reports.
        """
        problem = self.problem.fresh()
        iterates: dict[int, FloatArray] = {}
        latest: deque[tuple[int, FloatArray]] = deque(maxlen=LAST_ITERATIONS)
        mark, calls, claimed = 1.0, 0, 0

        def on_iterate(iteration: int, impulses: FloatArray) -> None:
            nonlocal mark, calls
            calls += 1
            iterate = np.array(impulses, dtype=np.float64)
            if iterate.shape != (problem.n_rows,):
                raise MisbehaviourError(f"it passed impulses of shape {iterate.shape} to its observer, not (n_rows,)")
            latest.append((int(iteration), iterate))
            if iteration >= mark:
                iterates[int(iteration)] = iterate
                mark = iteration + 1.0 if iteration < FIRST_ITERATIONS else iteration * MARK_RATIO

        if shows_iterates(self.solver):
            solution = self.solver.prepare(problem).solve(stop, _read_only_copy(start), on_iterate)
            raise_fault(type_fault(solution))
            claimed = int(solution.iterations)
        self._check_threads()
        iterates = dict(sorted({**iterates, **dict(latest)}.items()))
        rows = np.array([*iterates.values()]).reshape(len(iterates), problem.n_rows)
        return [*iterates], rows, calls, claimed

    def round(self, stop: Stop, seconds: float, start: FloatArray | None = None) -> tuple[TimedRound, list[FloatArray]]:
        """Run timed solves from ``start`` [N s], shape (n_rows,), for ``seconds`` [s] of wall time, at least one.

        A solve that does not end SOLVED ends the round.

        Returns:
            The round, and the distinct impulses of its solves [N s], each of shape (n_rows,).
        """
        solves: list[TimedSolve] = []
        answers: dict[bytes, Solution] = {}
        before, end = ContextSwitches.now(), perf_counter() + seconds
        while True:
            problem = self.problem.fresh()
            solves.append(self._solve(problem, stop, start))
            solution = solves[-1].solution
            if solution.status is not Status.SOLVED:
                break
            answers.setdefault(solution.impulses.tobytes(), solution)
            if perf_counter() >= end or len(answers) * problem.n_rows > MAX_NUMBERS:
                break
        timed = _round_of_solves(solves, before)
        self._check_after(problem)
        last = [] if solution.status is Status.SOLVED else [solution]
        returned = [*answers.values(), *last]
        iterations = [int(one.iterations) for one in returned]
        return msgspec.structs.replace(timed, answer_iterations=iterations), [one.impulses for one in returned]

    def first_solves(
        self, stop: Stop, problems: Sequence[ContactProblem], start: FloatArray | None = None
    ) -> tuple[TimedRound, list[FloatArray]]:
        """Solve each of several problems once, the last one from ``start`` [N s], shape (n_rows,).

        The problems are new to the process. Before them, solves of the current problem warm the caches.

        Returns:
            The round, and a list with the impulses of the last solve [N s], shape (n_rows,).
        """
        warm_up_stop = replace(stop, max_seconds=min(stop.max_seconds, 2.0 * WARM_SECONDS))
        end = perf_counter() + WARM_SECONDS
        while True:
            # read before the last solve, because reading system files displaces data in the caches
            before = ContextSwitches.now()
            self._solve(self.problem.fresh(), warm_up_stop)
            if perf_counter() >= end:
                break
        solves = [self._solve(problem.fresh(), stop) for problem in problems[:-1]]
        solves.append(self._solve(problems[-1].fresh(), stop, start))
        earlier = [int(solve.solution.iterations) for solve in solves[:-1]]
        timed = msgspec.structs.replace(_round_of_solves(solves, before), earlier_iterations=earlier)
        self.problem = problems[-1]
        self._check_after(self.problem)
        return timed, [solves[-1].solution.impulses]

    def compare_process(self) -> None:
        """Compare the process with its state before the solver was created.

        Raises:
            MisbehaviourError: if global state has been replaced or changed.
        """
        raise_fault(replacement_text(self.before))
        self._check_unchanged()

    def _solve(self, problem: ContactProblem, stop: Stop, start: FloatArray | None = None) -> TimedSolve:
        """Prepare and solve from ``start`` within one time limit, and copy the impulses before the clock stops.

        Raises:
            MisbehaviourError: if the result is not a valid solution.
        """
        was_collecting = gc.isenabled()
        impulses, start = np.zeros(problem.n_rows), _read_only_copy(start)
        gc.disable()
        try:
            processor = used_processor_seconds(self.solver)
            began = perf_counter()
            prepared = self.solver.prepare(problem)
            ready = perf_counter()
            remaining = stop.max_seconds - (ready - began)
            if remaining > 0.0:
                solution = prepared.solve(replace(stop, max_seconds=remaining), start)
                synchronise = getattr(prepared, "synchronise", None)
                if synchronise is not None:
                    synchronise()
            else:
                solution = Solution(impulses, Status.TIME_LIMIT, 0, LATE_PREPARING)
            if _can_copy(solution, impulses):
                np.copyto(impulses, solution.impulses)
            done = perf_counter()
            processor = used_processor_seconds(self.solver) - processor
        finally:
            if was_collecting:
                gc.enable()
        raise_fault(solution_fault(problem, solution))
        prepare, solve, uncounted = ready - began, done - ready, 0.0
        library = getattr(prepared, "library_seconds", None) if self.times_library else None
        if library is not None:
            prepare, solve, uncounted = 0.0, library, done - began - library
        threads = getattr(prepared, "threads", None)
        n_threads = int(threads) if isinstance(threads, int | np.integer) else None
        return TimedSolve(replace(solution, impulses=impulses), prepare, solve, processor, uncounted, n_threads)

    def _check_after(self, problem: ContactProblem) -> None:
        """Raise ``MisbehaviourError`` if solving has changed the problem or the process."""
        raise_fault("it changed the numbers of the problem" if problem.fresh().digest != self.problem.digest else None)
        self._check_threads()
        self._check_unchanged()

    def _check_threads(self) -> None:
        """Raise ``MisbehaviourError`` if Python threads outlive a call."""
        n_left = _thread._count() - self.before.n_threads
        raise_fault(f"it leaves {counted(n_left, 'thread')} running" if n_left > 0 else None)

    def _check_unchanged(self) -> None:
        """Raise ``MisbehaviourError`` if a setting that a measurement depends on has changed."""
        changed = self.before.changed_timing_settings()
        raise_fault(f"it changed {changed[0]}, and did not restore it" if changed else None)


class MeasuringRequest:
    """Requests to the process of a case, with their arguments.

    They are plain strings, because a process unpickles the first request before it prepares its imports.

    SUPPORTS                          why the solver does not support the problem
    WARM_UP (stop)                    prepare and solve once
    PROBLEM (data)                    switch to another problem
    OBSERVE (stop, start)             iterates of one solve
    ROUND (stop, seconds, start)      timed solves
    FIRST_SOLVES (stop, data, start)  one timed solve of each of several problems that are new to the process
    LOAD_KERNELS                      load all kernels that are cached
    REST                              wait, so that processes of the solver may end
    COMPARE                           compare the state of the process with the initial one
    """

    SUPPORTS = "supports"
    WARM_UP = "warm_up"
    PROBLEM = "problem"
    OBSERVE = "observe"
    ROUND = "round"
    FIRST_SOLVES = "first_solves"
    LOAD_KERNELS = "load_kernels"
    REST = "rest"
    COMPARE = "compare"


@dataclass
class MeasuringTask:
    """The task of a case, which its process turns into a ``Measurement``.

    Attributes:
        problem_data: file content of the first problem.
        solver_spec: the solver.
    """

    problem_data: bytes
    solver_spec: SolverSpec

    @cached_property
    def _measurement(self) -> Measurement:
        before = ProcessState.now()
        spec = self.solver_spec
        return Measurement(_read_problem(self.problem_data), spec.make(), before, times_library=spec.is_built_in)

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer a ``MeasuringRequest``, given by its name and arguments."""
        measurement = self._measurement
        if request == MeasuringRequest.SUPPORTS:
            return {"unsupported_reason": measurement.unsupported_reason()}, b""
        if request == MeasuringRequest.OBSERVE:
            iterations, iterates, calls, claimed = measurement.observe(*arguments)
            return {"iterations": iterations, "calls": calls, "claimed": claimed}, iterates.tobytes()
        if request in (MeasuringRequest.ROUND, MeasuringRequest.FIRST_SOLVES):
            if request == MeasuringRequest.ROUND:
                timed, answers = measurement.round(*arguments)
            else:
                stop, contents, *start = arguments
                timed, answers = measurement.first_solves(stop, list(map(_read_problem, contents)), *start)
            return msgspec.to_builtins(timed), b"".join(impulses.tobytes() for impulses in answers)
        if request == MeasuringRequest.WARM_UP:
            measurement.warm_up(*arguments)
        elif request == MeasuringRequest.PROBLEM:
            measurement.problem = _read_problem(*arguments)
        elif request == MeasuringRequest.LOAD_KERNELS:
            load_cached_kernels()
        elif request == MeasuringRequest.REST:
            sleep(REST_SECONDS)
        else:
            measurement.compare_process()
        return {}, b""


def _read_problem(data: bytes) -> ContactProblem:
    return read_problem(io.BytesIO(data), "problem")


def _read_only_copy(start: FloatArray | None) -> FloatArray | None:
    """Return a read-only copy of a start; None for zero."""
    return None if start is None else frozen(start, np.float64)


def _round_of_solves(solves: Sequence[TimedSolve], before: ContextSwitches) -> TimedRound:
    """Return the round of the solves between ``before`` and now."""
    last, switches = solves[-1].solution, ContextSwitches.now().since(before)
    return TimedRound(
        last.status,
        int(last.iterations),
        str(last.message)[:MAX_REASON_LENGTH],
        [solve.prepare for solve in solves],
        [solve.solve for solve in solves],
        [solve.processor for solve in solves],
        *switches,
        [solve.uncounted for solve in solves] if any(solve.uncounted for solve in solves) else [],
        threads=solves[-1].threads,
    )


def _can_copy(solution: Any, impulses: FloatArray) -> bool:
    """Return whether the impulses of a solution can be copied; other faults are reported after the clock stops."""
    if type(solution) is not Solution:
        return False
    source = solution.impulses
    return type(source) is np.ndarray and source.shape == impulses.shape and source.dtype.kind == "f"
