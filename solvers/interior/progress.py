"""Progress of a solve by an interior point method: the best iterate, the limits, and the reasons to end."""

from collections.abc import Callable
from operator import itemgetter

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.stopping import RECORD_RATIO, Clock, Outcome

FLOPS_PER_SECOND = 3e9
"""Lower estimate of the speed of a factorisation, used until a step has been measured."""

SLACK = 1.5
"""Safety factor of the predicted time of a step, because other programs may share the processor."""

MAX_SHORT_STEPS = 5
"""Number of successive negligible steps that end a run."""

PATIENCE = 20
"""Number of steps without a better residual after which the rounding limit is tested."""

MIN_STEPS, FRUITLESS_SHARE = 200, 0.75
"""A run of at least this many steps ends if at least this share of them, the last ones, made no
progress."""

MIN_WARM_STEPS = 20
"""``MIN_STEPS`` for a run from a given start, which may be stuck at the boundary of a cone. A run from zero takes about
this many steps in total."""

LARGE = 1e6
"""Scaled impulses above this value may grow without bound; a proof of infeasibility is then attempted."""

PROOF_TOLERANCE = 1e-12
"""Tolerance for ‖Gd‖ and c·d in a proof of infeasibility, relative to the sum of the sizes of their terms."""


class Progress:
    """The best iterate of one solve, and its outcome.

    Steps shorter than ``shortest`` are negligible. If ``shortest`` is 0, a step is negligible only if it leaves Λ
    bitwise unchanged. ``flops``, the operations of a factorisation, give the predicted time of the first step.

    Attributes:
        best: the best Λ so far [N s], shape (n_rows,).
        best_residual: its residual in the judge's arithmetic.
        outcome: the outcome once the solve is over.
    """

    def __init__(
        self,
        problem: ContactProblem,
        residual: Residual,
        stop: Stop,
        observe: Observer | None,
        *,
        flops: float,
        first: FloatArray,
        shortest: float = 0.0,
        is_warm: bool = False,
    ) -> None:
        self._problem, self._residual = problem, residual
        self._stop, self._observe, self._clock = stop, observe, Clock(stop.max_seconds)
        self._shortest = shortest
        self._record_residual, self._last_gain, self._run_begin = np.inf, 0, 0
        self.best, self._latest, self._iteration = first, first, 0
        self.best_residual = self._run_residual = residual.judged(problem, first)
        self._is_warm, self._warm_result = is_warm, (first, self.best_residual)
        self._step_seconds, self._step_start = flops / FLOPS_PER_SECOND, 0.0
        self._n_short_steps, self._n_stale_steps = 0, 0
        self.outcome: Outcome | None = None
        self._check_limits()

    def factorise(self, factorise: Callable[[], bool]) -> bool:
        """Factorise if another step is expected to meet the deadline; return False if it is not, or if it fails."""
        if SLACK * self._step_seconds > self._clock.remaining:
            self.end(Status.TIME_LIMIT, f"{self._summary()}; the next step would miss the deadline")
            return False
        self._step_start = self._clock.elapsed
        is_factorised = factorise()
        if not is_factorised:
            self.end(Status.STALLED, f"the Newton system is singular at residual {self.best_residual:.1e}")
        return is_factorised

    def record(self, impulses: FloatArray, residual: float, fraction: float = 1.0) -> None:
        """Count a step of length ``fraction`` that led to Λ with this residual in the judge's arithmetic."""
        self._iteration += 1
        is_short_step = fraction < self._shortest if self._shortest > 0.0 else np.array_equal(impulses, self._latest)
        self._latest = impulses
        self._step_seconds = self._clock.elapsed - self._step_start
        self._clock.show(self._observe, self._iteration, impulses)
        self._n_stale_steps += 1
        if residual < self.best_residual:
            self.best, self.best_residual, self._n_stale_steps = impulses, residual, 0
        self._n_short_steps = self._n_short_steps + 1 if is_short_step else 0
        self._check_limits()
        if self._n_short_steps >= MAX_SHORT_STEPS:
            self.end(Status.STALLED, f"all steps end at the boundary of a cone, best residual {self.best_residual:.1e}")
        if not np.isfinite(residual):
            self.end(Status.DIVERGED, f"the iterates are not finite, best residual {self.best_residual:.1e}")
        if residual < RECORD_RATIO * self._record_residual:
            self._record_residual, self._last_gain = residual, self._iteration
        if self._n_stale_steps >= PATIENCE and self.best_residual <= self._residual.rounding(self.best):
            self.end(Status.STALLED, f"rounding limits the residual to {self.best_residual:.1e}")

    def end(self, status: Status, reason: str) -> None:
        """End the solve, unless it has ended already."""
        self.outcome = self.outcome or Outcome(status, reason)

    def may_run(self) -> bool:
        """Whether a run may begin: the first one, or another one after a run that stalled.

        A run from a given start is followed by a run from zero. Any other run is followed by a run from the best Λ, but
        only if it reduced the residual.
        """
        if self.outcome is None:
            return True
        if self.outcome[0] is not Status.STALLED:
            return False
        if self._is_warm:
            self._is_warm, self._warm_result = False, (self.best, self.best_residual)
            self.best, self._record_residual = np.zeros_like(self.best), np.inf
            self.best_residual = self._residual.judged(self._problem, self.best)
        elif not self.best_residual < RECORD_RATIO * self._run_residual:
            return False
        self.outcome, self._run_residual, self._n_short_steps, self._n_stale_steps = None, self.best_residual, 0, 0
        self._last_gain = self._run_begin = self._iteration
        return True

    def check_gain(self) -> None:
        """End a run whose last steps made no progress, since steps that change only the last bits might never end."""
        steps, fruitful = self._iteration - self._run_begin, self._last_gain - self._run_begin
        if steps >= (MIN_WARM_STEPS if self._is_warm else MIN_STEPS) and fruitful <= (1.0 - FRUITLESS_SHARE) * steps:
            self.end(
                Status.STALLED, f"no improvement since step {self._last_gain}, best residual {self.best_residual:.1e}"
            )

    def check_feasibility(self, r: FloatArray) -> None:
        """End the solve if scaled impulses are very large and prove that the problem is infeasible."""
        if (
            self.outcome is None
            and np.abs(r).max(initial=0.0) > LARGE
            and proves_infeasibility(self._problem, self._latest)
        ):
            self.end(Status.INFEASIBLE, "only impulses that move no body could hold the contacts or joints")

    def solution(self) -> Solution:
        """Return the best Λ with the outcome of the solve."""
        assert self.outcome is not None
        status, reason = self.outcome
        best, _ = min((self.best, self.best_residual), self._warm_result, key=itemgetter(1))
        return Solution(best, status, self._iteration, reason)

    def _check_limits(self) -> None:
        if self.best_residual <= self._stop.tolerance:
            self.end(Status.SOLVED, "")
        limit = self._clock.reached_limit(self._stop, self._iteration)
        if limit is not None:
            self.end(limit, self._summary())

    def _summary(self) -> str:
        return f"residual {self.best_residual:.1e} after {self._iteration} Newton steps"


def proves_infeasibility(problem: ContactProblem, impulses: FloatArray) -> bool:
    """Whether the normal impulses d ≥ 0 and the joint impulses d of Λ prove infeasibility by Gd = 0 and c·d < 0.

    For any Λ, ξ·d = (Gd)·Λ + c·d = c·d < 0. This contradicts ξ_N ≥ 0 and ξ = 0 of joints (Farkas' lemma).
    """
    laws = problem.laws
    rows, joints = laws.first_row[laws.is_unilateral], laws.first_row[laws.is_bilateral]
    direction = np.zeros(problem.n_rows)
    direction[rows], direction[joints] = np.maximum(impulses[rows], 0.0), impulses[joints]
    largest = float(np.abs(direction).max(initial=0.0))
    if not 0.0 < largest < np.inf:
        return False
    direction /= largest
    direction[np.abs(direction) < PROOF_TOLERANCE] = 0.0
    factors = problem.factors
    velocity_change = problem.delassus() @ direction if factors is None else factors.delassus_times(direction)
    weights = np.sqrt(np.maximum(problem.delassus_diagonal, 0.0))
    weight_sum = float((weights * np.abs(direction)).sum())
    gain = float(problem.free_velocity @ direction)
    is_free = bool((np.abs(velocity_change) <= PROOF_TOLERANCE * weights * weight_sum).all())
    return is_free and gain < -PROOF_TOLERANCE * float(np.abs(problem.free_velocity) @ np.abs(direction)) and gain < 0.0
