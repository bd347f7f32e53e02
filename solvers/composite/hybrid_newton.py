"""HybridNewton: sweeps, and Newton's method on the projection equations if the sweeps are slow.

Sweeps quickly identify which contacts are open, stick or slip, but determine the impulses slowly if masses differ or
many contacts are coupled. Newton's method has the opposite properties. The solver therefore begins with sweeps, and
tries Newton's method when they are slow. The result of Newton's method is kept only if it reduces the judge's residual.

Newton's method converges only near a solution, which sweeps at high friction may never reach. If sweeps stall, Newton's
method restarts from iterates of two kinds of sweeps, which begin at the best iterate and at the first one
(``restarts``).

No decision depends on the tolerance. A solve to a smaller tolerance therefore begins with the same iterates, and its
residual is not larger. No decision depends on the speed of the machine, except near the deadline: a Newton step that
would miss it is skipped (``linear_solver``).
"""

from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.loop import IterationDriver, check_convergence, infeasible_solution, initial_impulses
from ..iteration.method import Method
from ..iteration.stopping import Monitor, Outcome
from ..newton.linearised import Equations
from ..newton.steps import DAMPED, SHARP, THOROUGH, NewtonRunner
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes
from .restarts import Restarts

SWEEPS_BEFORE = 200
"""Number of sweeps before Newton's method is considered, and between two measurements of the convergence rate."""

SLOW = 500
"""Number of sweeps per digit of the residual above which Newton's method is tried. A few Newton steps cost as much as a
few thousand sweeps, for ten contacts and for a thousand."""

SETTINGS = (SHARP, DAMPED, *THOROUGH)
"""Settings of successive runs of Newton's method between sweeps."""

SUCCESS = 0.1
"""An attempt succeeds if it reduces the residual to this fraction or less. After any other attempt, the settings change
and the number of sweeps before the next attempt doubles."""

STUCK_STATUSES = (Status.STALLED, Status.DIVERGED, Status.OSCILLATING)
"""Outcomes of sweeps after which restarts may help."""


@dataclass(frozen=True)
class HybridNewton(Method):
    """Safeguarded sweeps, with Newton's method on the projection equations Λ_i = prox(Λ_i − ξ_i/α_i) in between.

    One iteration is a sweep or a Newton step.

    Attributes:
        relaxation: ω of the sweeps; see ``SafeguardedSORprox``.

    Raises:
        SolverError: if an option is out of range.
    """

    relaxation: float = 1.5

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    def prepare(self, problem: ContactProblem) -> "PreparedHybrid":
        """Assemble G and compute the initial step sizes of the sweeps."""
        self.check_supports(problem)
        residual = Residual(problem)
        sweep = DelassusSweep.over(problem, diagonal_step_sizes(problem, self.relaxation))
        return PreparedHybrid(problem, residual, sweep, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedHybrid:
    """Sweeps and Newton's equations of one problem."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    sweep: DelassusSweep = field(repr=False)
    equations: Equations = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep, and try Newton's method if the sweeps converge slowly; see ``Prepared.solve``."""
        first = initial_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        monitor, iterates = Monitor(stop), self._begin(first)
        driver = IterationDriver(iterates, self._begin, monitor, observe)
        newton = NewtonRunner(self.equations, driver)
        restarts = Restarts(newton, self.sweep, first)
        rate, wait, n_failures = ConvergenceRate(), SWEEPS_BEFORE, 0
        while True:
            impulses, residual, outcome = check_convergence(self.problem, self.residual, driver)
            if self._is_stuck(outcome, monitor) and restarts.are_due:
                previous_residual = monitor.best_residual
                final = restarts.run()
                driver.iterates = iterates
                if final is None and monitor.best_residual <= SUCCESS * previous_residual:
                    iterates.move_to(restarts.best)
                    rate = ConvergenceRate()
                    continue
                outcome = final or outcome
            if outcome is not None:
                return monitor.solution(outcome, driver.iteration, self.problem.n_rows)
            if rate.sweeps >= wait and rate.sweeps_per_digit(residual) > SLOW:
                settings = SETTINGS[n_failures % len(SETTINGS)]
                newton_impulses, newton_residual = newton.run(settings, impulses, residual)
                if newton_residual < residual:
                    iterates.move_to(newton_impulses)
                if newton_residual > SUCCESS * residual:
                    n_failures, wait = n_failures + 1, 2 * wait
                    rate = ConvergenceRate()
                continue
            count = driver.run_to_next_check()
            newton.work.count_sweeps(count)
            rate.record(count, residual)

    def _begin(self, impulses: FloatArray) -> SafeguardedIterates:
        return SafeguardedIterates(DelassusIterates(self.sweep, impulses))

    def _is_stuck(self, outcome: Outcome | None, monitor: Monitor) -> bool:
        """Whether sweeps make no progress, and rounding does not explain the best residual."""
        is_stuck = monitor.lacks_progress if outcome is None else outcome.status in STUCK_STATUSES
        if not is_stuck:
            return False
        best = monitor.best_impulses
        return best is None or monitor.best_residual > self.residual.rounding(best)


class ConvergenceRate:
    """The convergence rate of sweeps.

    Attributes:
        sweeps: number of recorded sweeps.
    """

    def __init__(self) -> None:
        self.sweeps = 0
        self._records: list[tuple[int, float]] = []

    def record(self, count: int, residual: float) -> None:
        """Record ``count`` sweeps that began with ``residual``."""
        self._records.append((self.sweeps, residual))
        self.sweeps += count

    def sweeps_per_digit(self, residual: float) -> float:
        """Return the number of sweeps per digit of the residual, over the last ``SWEEPS_BEFORE`` sweeps or more.

        Return infinity if the residual has not decreased, or if fewer sweeps are recorded.
        """
        earlier = [record for record in self._records if record[0] <= self.sweeps - SWEEPS_BEFORE]
        if not earlier or not residual < earlier[-1][1]:
            return np.inf
        first_sweep, first_residual = earlier[-1]
        n_sweeps = self.sweeps - first_sweep
        return float(n_sweeps / np.log10(first_residual / residual)) if residual > 0.0 else 0.0
