"""Traces of solves: curves over the iterations, and selected iterates."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Solver, Status, Stop, shows_iterates
from ...problems.representation import counted
from ..plugins.remote_solver import FailedSolveError
from .contact_states import contact_states, count_states

CURVE_THINNING, FRAME_THINNING = (1000, 1.003), (20, 1.08)
"""Arguments of ``Thinning`` for curves, which have a few thousand points at most, and for drawn iterates."""


@dataclass
class Thinning:
    """Selection of iterations that limits their number: all early ones, then a geometric sequence.

    Attributes:
        first: number of early iterations, all of which are selected.
        ratio: ratio of successive later iterations that are selected.
    """

    first: int
    ratio: float
    _next: float = 0.0

    def selects(self, iteration: int) -> bool:
        """Return whether an iteration is selected; iterations must be passed in ascending order."""
        if iteration < self._next:
            return False
        self._next = iteration + 1.0 if iteration < self.first else iteration * self.ratio
        return True


@dataclass
class Trace:
    """The trace of one solve.

    Curves have one value for each entry of ``iterations``.

    Attributes:
        solver: name of the solver.
        model: the model that the solver solves, in words.
        ending: how the solve ended, as a sentence.
        has_failed: whether the solver raised an error or returned no solution.
        iterations: numbers of the iterations of the curves, ascending from 0 (the start).
        residual: judged residual.
        complementarity: largest |Λ_N ξ_N| [J].
        step_change: norm of the change of Λ since the previous iteration [N s], 0 at the start.
        state_counts: numbers of open, sticking and slipping contacts, shape (3,) each.
        shown: numbers of the iterations whose impulses are stored.
        impulses: N and T components of Λ in these iterations [N s], padded to one row per contact, shape
            (n_contacts, 1 + n_tangents) each.
    """

    solver: str
    model: str
    ending: str = ""
    has_failed: bool = False
    iterations: list[int] = field(default_factory=list)
    residual: list[float] = field(default_factory=list)
    complementarity: list[float] = field(default_factory=list)
    step_change: list[float] = field(default_factory=list)
    state_counts: list[NDArray[np.int64]] = field(default_factory=list)
    shown: list[int] = field(default_factory=list)
    impulses: list[FloatArray] = field(default_factory=list)

    @property
    def sentence(self) -> str:
        """The number of iterations, the last residual, and how the solve ended."""
        if not self.iterations:
            return self.ending
        return f"{counted(self.iterations[-1], 'iteration')} to {self.residual[-1]:.1e}. {self.ending}"


class _TraceObserver:
    """Observer that records the iterates of one solve in a trace."""

    def __init__(self, problem: ContactProblem, trace: Trace) -> None:
        self._problem, self._trace = problem, trace
        self._residual = Residual(problem)
        self._normal_rows = problem.laws.first_row[problem.laws.is_unilateral]
        self._curves, self._frames = Thinning(*CURVE_THINNING), Thinning(*FRAME_THINNING)
        self._previous = self._last = np.zeros(problem.n_rows)
        self._iteration = 0

    def __call__(self, iteration: int, impulses: FloatArray) -> None:
        self._previous, self._last, self._iteration = self._last, impulses.copy(), iteration
        if self._curves.selects(iteration):
            self._add_point()
        if self._frames.selects(iteration):
            self._add_frame()

    def finish(self) -> None:
        """Record the last iterate if it was not selected."""
        if self._trace.iterations[-1] != self._iteration:
            self._add_point()
        if self._trace.shown[-1] != self._iteration:
            self._add_frame()

    def _add_point(self) -> None:
        trace, problem, impulses = self._trace, self._problem, self._last
        with np.errstate(all="ignore"):  # iterates of diverging solvers overflow
            velocity = problem.relative_velocity(impulses)
            products = np.abs(impulses[self._normal_rows] * velocity[self._normal_rows])
            change = float(np.linalg.norm(impulses - self._previous))
            residual = self._residual.judged(problem, impulses) if np.isfinite(impulses).all() else np.inf
        trace.iterations.append(self._iteration)
        trace.residual.append(residual)
        trace.complementarity.append(float(products.max(initial=0.0)))
        trace.step_change.append(change)
        trace.state_counts.append(count_states(contact_states(problem.layout, problem.layout.pad(impulses))))

    def _add_frame(self) -> None:
        self._trace.shown.append(self._iteration)
        layout = self._problem.layout
        # forces are drawn, moments are not
        self._trace.impulses.append(layout.pad(self._last)[:, : 1 + layout.sliding])


def trace_solve(problem: ContactProblem, solver: Solver, stop: Stop) -> Trace:
    """Solve a problem once from Λ = 0 and return the trace.

    An error of the solver ends the trace, which reports it. The trace of a solver without observable iterates contains
    only the start and the end.
    """
    trace = Trace(solver.name, str(solver.model))
    try:
        reason = solver.supports(problem)
        if reason:
            trace.ending = f"{Status.UNSUPPORTED.sentence.rstrip('.')}: {reason}."
            return trace
        observer = _TraceObserver(problem, trace)
        observer(0, np.zeros(problem.n_rows))
        try:
            prepared = solver.prepare(problem)
            solution = prepared.solve(stop, observe=observer if shows_iterates(solver) else None)
            if not shows_iterates(solver):
                observer(max(solution.iterations, 1), np.asarray(solution.impulses, dtype=np.float64))
        finally:
            observer.finish()
        trace.ending = solution.status.sentence
    except FailedSolveError as error:
        trace.ending, trace.has_failed = f"{error.reason[:1].upper()}{error.reason[1:]}.", True
    except Exception as error:
        trace.ending, trace.has_failed = f"It raised {type(error).__name__}: {error}", True
    return trace
