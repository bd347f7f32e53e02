"""A solver that works in a process of its own, with the interface of any other.

Where one solve is wanted after the other (a matrix, a recording, the steps of a simulation) the solver of a plugin may
raise, hang, crash or take memory without harm to the process that judges: a request that is not answered is a
``FailedSolveError``, and the next one starts a fresh process.
"""

import io
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self, cast

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.catalog.storage import problem_bytes, read_problem
from ...problems.contact.problem import ContactProblem
from ...solvers.contract import prepared_fault, reason_fault
from ...solvers.interface import Observer, Prepared, Solution, Solver, Status, Stop
from ..errors import BenchError
from ..isolation.child import MisbehaviourError
from ..isolation.worker import Fault, RenewedWorker
from ..store.outcome import Outcome
from .contestants import Contestant
from .describing import contestant
from .protocol import answer_fault, solution_fault

SECONDS = 60.0
"""Wall time that a request may take beyond the time limit of its solve [s]: preparing, and ending an iteration."""

MEMORY_BYTES = 2**31
"""Memory that a solver may take beyond what the framework itself needs."""


class FailedSolveError(BenchError):
    """A solver did not return a solution.

    Attributes:
        outcome: how it ended.
        reason: the same in words, a sentence without its subject.
    """

    def __init__(self, name: str, fault: Fault) -> None:
        super().__init__(f"{name}: {fault.reason}.")
        self.outcome, self.reason = fault.outcome, fault.reason


class RemoteSolver:
    """A solver in a process of its own; use it as a context manager, or ``close`` it.

    Attributes:
        name: its name, with options.
        model: what it solves.
        has_iterates: whether it shows iterates.
        waiting_seconds: wall time of all requests that was not spent by the solver itself, on the way there and back.
    """

    def __init__(self, solver: Contestant, seconds: float = SECONDS, memory_bytes: int = MEMORY_BYTES) -> None:
        """Note what to start; the process starts with the first request.

        Args:
            solver: the solver.
            seconds: wall time that a request may take beyond the time limit of its solve [s].
            memory_bytes: memory that it may take.
        """
        self.name, self.model, self.has_iterates = solver.name, solver.model, solver.has_iterates
        self.waiting_seconds = 0.0
        self._seconds = seconds
        self._worker = RenewedWorker(SolvingTask(solver), seconds, memory_bytes)
        self._prepared = 0
        self._sent: ContactProblem | None = None

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None.

        Raises:
            FailedSolveError: if the solver does not answer.
        """
        self._send(problem)
        answer, _ = self.ask("supports")
        return str(answer.get("refusal", "")) or None

    def prepare(self, problem: ContactProblem) -> "RemotePrepared":
        """Let the solver prepare ``problem``.

        Raises:
            FailedSolveError: if it does not answer.
        """
        self._prepared += 1
        prepared = RemotePrepared(self, problem, self._prepared)
        prepared.begin()
        return prepared

    def ask(self, request: str, *arguments: Any, seconds: float = 0.0) -> tuple[dict[str, Any], FloatArray]:
        """Return the answer to one request, which may take ``seconds`` longer than others.

        Raises:
            FailedSolveError: if there is none.
        """
        self._worker.seconds = self._seconds + seconds
        began = time.monotonic()
        try:
            answer, numbers = self._worker.ask(request, *arguments)
        except Fault as fault:
            self._sent = None
            raise FailedSolveError(self.name, fault) from None
        worked = answer.get("seconds", 0.0)
        if type(worked) is float:
            self.waiting_seconds += max(0.0, time.monotonic() - began - worked)
        return answer, numbers

    def prepare_there(self, problem: ContactProblem, number: int) -> None:
        """Let the solver prepare ``problem`` under a number."""
        self._send(problem)
        self.ask("prepare", number)

    def _send(self, problem: ContactProblem) -> None:
        if self._sent is not problem:
            self.ask("problem", problem_bytes(problem))
            self._sent = problem

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self._sent = None
        self._worker.close()


@dataclass(frozen=True)
class RemotePrepared:
    """A solver made ready for one problem, in its process."""

    solver: RemoteSolver
    problem: ContactProblem
    number: int

    def begin(self) -> None:
        """Let it be prepared."""
        self.solver.prepare_there(self.problem, self.number)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve there; iterates are shown when the solve is over. See ``Prepared.solve``.

        Raises:
            FailedSolveError: if the solver does not answer, or with what is no solution.
        """
        seconds = stop.max_seconds if np.isfinite(stop.max_seconds) else 0.0
        answer, numbers = self.solver.ask("solve", self.number, stop, start, observe is not None, seconds=seconds)
        if answer.get("unprepared"):  # another problem was prepared meanwhile, or the process is a fresh one
            self.begin()
            answer, numbers = self.solver.ask("solve", self.number, stop, start, observe is not None, seconds=seconds)
        shown: Any = answer.get("shown")
        n_rows = self.problem.n_rows
        fault = answer_fault(answer)
        if fault is None and not (_are_iterations(shown) and len(numbers) == n_rows * (len(shown) + 1)):
            fault = "its process sent something that is no answer"
        if fault:
            raise FailedSolveError(self.solver.name, Fault(Outcome.MISBEHAVED, fault))
        rows = numbers.reshape(len(shown) + 1, n_rows)
        if observe is not None:
            for iteration, impulses in zip(shown, rows[1:], strict=True):
                observe(iteration, impulses)
        return Solution(rows[0].copy(), Status(answer["status"]), answer["iterations"], answer["message"])


def _are_iterations(shown: Any) -> bool:
    return isinstance(shown, list) and all(type(iteration) is int and iteration >= 0 for iteration in shown)


@dataclass
class SolvingTask:
    """The child's half: answers "problem" (bytes), "supports", "prepare" (number) and "solve"."""

    contestant: Contestant
    _solver: Solver | None = None
    _problem: ContactProblem | None = None
    _prepared: Prepared | None = None
    _number: int = 0

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request, with the seconds that the solver itself took.

        Raises:
            MisbehaviourError: if the solver breaks its contract.
        """
        if self._solver is None:
            self._solver = self.contestant.make()
        if request == "problem":
            self._problem = read_problem(io.BytesIO(arguments[0]), "problem")
            return {}, b""
        began = time.monotonic()
        answer, numbers = getattr(self, f"_{request}")(self._solver, *arguments)
        return {**answer, "seconds": time.monotonic() - began}, numbers

    def _supports(self, solver: Solver) -> tuple[dict[str, Any], bytes]:
        assert self._problem is not None
        reason = solver.supports(self._problem)
        _refuse(reason_fault(reason))
        return {"refusal": reason or ""}, b""

    def _prepare(self, solver: Solver, number: int) -> tuple[dict[str, Any], bytes]:
        assert self._problem is not None
        self._prepared, self._number = solver.prepare(self._problem), number
        _refuse(prepared_fault(self._prepared))
        return {}, b""

    def _solve(
        self, solver: Solver, number: int, stop: Stop, start: FloatArray | None, is_observed: bool
    ) -> tuple[dict[str, Any], bytes]:
        problem, prepared = self._problem, self._prepared
        if problem is None or prepared is None or number != self._number:
            return {"unprepared": True}, b""
        shown: list[int] = []
        iterates: list[FloatArray] = []

        def note(iteration: int, impulses: FloatArray) -> None:
            iterates.append(np.array(impulses, dtype=np.float64))
            shown.append(int(iteration))
            if iterates[-1].shape != (problem.n_rows,):
                raise MisbehaviourError(
                    f"it showed its observer impulses of shape {iterates[-1].shape}, not a row each"
                )

        digest = problem.digest
        observe = note if is_observed else None
        solution = prepared.solve(stop, start=start, observe=observe)
        _refuse(solution_fault(problem, solution))
        if problem.fresh().digest != digest:
            raise MisbehaviourError("it changed the numbers of the problem")
        answer = {
            "status": solution.status.value,
            "iterations": int(solution.iterations),
            "message": str(solution.message),
            "shown": shown,
        }
        return answer, _joined([solution.impulses, *iterates])


def _joined(vectors: Sequence[FloatArray]) -> bytes:
    return b"".join(np.ascontiguousarray(vector, dtype=np.float64).tobytes() for vector in vectors)


def _refuse(fault: str | None) -> None:
    if fault:
        raise MisbehaviourError(fault)


def local_or_remote(name: str, seconds: float = SECONDS) -> Solver:
    """Return a solver by its name: itself if it is built in, else one that works in a process of its own.

    Args:
        name: its name, with options or without.
        seconds: wall time that a request to such a process may take beyond the time limit of its solve [s].

    Raises:
        ProxbenchError: for an unknown name or option, or a plugin's solver that cannot be made.
    """
    return _working(contestant(name), seconds)


@contextmanager
def working_solver(solver: Contestant) -> Iterator[Solver]:
    """Yield a solver that can be used here; a process of its own, if it has one, ends with the block."""
    working = _working(solver)
    try:
        yield working
    finally:
        if isinstance(working, RemoteSolver):
            working.close()


def _working(solver: Contestant, seconds: float = SECONDS) -> Solver:
    if solver.is_built_in:
        return solver.make()
    return cast(Solver, RemoteSolver(solver, seconds))  # whose has_iterates is its own, not its class's
