"""How a solve by interior points goes on: the best iterate, the limits, and what ends it."""

from collections.abc import Callable

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.clock import Clock
from ..iteration.loop import judged
from ..iteration.stopping import MARK

FLOPS_A_SECOND = 3e9
"""What a machine does at least in a factorisation; the first step that is measured replaces the guess."""

SLACK = 1.5
"""What the time of a step is multiplied with to predict the next, because other programs take turns with this one."""

MOST_SHORT = 5
"""So many steps in a row that are too short end a run."""

PATIENCE = 20
"""Steps without a better residual after which rounding is looked at."""

LEAST_STEPS, FRUITLESS = 200, 0.75
"""A run of so many steps ends when this last share of them has brought no gain."""

LARGE = 1e6
"""Scaled impulses beyond this may grow without bound."""

CERTAINTY = 1e-12
"""What ‖Gd‖ and c·d are compared with, relative to what their terms add up to, in a proof of infeasibility."""


class Progress:
    """The best iterate of one solve, and why it ended.

    Steps shorter than ``shortest`` are too short; where that is 0, those that leave Λ the same to the last bit.

    Attributes:
        best: the best Λ so far [N s], shape (n_rows,).
        best_residual: its judged residual.
        ended: status and reason once the solve is over.
    """

    def __init__(
        self,
        problem: ContactProblem,
        residual: Residual,
        stop: Stop,
        observe: Observer | None,
        flops: float,
        first: FloatArray,
        shortest: float = 0.0,
    ) -> None:
        self._problem, self._residual = problem, residual
        self._stop, self._observe, self._clock = stop, observe, Clock(stop.max_seconds)
        self._shortest = shortest
        self._marked, self._gained, self._run_began = np.inf, 0, 0
        self.best, self._latest, self._iteration = first, first, 0
        self.best_residual = self._began_at = judged(problem, residual, first)
        self._step_seconds, self._began, self._short, self._waited = flops / FLOPS_A_SECOND, 0.0, 0, 0
        self.ended: tuple[Status, str] | None = None
        self._look()

    def factorised(self, factorise: Callable[[], bool]) -> bool:
        """Factorise if a step like the last ends in time; say whether there are factors, or the solve is over."""
        if SLACK * self._step_seconds > self._clock.left:
            self.end(Status.TIME_LIMIT, f"{self._reached()}; the next step would not end in time")
            return False
        self._began = self._clock.used
        done = factorise()
        if not done:
            self.end(Status.STALLED, f"the Newton system is singular at residual {self.best_residual:.1e}")
        return done

    def arrive(self, impulses: FloatArray, residual: float, part: float = 1.0) -> None:
        """Count a step, of which ``part`` was done, to Λ of a judged residual."""
        self._iteration += 1
        is_short = part < self._shortest if self._shortest > 0.0 else np.array_equal(impulses, self._latest)
        self._latest = impulses
        self._step_seconds = self._clock.used - self._began
        self._clock.show(self._observe, self._iteration, impulses)
        self._waited += 1
        if residual < self.best_residual:
            self.best, self.best_residual, self._waited = impulses, residual, 0
        self._short = self._short + 1 if is_short else 0
        self._look()
        if self._short >= MOST_SHORT:
            self.end(Status.STALLED, f"steps end at the boundary of a cone, best residual {self.best_residual:.1e}")
        if not np.isfinite(residual):
            self.end(Status.DIVERGED, f"the iterates leave all bounds, best residual {self.best_residual:.1e}")
        if residual < MARK * self._marked:
            self._marked, self._gained = residual, self._iteration
        if self._waited >= PATIENCE and self.best_residual <= self._residual.rounding(self.best):
            self.end(Status.STALLED, f"rounding leaves the residual at {self.best_residual:.1e}")

    def end(self, status: Status, reason: str) -> None:
        """End the solve, if nothing has before."""
        self.ended = self.ended or (status, reason)

    def goes_on(self) -> bool:
        """Whether the solve is not over; after a run that stalled but gained by more than ``MARK``, another begins."""
        if self.ended is None:
            return True
        if self.ended[0] is not Status.STALLED or not self.best_residual < MARK * self._began_at:
            return False
        self.ended, self._began_at, self._short, self._waited = None, self.best_residual, 0, 0
        self._gained = self._run_began = self._iteration
        return True

    def look_for_gain(self) -> None:
        """End where most of a run has brought no gain: steps that move the last bits alone go on to any limit."""
        steps, fruitful = self._iteration - self._run_began, self._gained - self._run_began
        if steps >= LEAST_STEPS and fruitful <= (1.0 - FRUITLESS) * steps:
            self.end(Status.STALLED, f"no gain since step {self._gained}, best residual {self.best_residual:.1e}")

    def look_for_proof(self, r: FloatArray) -> None:
        """Where scaled impulses grow as if nothing could hold the contacts apart, end if that can be proven."""
        if self.ended is None and np.abs(r).max(initial=0.0) > LARGE and proven_infeasible(self._problem, self._latest):
            self.end(Status.INFEASIBLE, "impulses that move nothing would have to hold contacts or joints")

    def solution(self) -> Solution:
        """Return the best Λ with the status the solve ended in."""
        assert self.ended is not None
        status, reason = self.ended
        return Solution(self.best, status, self._iteration, reason)

    def _look(self) -> None:
        if self.best_residual <= self._stop.tolerance:
            self.end(Status.SOLVED, "")
        limit = self._clock.limit_met(self._stop, self._iteration)
        if limit is not None:
            self.end(limit, self._reached())

    def _reached(self) -> str:
        return f"residual {self.best_residual:.1e} after {self._iteration} Newton steps"


def proven_infeasible(problem: ContactProblem, impulses: FloatArray) -> bool:
    """Whether impulses d of normals, d ≥ 0, and of joints with Gd = 0 and c·d < 0 exist along Λ: then none is right.

    For ξ·d = (Gd)·Λ + c·d = c·d < 0 contradicts ξ_N ≥ 0 and ξ = 0 of joints, whatever friction does (Farkas).
    """
    laws = problem.laws
    rows, joints = laws.first_row[laws.is_unilateral], laws.first_row[laws.is_bilateral]
    direction = np.zeros(problem.n_rows)
    direction[rows], direction[joints] = np.maximum(impulses[rows], 0.0), impulses[joints]
    largest = float(np.abs(direction).max(initial=0.0))
    if not 0.0 < largest < np.inf:
        return False
    direction /= largest
    direction[np.abs(direction) < CERTAINTY] = 0.0
    factors = problem.factors
    moved = problem.delassus() @ direction if factors is None else factors.delassus_times(direction)
    weights = np.sqrt(np.maximum(problem.delassus_diagonal, 0.0))
    held = float((weights * np.abs(direction)).sum())
    gain = float(problem.free_velocity @ direction)
    is_free = bool((np.abs(moved) <= CERTAINTY * weights * held).all())
    return is_free and gain < -CERTAINTY * float(np.abs(problem.free_velocity) @ np.abs(direction)) and gain < 0.0
