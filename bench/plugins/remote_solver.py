"""A solver in a separate process, with the ``Solver`` interface.

It is used for successive solves: those of a solver matrix, of a recording, and of the steps of a simulation. If the
solver raises an exception, hangs, crashes or exhausts memory, this process is not affected. A request without an answer
raises ``FailedSolveError``, and the next request starts a new process.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, cast

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Observer, Prepared, Solution, Solver, Status, Stop
from ...problems.exchange.files.problem_file import problem_bytes, read_problem
from ...solvers.contract import MAX_ITERATIONS, prepared_fault, reason_fault, solution_fault
from ..errors import BenchError
from ..isolation.child import MisbehaviourError, raise_fault
from ..isolation.worker import INVALID_ANSWER, MEMORY_BYTES, REQUEST_SECONDS, Fault, RenewedWorker
from ..store.outcome import LATE_PREPARING, Outcome, late_reason
from .descriptions import solver_spec
from .solver_specs import SolverSpec

GRACE_SECONDS = 1.0
"""Wall time by which a solver may exceed its time limit before its process is killed [s]."""


class FailedSolveError(BenchError):
    """A solver did not return a solution.

    Attributes:
        outcome: how the solve failed.
        reason: why it failed, as a clause.
    """

    def __init__(self, name: str, fault: Fault) -> None:
        super().__init__(f"{name}: {fault.reason}.")
        self.outcome, self.reason = fault.outcome, fault.reason


class RemoteSolver(RenewedWorker):
    """A solver in a separate process; use it as a context manager, or call ``close``.

    Attributes:
        spec: the specification of the solver.
        name: name of the solver, with options.
        model: the model that it solves.
        has_iterates: whether its iterates can be observed.
    """

    def __init__(
        self,
        solver: SolverSpec,
        seconds: float = REQUEST_SECONDS,
        memory_bytes: int = MEMORY_BYTES,
        limit_seconds: float = np.inf,
    ) -> None:
        """Store the specification; the process starts with the first request.

        Args:
            solver: the solver.
            seconds: wall time limit of a request [s]. A solve has its own time limit in addition, so that ``seconds``
                covers the preparation and the last iteration.
            memory_bytes: memory limit [bytes], in addition to the memory that the framework needs.
            limit_seconds: wall time limit of preparing and solving together [s], after which a request has
                ``GRACE_SECONDS`` to end. If infinite, ``seconds`` applies instead.
        """
        super().__init__(SolvingTask(solver), seconds, memory_bytes, solver.compiled_solvers)
        self.spec, self._limit_seconds = solver, limit_seconds
        self.name, self.model, self.has_iterates = solver.name, solver.model, solver.has_iterates
        self._sent: ContactProblem | None = None
        self._ready: ContactProblem | None = None

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why ``problem`` is not supported, or None.

        Raises:
            FailedSolveError: if the solver does not answer.
        """
        if self.spec.starts_warm:
            return "it starts from its answer to the previous step, which only `proxbench run` provides"
        self._send(problem)
        answer, _ = self.ask_in_time("supports")
        return str(answer.get("unsupported_reason", "")) or None

    def prepare(self, problem: ContactProblem) -> "RemotePrepared":
        """Prepare ``problem`` in the process of the solver.

        Raises:
            FailedSolveError: if the solver does not answer.
        """
        self._ready = None
        self.ensure_prepared(problem)
        return RemotePrepared(self, problem)

    def ensure_prepared(self, problem: ContactProblem) -> None:
        """Prepare ``problem`` in the process of the solver, unless it is the last one prepared there."""
        self._send(problem)
        if self._ready is not problem:
            self.ask_in_time("prepare")
            self._ready = problem

    def ask_in_time(self, request: str, *arguments: Any, max_seconds: float = np.inf) -> tuple[dict[str, Any], bytes]:
        """Return the answer to a request that runs the solver; kill its process after the time limit.

        Args:
            request: name of the request.
            arguments: its arguments.
            max_seconds: time limit of the solve [s].

        Returns:
            The fields of the answer, and its binary content, as ``SolvingTask.answer`` returns them.

        Raises:
            FailedSolveError: if the solver does not answer.
        """
        if np.isinf(self._limit_seconds):
            solve_seconds = max_seconds if np.isfinite(max_seconds) else 0.0
            return self.ask(request, *arguments, seconds=self.seconds + solve_seconds)
        limit = min(self._limit_seconds, max_seconds)
        try:
            return self.ask(request, *arguments, seconds=limit + GRACE_SECONDS)
        except FailedSolveError as error:
            if error.outcome is not Outcome.TIMEOUT:
                raise
            reason = f"it did not end at its time limit of {limit:g} s"
            raise FailedSolveError(self.name, Fault(Outcome.TIMEOUT, reason)) from None

    @property
    def has_one_limit(self) -> bool:
        """Whether preparing counts towards the time limit of a solve."""
        return bool(np.isfinite(self._limit_seconds))

    def failure(self, fault: Fault) -> Exception:
        """Return the error for a request without an answer."""
        return FailedSolveError(self.name, fault)

    def close(self) -> None:
        """End the process."""
        self._sent = self._ready = None
        super().close()

    def _send(self, problem: ContactProblem) -> None:
        """Send a problem to the process, unless it is the last one sent."""
        if self._sent is not problem:
            self._ready = None
            self.ask("problem", problem_bytes(problem))
            self._sent = problem


@dataclass(frozen=True)
class RemotePrepared:
    """A solver that is prepared for one problem, in its process."""

    solver: RemoteSolver
    problem: ContactProblem

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve in the process; iterates are passed to the observer after the solve. See ``Prepared.solve``.

        Raises:
            FailedSolveError: if the solver does not answer, or its answer is not a solution.
        """
        self.solver.ensure_prepared(self.problem)  # needed if another problem was prepared, or the process is new
        arguments = stop, start, observe is not None, self.solver.has_one_limit
        answer, _ = self.solver.ask_in_time("solve", *arguments, max_seconds=stop.max_seconds)
        _, content = self.solver.ask("impulses")  # outside the time limit: the transfer of iterates does not count
        iterations: Any = answer.get("observed_iterations")
        n_rows = self.problem.n_rows
        if answer_fault(answer) or not are_iterations(iterations) or len(content) != 8 * n_rows * (len(iterations) + 1):
            raise self.solver.reject_answer()
        rows = np.frombuffer(content, dtype=np.float64).reshape(len(iterations) + 1, n_rows)
        if observe is not None:
            for iteration, impulses in zip(iterations, rows[1:], strict=True):
                observe(iteration, impulses)
        return Solution(rows[0].copy(), Status(answer["status"]), answer["iterations"], answer["message"])


def answer_fault(answer: dict[str, Any]) -> str | None:
    """Return why an answer to a solve is invalid, or None."""
    status, iterations, message = (answer.get(key) for key in ("status", "iterations", "message"))
    is_valid_count = type(iterations) is int and 0 <= iterations <= MAX_ITERATIONS
    if not (status in set(Status) and is_valid_count and isinstance(message, str)):
        return INVALID_ANSWER
    return None


def are_iterations(values: Any) -> bool:
    """Return whether ``values`` is a list of valid iteration numbers."""
    return isinstance(values, list) and all(type(value) is int and 0 <= value <= MAX_ITERATIONS for value in values)


@dataclass
class SolvingTask:
    """The task of the child process, which answers requests.

    The requests are "problem", "supports", "prepare", "solve", and "impulses" for the impulses of the last solve.

    Attributes:
        solver_spec: the specification from which the child process creates the solver.
    """

    solver_spec: SolverSpec
    _solver: Solver | None = None
    _problem: ContactProblem | None = None
    _prepared: Prepared | None = None
    _prepare_seconds: float = 0.0
    _impulses: bytes = b""

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request with JSON fields and binary content.

        Raises:
            MisbehaviourError: if the solver breaks its contract.
        """
        if self._solver is None:
            self._solver = self.solver_spec.make()
        if request == "problem":
            self._problem = read_problem(io.BytesIO(arguments[0]), "problem")
            return {}, b""
        if request == "impulses":
            content, self._impulses = self._impulses, b""
            return {}, content
        result: tuple[dict[str, Any], bytes] = getattr(self, f"_{request}")(self._solver, self._problem, *arguments)
        return result

    def _supports(self, solver: Solver, problem: ContactProblem) -> tuple[dict[str, Any], bytes]:
        reason = solver.supports(problem)
        raise_fault(reason_fault(reason))
        return {"unsupported_reason": reason or ""}, b""

    def _prepare(self, solver: Solver, problem: ContactProblem) -> tuple[dict[str, Any], bytes]:
        began = perf_counter()
        self._prepared = solver.prepare(problem)
        self._prepare_seconds = perf_counter() - began
        raise_fault(prepared_fault(self._prepared))
        return {}, b""

    def _solve(
        self,
        solver: Solver,
        problem: ContactProblem,
        stop: Stop,
        start: FloatArray | None,
        is_observed: bool,
        has_one_limit: bool,
    ) -> tuple[dict[str, Any], bytes]:
        assert self._prepared is not None
        observed_iterations: list[int] = []
        iterates: list[FloatArray] = []

        def record(iteration: int, impulses: FloatArray) -> None:
            iterates.append(np.array(impulses, dtype=np.float64))
            observed_iterations.append(int(iteration))
            shape = iterates[-1].shape
            if shape != (problem.n_rows,):
                raise MisbehaviourError(f"it passed impulses of shape {shape} to its observer, not (n_rows,)")

        digest = problem.digest
        remaining, began = stop.max_seconds - (self._prepare_seconds if has_one_limit else 0.0), perf_counter()
        if remaining > 0.0:
            remaining_stop = replace(stop, max_seconds=remaining)
            solution = self._prepared.solve(remaining_stop, start=start, observe=record if is_observed else None)
        else:
            solution = Solution(np.zeros(problem.n_rows), Status.TIME_LIMIT, 0, LATE_PREPARING)
        late = late_reason(self._prepare_seconds + perf_counter() - began, stop.max_seconds) if has_one_limit else ""
        raise_fault(solution_fault(problem, solution))
        if problem.fresh().digest != digest:
            raise MisbehaviourError("it changed the numbers of the problem")
        if late and solution.status is Status.SOLVED:
            solution = replace(solution, status=Status.TIME_LIMIT, message=late)
        answer = {
            "status": solution.status.value,
            "iterations": int(solution.iterations),
            "message": str(solution.message),
            "observed_iterations": observed_iterations,
        }
        self._impulses = np.array([solution.impulses, *iterates], dtype=np.float64).tobytes()
        return answer, b""


def local_or_remote_solver(name: str, seconds: float = REQUEST_SECONDS) -> Solver:
    """Create a solver by its name, in a separate process if it comes from a plugin.

    Args:
        name: name of the solver, with or without options.
        seconds: as in ``RemoteSolver``.

    Raises:
        ProxbenchError: for an unknown name or option, or if a plugin's solver cannot be created.
    """
    return _create_solver(solver_spec(name), seconds)


@contextmanager
def open_solver(solver: SolverSpec, limit_seconds: float = np.inf) -> Iterator[Solver]:
    """Yield a solver, and end its process, if any, when the context ends.

    Args:
        solver: the solver.
        limit_seconds: as in ``RemoteSolver``.
    """
    created = _create_solver(solver, limit_seconds=limit_seconds)
    try:
        yield created
    finally:
        if isinstance(created, RemoteSolver):
            created.close()


def _create_solver(solver: SolverSpec, seconds: float = REQUEST_SECONDS, limit_seconds: float = np.inf) -> Solver:
    """Create a solver, in a separate process unless it is built in."""
    if solver.is_built_in:
        return solver.make()
    remote = RemoteSolver(solver, seconds, limit_seconds=limit_seconds)
    return cast(Solver, remote)  # a solver may have has_iterates as an attribute instead of a property
