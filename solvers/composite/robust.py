"""Robust: sweeps while they are fast, then more expensive methods.

Sweeps solve most problems of flowing material in less time than one factorisation. If sweeps are slow, Newton's method
often succeeds once they have identified which contacts stick and slip. Interior point methods solve the other problems,
such as piles and stacks with redundant contacts.

    sweeps              while each window of sweeps gains a digit
    accelerated sweeps  while each tenth of a window gains a digit
    Newton steps        a few from the last swept impulses
    InteriorNewton      interior points, their path, Newton's method and sweeps

Sweeps gain a digit when they reduce the residual tenfold. A window (``windows``) takes at most about half as long as an
interior point method, and about a fifth on piles of balls. Slow sweeps thus take little time compared with the methods
that follow. Anderson acceleration often gains more in a few sweeps than momentum in a whole window. Newton steps on few
rows take no longer than a hundred sweeps. With joints, they transmit impulses along whole chains; a sweep transmits
them only to the next joint. In both cases the first windows are short: Newton steps are tried after the first window
that gains no digit, and sweeps continue if the steps fail. No decision depends on the tolerance, on the number of
cores, or, except for the time limit, on the clock. After the first window, numerical libraries use one thread, so that
results do not depend on the number of cores.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cache, partial

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Observer, Prepared, Solution, Status, Stop
from ...problems.errors import InsufficientMemoryError, error_text
from ..iteration.cores import one_library_thread
from ..iteration.loop import (
    Iterates,
    IterationDriver,
    PreparedIteration,
    check_convergence,
    infeasible_solution,
    initial_impulses,
)
from ..iteration.method import Method
from ..iteration.stopping import Monitor
from ..newton.linearised import Equations
from ..newton.steps import LINE_SEARCH, NewtonRunner
from ..prox.accelerated_sorprox import AndersonSORprox
from .interior_newton import run_sequence
from .sequence import SolverSequence
from .small.prepared import SMALL_KERNELS, prepare_small
from .sweep_selection import MAX_SMALL_ROWS, can_accelerate, select_sweeps, sweeps_between_checks
from .windows import Window, longest_window, window_lengths

ACCELERATED, ACCELERATED_SHARE = AndersonSORprox(), 10
"""The accelerated sweeps, and how many times longer a window of other sweeps is."""

NEWTON_SETTINGS = replace(LINE_SEARCH, max_steps=8)
"""Settings of Newton steps from the last swept impulses, which identify states before the residual has fallen."""

FINAL_STATUSES = (Status.SOLVED, Status.ITERATION_LIMIT, Status.TIME_LIMIT)
"""Outcomes of sweeps that end the solve."""


@dataclass(frozen=True)
class Robust(Method):
    """The solver to try first: fast if sweeps converge quickly, and reliable otherwise.

    The message of a solution lists the parts that ran and the outcome of each. One iteration is an iteration of the
    part that runs.
    """

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Prepare the sweeps; other parts are prepared when they first run.

        On few rows, one kernel runs all sweeps and gives the same results, once it is worth loading (see
        ``DeferredKernels``). It does not support all laws, and leaves hard solves to the parts.
        """
        if 0 < len(problem.free_velocity) <= MAX_SMALL_ROWS and SMALL_KERNELS.should_use():
            return prepare_small(problem, prepare_by_parts) or prepare_by_parts(problem)
        return prepare_by_parts(problem)


def prepare_by_parts(problem: ContactProblem) -> "PreparedRobust":
    """Prepare the sweeps of a problem of any size."""
    sweeps = select_sweeps(problem)
    return PreparedRobust(problem, sweeps.name, sweeps.prepare(problem), sweeps_between_checks(problem, sweeps))


@dataclass(frozen=True, eq=False)
class PreparedRobust:
    """The prepared sweeps of one problem, their minimum number between checks, and the other prepared parts by name."""

    problem: ContactProblem
    name: str
    sweeps: PreparedIteration = field(repr=False)
    between_checks: int = 1
    prepared: dict[str, Prepared] = field(default_factory=dict, repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep while that is fast, then run the other parts; see ``Prepared.solve``."""
        problem, residual = self.problem, self.sweeps.residual
        first = initial_impulses(problem, residual, start)
        if residual.infeasible:
            return infeasible_solution(problem)
        monitor = Monitor(stop)
        driver = IterationDriver(self.sweeps.begin(first), self.sweeps.begin, monitor, observe)
        sequence = SolverSequence(problem, residual, self.prepared, stop, observe, monitor.clock)
        equations = cache(partial(Equations, problem, residual))
        lengths = window_lengths(problem)
        with ExitStack() as limits:
            for length in lengths:
                window = Window(length, driver.iteration, partial(longest_window, sequence))
                result = run_sweeps(sequence, driver, self.name, window, first=first, min_sweeps=self.between_checks)
                if result.solution is not None:
                    return result.solution
                if length == lengths[0]:
                    limits.enter_context(one_library_thread())
                is_last_window = result.has_ended or length == lengths[-1]
                begin = accelerated_sweeps(sequence) if is_last_window else None
                if begin is not None:
                    driver = IterationDriver(begin(result.best.copy()), begin, monitor, observe, sequence.iterations)
                    full_length = window.length if length == lengths[-1] else lengths[-1]
                    window = Window(full_length // ACCELERATED_SHARE, driver.iteration)
                    result = run_sweeps(sequence, driver, ACCELERATED.name, window, first=first)
                solution = result.solution or run_newton_steps(sequence, equations, driver, result)
                if solution is not None:
                    return solution
                if is_last_window:
                    break
            return run_sequence(sequence, None)


@dataclass(frozen=True)
class SweepResult:
    """The result of some sweeps.

    Attributes:
        best: the best Λ so far [N s], shape (n_rows,).
        latest: the last Λ [N s], shape (n_rows,).
        residual: residual of the last Λ.
        has_ended: whether the sweeps have an outcome.
        solution: the solution if the solve is over, else None.
    """

    best: FloatArray
    latest: FloatArray
    residual: float
    has_ended: bool
    solution: Solution | None


def run_sweeps(
    sequence: SolverSequence,
    driver: IterationDriver,
    name: str,
    window: Window,
    *,
    first: FloatArray,
    min_sweeps: int = 1,
) -> SweepResult:
    """Sweep while each window gains a digit; check the residual every ``min_sweeps`` sweeps or less often.

    If no residual is finite, ``first`` counts as the best Λ.
    """
    monitor = driver.monitor
    while True:
        latest, residual, outcome = check_convergence(sequence.problem, sequence.residual, driver)
        if outcome is not None or window.is_slow(driver.iteration, monitor.best_residual):
            break
        driver.run_to_next_check(min_sweeps)
    best = first if monitor.best_impulses is None else monitor.best_impulses
    sequence.iterations, sequence.best_impulses, sequence.best_residual = driver.iteration, best, monitor.best_residual
    sequence.history.append(f"{name}: {outcome.status if outcome else 'slow'}")
    solution = None
    if outcome is not None and outcome.status in FINAL_STATUSES:
        solution = sequence.finish(outcome.status, outcome.reason)
    return SweepResult(best, latest, residual, outcome is not None, solution)


def accelerated_sweeps(sequence: SolverSequence) -> Callable[[FloatArray], Iterates] | None:
    """Return the function that begins accelerated sweeps, or None if the problem or the memory forbids them."""
    if not can_accelerate(sequence.problem):
        return None
    try:
        return ACCELERATED.prepare(sequence.problem).begin
    except InsufficientMemoryError as error:
        sequence.history.append(f"{ACCELERATED.name}: {error_text(error)}")
        return None


def run_newton_steps(
    sequence: SolverSequence, equations: Callable[[], Equations], driver: IterationDriver, result: SweepResult
) -> Solution | None:
    """Try Newton's method from the last swept Λ; return the solution if the solve is over."""
    try:
        newton = NewtonRunner(equations(), driver)
    except InsufficientMemoryError as error:
        sequence.history.append(f"Newton steps: {error_text(error)}")
        return None
    sequence.keep_best(*newton.run(NEWTON_SETTINGS, result.latest, result.residual))
    sequence.iterations = newton.driver.iteration
    is_solved = sequence.best_residual <= sequence.stop.tolerance
    sequence.history.append(f"Newton steps: {Status.SOLVED if is_solved else 'not solved'}")
    if is_solved:
        return sequence.finish(Status.SOLVED, "")
    limit = newton.reached_limit
    return sequence.finish(limit) if limit else None
