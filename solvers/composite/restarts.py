"""Restarts of HybridNewton: Newton's method from the iterates of other predictors.

The predictors are block Gauss–Seidel sweeps and the sweeps of the solve, each from the best iterate so far and from the
first. Newton's method starts from their 0th, 1st, 2nd, 4th, 8th, … iterate, with three dampings, with and without a
line search (``newton.steps``). The best iterate comes first because no known iterate is closer to a solution. The first
iterate is tried too, because sweeps and Newton's method may both lead back to the best one. The predictors alternate
from iterate to iterate, because most successes come early. Such restarts replace a globalisation, because in general
the equations have neither a potential nor a monotone map. Every merit function may then have local minima (Acary,
Brémond & Huber 2018).

The restarts have a budget of counted work (``newton.work``), the larger of

    WORK_SHARE × the work of the solve so far      and      MIN_WORK, at most LIMIT_SHARE × the time limit,

and restarts are repeated only after the total work has doubled. A budget of counted work gives the same iterates on
every machine. The clock is the hard limit.
"""

from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from ..iteration.loop import Iterates
from ..iteration.stopping import MAX_CHECK_INTERVAL, Outcome
from ..newton.steps import THOROUGH, NewtonRunner
from ..sweeps.blocks import BlockIterates, BlockSweep
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates

WORK_SHARE = 1.0
"""Work of restarts, relative to the work of the solve before them."""

MIN_WORK = 5.0
"""Nominal seconds that restarts may use even after little work: over a thousand Newton steps on a few contacts."""

LIMIT_SHARE = 0.5
"""Upper limit of ``MIN_WORK``, relative to the time limit."""

MAX_SWEEPS = 128
"""Largest number of sweeps of a predictor after which Newton's method is tried."""


@dataclass
class Predictor:
    """A sequence of iterates.

    Attributes:
        iterates: the current iterate and its sweeps.
        done: number of sweeps so far.
        attempted: number of sweeps before the last attempt of Newton's method; −1 before the first attempt.
    """

    iterates: Iterates
    done: int = 0
    attempted: int = -1


class Restarts:
    """The restarts of one solve, which began at Λ = ``first`` [N s], shape (n_rows,)."""

    def __init__(self, newton: NewtonRunner, sweep: DelassusSweep, first: FloatArray) -> None:
        self._newton, self._driver, self._sweep, self._first = newton, newton.driver, sweep, first
        self._due_work = 0.0

    @property
    def are_due(self) -> bool:
        """Whether the work has doubled since the last restarts."""
        return self._newton.work.seconds >= self._due_work

    @property
    def best(self) -> FloatArray:
        """The best Λ of the solve [N s], shape (n_rows,), including all predictors."""
        best = self._driver.monitor.best_impulses
        return self._first if best is None else best

    def run(self) -> Outcome | None:
        """Try all starts and predictors; return the outcome if the solve is over, else None.

        All iterates, including those of predictors, are counted and passed to the observer; the monitor keeps the best.
        """
        work, stop = self._newton.work, self._driver.monitor.stop
        work_until = work.seconds + max(WORK_SHARE * work.seconds, min(MIN_WORK, LIMIT_SHARE * stop.max_seconds))
        predictors, outcome = self._predictors(), None
        while predictors and outcome is None and work.seconds < work_until:
            predictor = predictors.pop(0)
            outcome = self._advance(predictor, work_until)
            if predictor.attempted < predictor.done <= MAX_SWEEPS:
                predictors.append(predictor)
        self._due_work = 2.0 * work.seconds
        return outcome

    def _predictors(self) -> list[Predictor]:
        """Return the predictors from all starts, the best start first."""
        starts = [self.best, self._first]
        if np.array_equal(starts[0], starts[1]):
            starts.pop()
        blocks = BlockSweep.over(self._newton.equations.problem, 1.0)
        over_blocks = [Predictor(SafeguardedIterates(BlockIterates(blocks, start))) for start in starts]
        # the predictors over blocks already try Newton's method from the starts themselves
        over_rows = [
            Predictor(SafeguardedIterates(DelassusIterates(self._sweep, start)), attempted=0) for start in starts
        ]
        return [*over_blocks, *over_rows]

    def _advance(self, predictor: Predictor, work_until: float) -> Outcome | None:
        """Try Newton's method from the next iterate of a predictor, then sweep to the following one; see ``run``.

        A predictor that diverges is not continued.
        """
        driver, monitor = self._driver, self._driver.monitor
        driver.iterates = predictor.iterates
        if predictor.attempted == predictor.done:
            predictor.done += self._run_sweeps(1)
        impulses = predictor.iterates.impulses()
        residual = self._newton.residual(impulses)
        predictor.attempted = predictor.done
        if not np.isfinite(residual):
            return None
        self._keep_best(impulses, residual)
        for settings in THOROUGH:
            if monitor.best_residual <= monitor.stop.tolerance:
                break
            self._keep_best(*self._newton.run(settings, impulses, residual, work_until))
        if monitor.best_residual <= monitor.stop.tolerance:
            return Outcome(Status.SOLVED, "")
        if not self._newton.is_over:
            predictor.done += self._run_sweeps(max(predictor.done, 1))
        limit = self._newton.reached_limit
        reason = f"residual {monitor.best_residual:.1e} after {driver.iteration} iterations"
        return Outcome(limit, reason) if limit else None

    def _keep_best(self, impulses: FloatArray, residual: float) -> None:
        """Pass Λ to the monitor if it is the best so far."""
        monitor = self._driver.monitor
        if residual < monitor.best_residual:
            monitor.replace_best(residual, impulses)

    def _run_sweeps(self, max_sweeps: int) -> int:
        """Do up to ``max_sweeps`` sweeps within the limits; return their number."""
        driver, done = self._driver, 0
        while done < max_sweeps and not self._newton.is_over:
            remaining = driver.monitor.stop.max_iterations - driver.iteration
            count = min(max_sweeps - done, remaining, MAX_CHECK_INTERVAL)
            driver.run(count)
            self._newton.work.count_sweeps(count)
            done += count
        return done
