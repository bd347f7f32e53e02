"""A relay: solvers that take turns on one problem within the limits of one solve, the best impulses kept."""

from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Prepared, Solution, Solver, Status, Stop
from ..iteration.clock import Clock
from ..iteration.loop import judged


@dataclass(frozen=True)
class Turn:
    """What one solver does in a relay.

    Attributes:
        name: of the solver.
        prepared: the solver made ready.
        start: the Λ it begins with [N s], shape (n_rows,); None for the best so far.
        most: its limit of iterations.
    """

    name: str
    prepared: Prepared
    start: FloatArray | None
    most: int


@dataclass(eq=False)
class Relay:
    """The turns of one solve so far.

    Attributes:
        problem: the problem.
        residual: its residual.
        prepared: the solvers that are prepared already, by name; those of later turns are added.
        stop: the limits of all turns together.
        observe: is shown the iterates of all turns, counted through.
        clock: the time that is left.
        used: iterations done.
        ran: each solver that ran, with how it ended.
        best: the best Λ so far [N s], shape (n_rows,).
        lowest: its judged residual.
        latest: the Λ that the last solver ended with [N s], shape (n_rows,).
        status: how the last solver ended, or the time limit where one had no time for its next step.
    """

    problem: ContactProblem
    residual: Residual
    prepared: dict[str, Prepared] = field(repr=False)
    stop: Stop
    observe: Observer | None
    clock: Clock
    used: int = 0
    ran: list[str] = field(default_factory=list)
    best: FloatArray | None = None
    lowest: float = np.inf
    latest: FloatArray | None = None
    status: Status = Status.STALLED

    def ready(self, solver: Solver) -> Prepared:
        """Return a solver made ready, the same whenever its turn comes."""
        if solver.name not in self.prepared:
            self.prepared[solver.name] = solver.prepare(self.problem)
        return self.prepared[solver.name]

    def turn(self, solver: Solver, start: FloatArray | None, most: int) -> Turn:
        """Return a turn of a solver; see ``Turn``."""
        return Turn(solver.name, self.ready(solver), start, most)

    def take(self, turn: Turn) -> Solution | None:
        """Let one solver run; return the solution if the relay is over, else None."""
        left = self.stop.max_iterations - self.used
        limits = Stop(self.stop.tolerance, min(turn.most, left), max(self.clock.left, 1e-9))
        origin = self.best if turn.start is None else turn.start
        last = turn.prepared.solve(limits, origin, self._shown())
        self.used += last.iterations
        self.status = Status.TIME_LIMIT if Status.TIME_LIMIT in (self.status, last.status) else last.status
        self.ran.append(f"{turn.name}: {last.status}")
        self.latest = last.impulses
        residual = judged(self.problem, self.residual, last.impulses)
        self.keep(last.impulses, residual)
        if last.status in (Status.SOLVED, Status.INFEASIBLE):
            return Solution(last.impulses, last.status, self.used, "; ".join(self.ran))
        limit = self.clock.limit_met(self.stop, self.used)
        return self.ended(limit, f"residual {self.lowest:.1e}") if limit else None

    def keep(self, impulses: FloatArray, residual: float) -> None:
        """Note Λ of this residual if it is the best so far."""
        if self.best is None or residual < self.lowest:
            self.best, self.lowest = impulses, residual

    def ended(self, status: Status, *reasons: str) -> Solution:
        """Return the best Λ with the status the relay ended in, and why."""
        assert self.best is not None
        return Solution(self.best, status, self.used, "; ".join([*self.ran, *reasons]))

    def _shown(self) -> Observer | None:
        """Return an observer of one turn that counts the iterations of those before."""
        observe, before = self.observe, self.used
        if observe is None:
            return None
        return lambda iteration, impulses: self.clock.show(observe, before + iteration, impulses)
