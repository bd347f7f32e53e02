"""SemismoothNewton: Newton's method on the projection equations, from the start on and alone.

The steps are those of ``steps``, shortened by a search, in three phases: damped by 10⁻¹², 10⁻⁶ and 10⁻³. Each phase
begins at the best iterate of those before, and gives way when its steps no longer bring a better one; the last goes on
to the limits, unless its iterates repeat or diverge. Newton's method converges from nearby: far from a solution it may
circle through states for ever, which is why it serves best as a part of a ``Fallback``.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.clock import Clock
from ..iteration.loop import first_impulses, refuted
from ..iteration.method import Method
from ..iteration.stopping import ROUNDING
from .linearised import Equations
from .steps import DIVERGENCE, THOROUGH, Attempt, Newton
from .work import Work

PHASES = tuple(attempt for attempt in THOROUGH if attempt.shortest < 1.0)
"""One after the other, with more and more damping."""


@dataclass(frozen=True)
class SemismoothNewton(Method):
    """Newton's method on the equations Λ_i = prox(Λ_i − ξ_i/α_i), damped and with a search along its steps.

    One iteration is one Newton step.
    """

    def prepare(self, problem: ContactProblem) -> "PreparedNewton":
        """Assemble G."""
        residual = Residual(problem)
        return PreparedNewton(problem, residual, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedNewton:
    """Newton's equations of one problem."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    equations: Equations = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Follow Newton's method to the judge's residual; see ``Prepared.solve``."""
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return refuted(self.problem)
        newton = _Solve(self, stop, observe, first)
        for phase in (*PHASES[:-1], replace(PHASES[-1], patience=stop.max_iterations)):
            if newton.ended() is not None:
                break
            newton.follow(phase)
        return newton.solution(newton.ended() or newton.stuck())


class _Solve:
    """The phases of one solve."""

    def __init__(self, prepared: PreparedNewton, stop: Stop, observe: Observer | None, first: FloatArray) -> None:
        self._prepared, self._stop, self._observe = prepared, stop, observe
        self._clock = Clock(stop.max_seconds)
        problem, residual, equations = prepared.problem, prepared.residual, prepared.equations
        self._newton = Newton(problem, residual, equations, self._clock, stop.tolerance, Work(equations.entries))
        self._best, self._lowest = first, self._newton.judged(first)
        self._iteration, self._repeats = 0, Repeats(first)

    def follow(self, phase: Attempt) -> None:
        """Do Newton steps from the best Λ so far, as long as the phase has patience."""
        self._repeats = Repeats(self._best)
        steps = replace(phase, most_steps=self._stop.max_iterations)
        self._best, self._lowest = self._newton.followed(steps, self._best, self._lowest, self._goes_on)

    def ended(self) -> tuple[Status, str] | None:
        """Return status and reason if the solve is over, None if another phase may follow."""
        reached = f"residual {self._lowest:.1e} after {self._iteration} Newton steps"
        if self._lowest <= self._stop.tolerance:
            return Status.SOLVED, ""
        limit = self._clock.limit_met(self._stop, self._iteration)
        if limit:
            return limit, reached
        if self._newton.solver.lacks_time:
            return Status.TIME_LIMIT, f"{reached}; the next one would not end in time"
        if self._lowest <= self._prepared.residual.rounding(self._best):
            return Status.STALLED, f"rounding leaves the residual at {self._lowest:.1e}"
        return None

    def stuck(self) -> tuple[Status, str]:
        """Return status and reason after the last phase has ended before the limits."""
        if self._repeats.status is Status.STALLED:
            return Status.STALLED, f"the impulses no longer change at residual {self._lowest:.1e}"
        if self._repeats.status is Status.OSCILLATING:
            return Status.OSCILLATING, f"the steps repeat themselves, best residual {self._lowest:.1e}"
        if not self._newton.judged(self._repeats.latest) <= DIVERGENCE * self._lowest:
            return Status.DIVERGED, f"the residual grows, best residual {self._lowest:.1e}"
        return Status.STALLED, f"the equations have no further step at residual {self._lowest:.1e}"

    def solution(self, ended: tuple[Status, str]) -> Solution:
        """Return the best Λ with the status the solve ended in."""
        return Solution(self._best, ended[0], self._iteration, ended[1])

    def _goes_on(self, reached: FloatArray) -> bool:
        self._iteration += 1
        self._clock.show(self._observe, self._iteration, reached)
        self._repeats.note(reached)
        return self._repeats.status is None and self._clock.limit_met(self._stop, self._iteration) is None


class Repeats:
    """Whether iterates repeat, in a cycle of any length (Brent 1980).

    Attributes:
        latest: the newest iterate.
        status: STALLED where it does not change, OSCILLATING where it repeats an earlier one, else None.
    """

    def __init__(self, first: FloatArray) -> None:
        self.latest = first
        self.status: Status | None = None
        self._kept, self._age, self._lifetime = first, 0, 1

    def note(self, newest: FloatArray) -> None:
        """Compare the next iterate with the last one and with the one that is kept."""
        if _equal(newest, self.latest):
            self.status = Status.STALLED
        elif _equal(newest, self._kept):
            self.status = Status.OSCILLATING
        self.latest, self._age = newest, self._age + 1
        if self._age == self._lifetime:
            self._kept, self._age, self._lifetime = newest, 0, 2 * self._lifetime


def _equal(one: FloatArray, other: FloatArray) -> bool:
    """Whether two impulses are equal to rounding."""
    return bool((np.abs(one - other) <= ROUNDING * np.maximum(np.abs(one), np.abs(other))).all())
