"""Sequences of solvers on one problem, which share the limits of one solve and keep the best impulses."""

from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Prepared, Solution, Solver, Status, Stop
from ...problems.errors import InsufficientMemoryError, error_text
from ..iteration.stopping import Clock


@dataclass(frozen=True)
class SolverRun:
    """One run of a solver in a sequence.

    Attributes:
        name: name of the run in messages.
        prepared: the prepared solver.
        start: the initial Λ [N s], shape (n_rows,), or None for zero.
        max_iterations: iteration limit of the run.
    """

    name: str
    prepared: Prepared
    start: FloatArray | None
    max_iterations: int


@dataclass(frozen=True, eq=False)
class _Unprepared:
    """A solver that cannot be prepared or run, because the memory does not suffice."""

    problem: ContactProblem
    reason: str

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Return the start, or zero, with the reason."""
        impulses = np.zeros(self.problem.n_rows) if start is None else start
        return Solution(impulses, Status.UNSUPPORTED, 0, self.reason)


@dataclass(eq=False)
class SolverSequence:
    """A sequence of solver runs in one solve.

    Attributes:
        problem: the problem.
        residual: the residual of the problem.
        prepared: prepared solvers by name, extended by ``prepare``.
        stop: the limits of the whole sequence.
        observe: receives the iterates of all runs, numbered consecutively.
        clock: clock of the whole sequence.
        iterations: number of iterations so far.
        history: the name and outcome of each run.
        best_impulses: the best Λ so far [N s], shape (n_rows,); None before the first run.
        best_residual: residual of ``best_impulses``, computed as the judge computes it.
        latest: the Λ of the last supported run [N s], shape (n_rows,); None before the first one.
        status: status of the last supported run, or ``Status.TIME_LIMIT`` if any run ended with it.
    """

    problem: ContactProblem
    residual: Residual
    prepared: dict[str, Prepared] = field(repr=False)
    stop: Stop
    observe: Observer | None
    clock: Clock
    iterations: int = 0
    history: list[str] = field(default_factory=list)
    best_impulses: FloatArray | None = None
    best_residual: float = np.inf
    latest: FloatArray | None = None
    status: Status = Status.STALLED

    def prepare(self, solver: Solver) -> Prepared:
        """Return the prepared solver, the same object for every run.

        If it needs more memory than is available, its runs end at once, and the sequence continues with the other
        solvers.
        """
        if solver.name not in self.prepared:
            try:
                self.prepared[solver.name] = solver.prepare(self.problem)
            except InsufficientMemoryError as error:
                self.prepared[solver.name] = _Unprepared(self.problem, error_text(error))
        return self.prepared[solver.name]

    def plan(self, solver: Solver, start: FloatArray | None, max_iterations: int) -> SolverRun:
        """Return a run of ``solver`` under its own name; see ``SolverRun``."""
        return SolverRun(solver.name, self.prepare(solver), start, max_iterations)

    def run(self, run: SolverRun) -> Solution | None:
        """Do one run; return the solution if the sequence is over, otherwise None."""
        remaining_iterations = self.stop.max_iterations - self.iterations
        limits = Stop(
            self.stop.tolerance, min(run.max_iterations, remaining_iterations), max(self.clock.remaining, 1e-9)
        )
        try:
            last = run.prepared.solve(limits, run.start, self._run_observer())
        except InsufficientMemoryError as error:
            last = _Unprepared(self.problem, error_text(error)).solve(limits, run.start)
        self.iterations += last.iterations
        reason = f" ({last.message})" if last.status is Status.UNSUPPORTED else ""
        self.history.append(f"{run.name}: {last.status}{reason}")
        if last.status is not Status.UNSUPPORTED:
            self.status = Status.TIME_LIMIT if Status.TIME_LIMIT in (self.status, last.status) else last.status
            self.latest = last.impulses
        if last.status in (Status.SOLVED, Status.INFEASIBLE):
            message = "; ".join([*self.history, last.message] if last.message else self.history)
            return Solution(last.impulses, last.status, self.iterations, message)
        self.keep_best(last.impulses, self.residual.judged(self.problem, last.impulses))
        limit = self.clock.reached_limit(self.stop, self.iterations)
        return self.finish(limit) if limit else None

    def keep_best(self, impulses: FloatArray, residual: float) -> None:
        """Record Λ and its residual if Λ is the best so far."""
        if self.best_impulses is None or residual < self.best_residual:
            self.best_impulses, self.best_residual = impulses, residual

    def finish(self, status: Status, reason: str | None = None) -> Solution:
        """Return the best Λ with the status and reason of the whole sequence; the reason defaults to the residual."""
        assert self.best_impulses is not None
        reason = f"residual {self.best_residual:.1e}" if reason is None else reason
        message = "; ".join([*self.history, reason] if reason else self.history)
        return Solution(self.best_impulses, status, self.iterations, message)

    def _run_observer(self) -> Observer | None:
        """Return an observer of one run that continues the iteration numbers of the previous runs."""
        observe, iterations_before = self.observe, self.iterations
        if observe is None:
            return None
        return lambda iteration, impulses: self.clock.show(observe, iterations_before + iteration, impulses)
