"""Restarts of HybridNewton: Newton's method from the iterates of other predictors.

From the best iterate so far and from the first, block Gauss–Seidel sweeps are done, and the sweeps of the solve:
Newton's method is tried from their 0th, 1st, 2nd, 4th, 8th, … iterate, with three dampings, with and without a search
along its steps (``newton.steps``). The best iterate comes first, since it is the nearest to a solution that is known;
the first one is tried too, because the best may lie where sweeps and Newton's method both lead back. The predictors
take turns from iterate to iterate: most successes come early. Such restarts are what there is of globalisation where
the equations have neither a potential nor a monotone map: no merit function is free of local minima then (Acary,
Brémond & Huber 2018).

They have a budget of counted work (``newton.work``), the larger of

    SHARE × the work of the solve so far      and      LEAST, at most LEAST_OF_LIMIT × the time limit,

and come again only after the work has doubled. A budget counted so gives the same iterates on every machine. The clock
is the hard limit.
"""

from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from ..iteration.loop import Iterates
from ..iteration.stopping import LONGEST_INTERVAL
from ..newton.steps import THOROUGH
from ..sweeps.blocks import BlockIterates, BlockSweep
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from .attempts import Attempts

SHARE = 1.0
"""What restarts may work, relative to all work before."""

LEAST = 5.0
"""Nominal seconds that they may work even after little work: a thousand Newton steps and more on a few contacts."""

LEAST_OF_LIMIT = 0.5
"""But not more than this share of the time limit."""

SWEEPS = 128
"""Sweeps of one predictor from one start."""


@dataclass
class Predictor:
    """One way to other iterates: ``done`` sweeps, ``attempted`` when Newton's method was tried last, −1 if never."""

    iterates: Iterates
    done: int = 0
    attempted: int = -1


class Restarts:
    """The restarts of one solve, which began at Λ = ``first`` [N s], shape (n_rows,)."""

    def __init__(self, attempts: Attempts, sweep: DelassusSweep, first: FloatArray) -> None:
        self._attempts, self._sweep, self._first = attempts, sweep, first
        self._due = 0.0

    @property
    def are_due(self) -> bool:
        """Whether the work has doubled since the last restarts."""
        return self._attempts.work.seconds >= self._due

    @property
    def best(self) -> FloatArray:
        """The best Λ of the solve [N s], shape (n_rows,), of all predictors."""
        best = self._attempts.advance.monitor.best_impulses
        return self._first if best is None else best

    def tried(self) -> tuple[Status, str] | None:
        """Try all starts and predictors; return status and reason if the solve is over, None if it is not.

        Every iterate counts and is shown, those of the predictors included; the monitor keeps the best.
        """
        work, stop = self._attempts.work, self._attempts.advance.monitor.stop
        until = work.seconds + max(SHARE * work.seconds, min(LEAST, LEAST_OF_LIMIT * stop.max_seconds))
        predictors, ended = self._predictors(), None
        while predictors and ended is None and work.seconds < until:
            predictor = predictors.pop(0)
            ended = self._followed(predictor, until)
            if predictor.attempted < predictor.done <= SWEEPS:
                predictors.append(predictor)
        self._due = 2.0 * work.seconds
        return ended

    def _predictors(self) -> list[Predictor]:
        """Return the predictors from all starts, the best one before the first."""
        starts = [self.best, self._first]
        if np.array_equal(starts[0], starts[1]):
            starts.pop()
        blocks = BlockSweep.over(self._attempts.problem, 1.0)
        block_wise = [Predictor(SafeguardedIterates(BlockIterates(blocks, start))) for start in starts]
        plain = [Predictor(SafeguardedIterates(DelassusIterates(self._sweep, start)), attempted=0) for start in starts]
        return [*block_wise, *plain]

    def _followed(self, predictor: Predictor, work_until: float) -> tuple[Status, str] | None:
        """Try Newton's method from the next iterate of a predictor, and sweep on to the one after; as ``tried``.

        A predictor that diverges sweeps no further.
        """
        advance, monitor = self._attempts.advance, self._attempts.advance.monitor
        advance.iterates = predictor.iterates
        if predictor.attempted == predictor.done:
            predictor.done += self._swept(1)
        impulses = predictor.iterates.impulses()
        residual = self._attempts.judged(impulses)
        predictor.attempted = predictor.done
        if not np.isfinite(residual):
            return None
        self._keep(impulses, residual)
        for attempt in THOROUGH:
            if monitor.best_residual <= monitor.stop.tolerance:
                return Status.SOLVED, ""
            self._keep(*self._attempts.tried(attempt, impulses, residual, work_until))
        if monitor.best_residual <= monitor.stop.tolerance:
            return Status.SOLVED, ""
        if not self._attempts.is_over:
            predictor.done += self._swept(max(predictor.done, 1))
        limit = self._attempts.limit_met
        return (limit, f"residual {monitor.best_residual:.1e} after {advance.iteration} iterations") if limit else None

    def _keep(self, impulses: FloatArray, residual: float) -> None:
        """Let the monitor have Λ if it is the best."""
        monitor = self._attempts.advance.monitor
        if residual < monitor.best_residual:
            monitor.best_residual, monitor.best_impulses = residual, impulses

    def _swept(self, most: int) -> int:
        """Do so many sweeps within the limits, and return how many it were."""
        advance, done = self._attempts.advance, 0
        while done < most and not self._attempts.is_over:
            left = advance.monitor.stop.max_iterations - advance.iteration
            count = min(most - done, left, LONGEST_INTERVAL)
            advance.by(count)
            self._attempts.work.count_sweeps(count)
            done += count
        return done
