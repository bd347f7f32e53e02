"""The loop that all projected iterations share: sweep, check the judge's residual, stop or continue."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual, residual_under
from ...problems.contact.solver import Observer, Solution, SolverError, Status, Stop, start_impulses
from .stopping import BETTER_RATIO, CYCLE_PATIENCE, MAX_CHECK_INTERVAL, Monitor, Outcome, sweeps_to_next_check

ROUNDING_TEST_SWEEPS = CYCLE_PATIENCE * MAX_CHECK_INTERVAL
"""Number of sweeps without a clearly better residual in the judge's arithmetic that establishes the rounding limit."""

MAX_LAWS_SWEPT = 500_000
"""Number of sweeps times laws, a few milliseconds of work, after which the clock is read at the next check."""


class Iterates(Protocol):
    """The state of one iteration."""

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps over all laws."""
        ...

    def impulses(self) -> FloatArray:
        """Return Λ over rows, a fresh array of shape (n_rows,)."""
        ...

    def relative_velocity(self) -> FloatArray:
        """Return ξ = GΛ + c over rows, shape (n_rows,); the next call may overwrite the array."""
        ...


class SinglePassIterates:
    """Base class of iterates that measure their residual in one pass, without an array of relative velocities."""

    def impulses_and_residual(self, residual: Residual) -> tuple[FloatArray, float]:
        """Return Λ over rows, a fresh array of shape (n_rows,), and its residual."""
        raise NotImplementedError


class WindowedIterates(SinglePassIterates):
    """Base class of iterates that sweep and measure their residual repeatedly in one call."""

    def has_windows(self, residual: Residual) -> bool:
        """Return whether ``run_window`` applies to a residual."""
        raise NotImplementedError

    @property
    def sweeps_to_change(self) -> float:
        """Number of sweeps after which the residual may change the next ones; infinite if it never does."""
        raise NotImplementedError

    def run_window(self, counts: Sequence[int], residual: Residual, limits: tuple[float, float]) -> "Window":
        """Do each number of sweeps, measure the residual after each, and stop at the first one beyond the limits.

        The window ends after all counts, or at a residual that is not between the limits. The iterates record the
        residuals before the last one.
        """
        raise NotImplementedError


class Window(NamedTuple):
    """The residuals of a window, and a function that returns Λ over rows with the lowest residual before the last one.

    If there is only one residual, the function has no meaning.
    """

    residuals: FloatArray
    best_impulses: Callable[[], FloatArray]


class MeasuringIterates:
    """Base class of iterates whose acceleration may follow the measured residuals."""

    def note_residual(self, residual: float) -> None:
        """Record the residual of the current Λ."""
        raise NotImplementedError


def impulses_and_residual(iterates: Iterates, residual: Residual) -> tuple[FloatArray, float]:
    """Return Λ over rows, a fresh array of shape (n_rows,), and its residual."""
    if isinstance(iterates, SinglePassIterates):
        return iterates.impulses_and_residual(residual)
    impulses = iterates.impulses()
    return impulses, residual(impulses, iterates.relative_velocity())


Inner = TypeVar("Inner", bound=Iterates)


class WrappedIterates(Generic[Inner]):
    """Base class of iterates that modify the sweeps of other iterates, whose Λ and ξ they share."""

    _iterates: Inner

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._iterates.impulses()

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        return self._iterates.relative_velocity()


@runtime_checkable
class AcceleratedIterates(Iterates, Protocol):
    """Iterates whose acceleration can be reduced when the residual makes no progress."""

    def reduce_acceleration(self) -> bool:
        """Reduce the acceleration; return False if there is none left."""
        ...


@dataclass(frozen=True)
class PreparedIteration:
    """A projected iteration prepared for one problem.

    Attributes:
        problem: the problem.
        residual: its residual.
        begin: function that creates the iterates from the first Λ, shape (n_rows,).
    """

    problem: ContactProblem
    residual: Residual = field(repr=False)
    begin: Callable[[FloatArray], Iterates] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep until the residual reaches the tolerance; see ``Prepared.solve``."""
        first = initial_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        driver = IterationDriver(self.begin(first), self.begin, Monitor(stop), observe)
        while True:
            outcome = check_convergence(self.problem, self.residual, driver).outcome
            if outcome is not None:
                return driver.monitor.solution(outcome, driver.iteration, self.problem.n_rows)
            driver.run_to_next_decision(self.residual)


def _first_counts(counts: tuple[int, ...], max_sweeps: float) -> tuple[int, ...]:
    """Return the first counts, up to the one whose sum reaches ``max_sweeps``."""
    if sum(counts) <= max_sweeps:
        return counts
    total = 0
    for number, count in enumerate(counts, 1):
        total += count
        if total >= max_sweeps:
            return counts[:number]
    return counts


@dataclass
class IterationDriver:
    """Driver that runs and counts the iterations of one solve, and passes each iterate to the observer, if any.

    Attributes:
        iterates: the current iterates.
        begin: function that creates iterates of the same kind from another Λ, shape (n_rows,).
        monitor: decides when to stop.
        observe: the observer, or None.
        iteration: number of iterations so far.
    """

    iterates: Iterates
    begin: Callable[[FloatArray], Iterates]
    monitor: Monitor
    observe: Observer | None
    iteration: int = 0

    def run(self, count: int) -> None:
        """Do ``count`` sweeps."""
        if self.observe is None:
            self.iterates.sweep(count)
            self.iteration += count
            return
        for _ in range(count):
            self.iterates.sweep(1)
            self.record(self.iterates.impulses())

    def run_to_next_check(self, min_sweeps: int = 1) -> int:
        """Sweep until the next residual check, at least ``min_sweeps`` times within the limit; return the number."""
        remaining = self.monitor.stop.max_iterations - self.iteration
        count = min(remaining, max(min_sweeps, sweeps_to_next_check(self.iteration)))
        self.run(count)
        return count

    def run_to_next_decision(self, residual: Residual) -> None:
        """Sweep until a check may end the sweeps or change them; record the residuals of the checks before."""
        iterates, counts = self.iterates, self.monitor.sweeps_between_checks(self.iteration)
        if self.observe is None and isinstance(iterates, WindowedIterates) and iterates.has_windows(residual):
            counts = _first_counts(counts, min(iterates.sweeps_to_change, MAX_LAWS_SWEPT / max(len(residual.alpha), 1)))
            if len(counts) > 1:
                limits = self.monitor.stop.tolerance, self.monitor.max_residual
                window = iterates.run_window(counts, residual, limits)
                for count, measured in zip(counts, window.residuals[:-1], strict=False):
                    self.iteration += count
                    self.monitor.record(self.iteration, float(measured), window.best_impulses)
                self.iteration += counts[len(window.residuals) - 1]
                return
        self.run(counts[0])

    def check_cycle(self, second_last: FloatArray) -> Outcome | None:
        """Do two sweeps from ``second_last``, the latest Λ; return the outcome if they lead back to it."""
        self.run(1)
        previous = self.iterates.impulses()
        self.run(1)
        return self.monitor.check_cycle(self.iterates.impulses(), previous, second_last)

    def record(self, impulses: FloatArray) -> None:
        """Count one iteration that produced ``impulses``; the caller must not write to them afterwards."""
        self.iteration += 1
        self.monitor.clock.show(self.observe, self.iteration, impulses)


class Check(NamedTuple):
    """The current Λ, shape (n_rows,), its residual, and the outcome if the sweeps are over."""

    impulses: FloatArray
    residual: float
    outcome: Outcome | None


def check_convergence(problem: ContactProblem, residual: Residual, driver: IterationDriver) -> Check:
    """Measure the residual of the current Λ and decide whether the sweeps are over.

    If the residual makes no progress, the acceleration is reduced. If there is none left to reduce, two more sweeps
    follow instead, and their Λ is compared with the current one.
    """
    monitor, iterates = driver.monitor, driver.iterates
    impulses, measured = impulses_and_residual(iterates, residual)
    if measured <= monitor.stop.tolerance:
        measured = confirm_residual(problem, residual, impulses, measured, monitor.stop.tolerance)
    outcome, cycle = monitor.check_convergence(driver.iteration, measured, impulses), None
    if outcome is None and isinstance(iterates, MeasuringIterates):
        iterates.note_residual(measured)
    if outcome is None and monitor.suspects_cycle:
        if isinstance(iterates, AcceleratedIterates) and iterates.reduce_acceleration():
            monitor.restart_progress()
        elif driver.iteration + 2 <= monitor.stop.max_iterations:
            cycle = driver.check_cycle(impulses)
    if outcome is None and (cycle is not None or monitor.lacks_progress) and monitor.may_test_rounding:
        outcome = check_rounding_limit(problem, residual, driver)
    return Check(impulses, measured, outcome or cycle)


def infeasible_solution(problem: ContactProblem) -> Solution:
    """Return the solution of an infeasible problem."""
    reason = "a unilateral law has G_ii = 0 and c_i < 0"
    joints = problem.laws.first_row[problem.laws.is_bilateral]
    if ((problem.delassus_diagonal[joints] == 0.0) & (problem.free_velocity[joints] != 0.0)).any():
        reason = "a bilateral law has G_ii = 0 and c_i ≠ 0"
    return Solution(np.zeros(problem.n_rows), Status.INFEASIBLE, 0, reason)


def initial_impulses(problem: ContactProblem, residual: Residual, start: FloatArray | None) -> FloatArray:
    """Return the first Λ, a fresh array of shape (n_rows,): ``start``, or zeros if no start is useful.

    The normal impulses of contacts that open for any Λ are set to zero, because sweeps would not change them.

    Raises:
        ProblemError: if ``start`` has the wrong shape, or is not made of finite real numbers.
    """
    first = start_impulses(start, problem.n_rows)
    if residual.infeasible or residual.scale == 0.0:
        first[:] = 0.0  # c = 0 has the solution Λ = 0, and any other start has an infinite relative error
    elif start is not None and not problem.delassus_diagonal.all():
        first[_rows_that_open(problem)] = 0.0
    return first


def _rows_that_open(problem: ContactProblem) -> IntArray:
    """Return the rows i of unilateral laws with G_ii = 0 and c_i > 0, where ξ_i = c_i and therefore Λ_i = 0."""
    rows = problem.laws.first_row[problem.laws.is_unilateral]
    opens: IntArray = rows[(problem.delassus_diagonal[rows] == 0.0) & (problem.free_velocity[rows] > 0.0)]
    return opens


def confirm_residual(
    problem: ContactProblem, residual: Residual, impulses: FloatArray, measured: float, tolerance: float
) -> float:
    """Return ``measured``, a residual within the tolerance, or the judge's residual if rounding may matter.

    ξ is a sum of terms of size G_ii Λ_i. If heavy bodies rest on light ones, these exceed c by the mass ratio. An
    iteration adds them in another order than the judge.
    """
    if residual.rounding(impulses) <= tolerance:
        return measured
    return max(measured, residual.judged(problem, impulses))


def check_rounding_limit(problem: ContactProblem, residual: Residual, driver: IterationDriver) -> Outcome | None:
    """Return the outcome if rounding alone keeps the best residual above the tolerance, else None.

    Near the rounding limit, the residual that the iteration computes does not identify the best Λ. By this residual,
    the iteration may prefer another Λ to one that the judge accepts. It is therefore restarted from its best Λ, and the
    new iterates are measured in the judge's arithmetic. If they are no better, the old iterates continue.
    """
    monitor, tolerance = driver.monitor, driver.monitor.stop.tolerance
    # test the residual of the iteration first, because it is already known
    if monitor.best_impulses is None or not _is_rounding(residual, monitor.best_impulses, monitor):
        return None
    monitor.begin_rounding_test(driver.iteration, residual.judged(problem, monitor.best_impulses))
    old_iterates, driver.iterates, n_unimproved = driver.iterates, driver.begin(monitor.best_impulses), 0
    while n_unimproved < ROUNDING_TEST_SWEEPS and monitor.best_residual > tolerance:
        if monitor.clock.reached_limit(monitor.stop, driver.iteration):
            return None
        driver.run(1)
        impulses, previous_residual = driver.iterates.impulses(), monitor.best_residual
        monitor.check_convergence(driver.iteration, residual.judged(problem, impulses), impulses)
        n_unimproved = 0 if monitor.best_residual < BETTER_RATIO * previous_residual else n_unimproved + 1
    if monitor.best_residual <= tolerance:
        return Outcome(Status.SOLVED, "")
    if _is_rounding(residual, monitor.best_impulses, monitor):
        return Outcome(Status.STALLED, f"rounding limits the residual to {monitor.best_residual:.1e}")
    driver.iterates = old_iterates
    return None


def _is_rounding(residual: Residual, best: FloatArray, monitor: Monitor) -> bool:
    """Whether rounding errors of ξ at Λ = ``best`` explain the best residual."""
    return monitor.best_residual <= residual.rounding(best)


def iterate(
    problem: ContactProblem, sweeps: Callable[[FloatArray], Iterator[FloatArray]], model: Model = Model.COULOMB
) -> PreparedIteration:
    """Prepare an iteration for ``problem`` from a generator of impulses.

    The result handles tolerance, limits, observers, infeasible problems, cycles, divergence and stalls.

    Args:
        problem: the contact problem.
        sweeps: ``sweeps(start)`` yields Λ [N s], shape (n_rows,), after each sweep, without end. It must not write to
            ``start``, and may yield the same array each time.
        model: the model that is solved; its residual stops the solve.

    Raises:
        SolverError: from ``solve``, if the generator ends or yields an array of another shape.
    """
    residual = residual_under(problem, model)
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
                fault = "ended" if latest is None else f"yielded an array of shape {np.shape(latest)}"
                raise SolverError(
                    f"the generator of an iteration {fault}; it must yield arrays of shape {shape} without end."
                )
            self.latest = latest

    def impulses(self) -> FloatArray:
        return np.array(self.latest, dtype=np.float64)

    def relative_velocity(self) -> FloatArray:
        return self.problem.relative_velocity(self.latest)
