"""The loop that all projected iterations share: sweep, look at the judge's residual, stop or go on."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import ModelResidual, Residual
from ...problems.contact.solver import Observer, Solution, SolverError, Status, Stop
from ...problems.errors import ProblemError
from .stopping import CLEARLY_BETTER, CYCLE_PATIENCE, LONGEST_INTERVAL, Monitor, sweeps_to_next_look

LEAST_MOMENTUM = 0.3
"""A β up to this is not halved but left out."""

PROVING_SWEEPS = CYCLE_PATIENCE * LONGEST_INTERVAL
"""Sweeps without a clearly better residual in the judge's arithmetic before rounding may be said to be all: as many as
pass elsewhere before a lack of progress is suspected."""


class Iterates(Protocol):
    """The state of one iteration."""

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps over all laws."""
        ...

    def impulses(self) -> FloatArray:
        """Return Λ over rows, a fresh array of shape (n_rows,)."""
        ...

    def relative_velocity(self) -> FloatArray:
        """Return ξ = GΛ + c over rows, shape (n_rows,), an array that the next call may write to."""
        ...


@runtime_checkable
class Reducible(Protocol):
    """Iterates that are accelerated, and may be so less where there is no progress."""

    def reduce_acceleration(self) -> bool:
        """Accelerate less; return False if there is nothing left to reduce."""
        ...


class Accelerated:
    """What iterates with momentum share; ``momentum`` is β, at least 0 and below 1."""

    def __init__(self, momentum: float) -> None:
        self._momentum, self._present = momentum, 0.0  # β of the method, and of the coming sweep

    def reduce_acceleration(self) -> bool:
        """Halve β, at last leave it out, for there may be progress without; return False if there is none."""
        if self._momentum == 0.0:
            return False
        self._momentum = 0.5 * self._momentum if self._momentum > LEAST_MOMENTUM else 0.0
        self._present = min(self._present, self._momentum)
        return True


@dataclass(frozen=True)
class PreparedIteration:
    """A projected iteration made ready for one problem.

    Attributes:
        problem: the problem.
        begin: makes the iterates from the first Λ, shape (n_rows,).
    """

    problem: ContactProblem
    residual: Residual = field(repr=False)
    begin: Callable[[FloatArray], Iterates] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep until the residual reaches the tolerance; see ``Prepared.solve``."""
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return refuted(self.problem)
        advance = Advance(self.begin(first), self.begin, Monitor(stop), observe)
        while True:
            _, _, ended = looked(self.problem, self.residual, advance)
            if ended is not None:
                return advance.monitor.solution(ended, advance.iteration, self.problem.n_rows)
            advance.to_next_look()


def looked(
    problem: ContactProblem, residual: Residual, advance: "Advance"
) -> tuple[FloatArray, float, tuple[Status, str] | None]:
    """Return the present Λ, its residual, and status and reason if sweeps need not go on, else None.

    Where progress has ended acceleration is reduced, and those of two more sweeps are compared with the present one.
    """
    monitor, iterates = advance.monitor, advance.iterates
    impulses = iterates.impulses()
    found = residual(impulses, iterates.relative_velocity())
    if found <= monitor.stop.tolerance:
        found = confirmed(problem, residual, impulses, found, monitor.stop.tolerance)
    ended, repeats = monitor.look(advance.iteration, found, impulses), None
    if ended is None and monitor.suspects_cycle:
        if isinstance(iterates, Reducible) and iterates.reduce_acceleration():
            monitor.restart_progress()
        elif advance.iteration + 2 <= monitor.stop.max_iterations:
            repeats = advance.cycle(impulses)
    if ended is None and (repeats is not None or monitor.lacks_progress) and monitor.may_be_proven:
        ended = left_by_rounding(problem, residual, advance)
    return impulses, found, ended or repeats


def refuted(problem: ContactProblem) -> Solution:
    """Return the solution of an infeasible problem."""
    reason = "a unilateral law has G_ii = 0 and c_i < 0"
    joints = problem.laws.first_row[problem.laws.is_bilateral]
    if ((problem.delassus_diagonal[joints] == 0.0) & (problem.free_velocity[joints] != 0.0)).any():
        reason = "a bilateral law has G_ii = 0 and c_i ≠ 0"
    return Solution(np.zeros(problem.n_rows), Status.INFEASIBLE, 0, reason)


def judged(problem: ContactProblem, residual: Residual, impulses: FloatArray) -> float:
    """Return the residual of Λ, shape (n_rows,), in the judge's arithmetic: rounding must not pass for progress."""
    return residual.judged(problem, impulses)


def first_impulses(problem: ContactProblem, residual: Residual, start: FloatArray | None) -> FloatArray:
    """Return the Λ to begin with, a fresh array of shape (n_rows,): ``start``, or zeros where that is of no use.

    Raises:
        ProblemError: if ``start`` has the wrong shape.
    """
    zeros = np.zeros(problem.n_rows)
    first = zeros if start is None else np.array(start, dtype=np.float64)
    if first.shape != zeros.shape:
        raise ProblemError(f"start must have shape {zeros.shape}, one entry a row; got {first.shape}.")
    # c = 0 has the answer Λ = 0, against which any other start is infinitely wrong
    return zeros if residual.infeasible or residual.scale == 0.0 else first


def confirmed(
    problem: ContactProblem, residual: Residual, impulses: FloatArray, found: float, tolerance: float
) -> float:
    """Return ``found``, a residual within the tolerance, or the judge's where rounding may make a difference.

    ξ sums terms of the size G_ii Λ_i, which exceed c by the mass ratio where heavy bodies rest on light ones, and an
    iteration adds them in another order than the judge.
    """
    if residual.rounding(impulses) <= tolerance:
        return found
    return max(found, judged(problem, residual, impulses))


def left_by_rounding(problem: ContactProblem, residual: Residual, advance: "Advance") -> tuple[Status, str] | None:
    """Return how a solve without progress ended if rounding is all that keeps its best residual up, else None.

    Below rounding the iteration's residual does not say which Λ is the best: it may rest at one that it finds good,
    and pass by one that the judge finds right. So the iteration is begun again from its best Λ, as a user would, and
    its next iterates are held to the judge's arithmetic. Where they are no better the first iterates go on.
    """
    monitor, tolerance = advance.monitor, advance.monitor.stop.tolerance
    # the iteration's own ξ comes first because it costs nothing
    if monitor.best_impulses is None or not _is_rounding(residual, monitor.best_impulses, monitor):
        return None
    monitor.prove(advance.iteration, judged(problem, residual, monitor.best_impulses))
    first, advance.iterates, waited = advance.iterates, advance.begin(monitor.best_impulses), 0
    while waited < PROVING_SWEEPS and monitor.best_residual > tolerance:
        if monitor.clock.limit_met(monitor.stop, advance.iteration):
            return None
        advance.by(1)
        impulses, before = advance.iterates.impulses(), monitor.best_residual
        monitor.look(advance.iteration, judged(problem, residual, impulses), impulses)
        waited = 0 if monitor.best_residual < CLEARLY_BETTER * before else waited + 1
    if monitor.best_residual <= tolerance:
        return Status.SOLVED, ""
    if _is_rounding(residual, monitor.best_impulses, monitor):
        return Status.STALLED, f"rounding leaves the residual at {monitor.best_residual:.1e}"
    advance.iterates = first
    return None


def _is_rounding(residual: Residual, best: FloatArray, monitor: Monitor) -> bool:
    """Whether rounding of ξ may leave as much as the best residual at Λ = ``best``."""
    return monitor.best_residual <= residual.rounding(best)


def iterate(
    problem: ContactProblem,
    sweeps: Callable[[FloatArray], Iterator[FloatArray]],
    model: Model = Model.COULOMB,
) -> PreparedIteration:
    """Return an iteration made ready for ``problem`` from a generator: all that a simple method has to say.

    Tolerance, limits, cycles, stalls (impulses that are the same over twenty looks in a row), divergence, infeasible
    problems and observers are seen to.

    Args:
        problem: the contact problem.
        sweeps: ``sweeps(start)`` yields Λ [N s], shape (n_rows,), after each sweep, without end. It must not write to
            ``start``, and may use one array for all it yields.

        model: what is solved, by whose residual the solve stops.

    Raises:
        SolverError: from ``solve``, if the generator ends or yields an array of another shape.
    """
    residual = Residual(problem) if model == Model.COULOMB else ModelResidual(problem, model)
    return PreparedIteration(problem, residual, lambda start: _GeneratedIterates(problem, sweeps(start), start))


@dataclass
class _GeneratedIterates:
    """The iterates of a generator."""

    problem: ContactProblem
    generator: Iterator[FloatArray]
    latest: FloatArray

    def sweep(self, count: int) -> None:
        shape = (self.problem.n_rows,)
        for _ in range(count):
            latest = next(self.generator, None)
            if latest is None or np.shape(latest) != shape:
                said = "ended" if latest is None else f"yielded an array of shape {np.shape(latest)}"
                raise SolverError(
                    f"the generator of an iteration {said}; let it yield arrays of shape {shape} for ever."
                )
            self.latest = latest

    def impulses(self) -> FloatArray:
        return np.array(self.latest, dtype=np.float64)

    def relative_velocity(self) -> FloatArray:
        return self.problem.relative_velocity(self.latest)


@dataclass
class Advance:
    """Counts iterations, and shows each iterate to an observer if there is one, with the solver's clock stopped.

    ``begin`` makes iterates like the present ones from another Λ, shape (n_rows,).
    """

    iterates: Iterates
    begin: Callable[[FloatArray], Iterates]
    monitor: Monitor
    observe: Observer | None
    iteration: int = 0

    def by(self, count: int) -> None:
        """Do ``count`` sweeps."""
        if self.observe is None:
            self.iterates.sweep(count)
            self.iteration += count
            return
        for _ in range(count):
            self.iterates.sweep(1)
            self.arrive(self.iterates.impulses())

    def to_next_look(self, least: int = 1) -> int:
        """Do the sweeps until the residual is looked at again, ``least`` or the limit; return how many they are."""
        left = self.monitor.stop.max_iterations - self.iteration
        count = min(left, max(least, sweeps_to_next_look(self.iteration)))
        self.by(count)
        return count

    def cycle(self, before: FloatArray) -> tuple[Status, str] | None:
        """Do two sweeps from ``before``, the latest Λ; return how it ended if they lead back there."""
        self.by(1)
        previous = self.iterates.impulses()
        self.by(1)
        return self.monitor.cycle(self.iterates.impulses(), previous, before)

    def arrive(self, impulses: FloatArray) -> None:
        """Count one iteration that led to ``impulses``, an array that is not written to any more."""
        self.iteration += 1
        self.monitor.clock.show(self.observe, self.iteration, impulses)
