"""The solver SemismoothNewton: Newton's method on the projection equations, not combined with another method.

The steps are those of the module ``steps`` with a line search, in three phases with the dampings 10⁻¹², 10⁻⁶ and 10⁻³.
Each phase begins at the best iterate so far, and ends when its steps no longer improve it. The last phase continues to
the limits of the solve, unless its iterates repeat or diverge. Newton's method converges only near a solution. Far from
a solution it may cycle through contact states indefinitely, so it is most useful as a part of a ``Fallback``.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop
from ..iteration.loop import infeasible_solution, initial_impulses
from ..iteration.method import Method
from ..iteration.stopping import ROUNDING, Clock, Outcome
from .linearised import Equations
from .steps import DIVERGENCE, THOROUGH, NewtonMethod, NewtonSettings

PHASES = tuple(settings for settings in THOROUGH if settings.min_step < 1.0)
"""Settings of the phases, with increasing damping."""


@dataclass(frozen=True)
class SemismoothNewton(Method):
    """Newton's method on the equations Λ_i = prox(Λ_i − ξ_i/α_i), damped and with a line search.

    One iteration is one Newton step.
    """

    def prepare(self, problem: ContactProblem) -> "PreparedNewton":
        """Assemble G."""
        self.check_supports(problem)
        residual = Residual(problem)
        return PreparedNewton(problem, residual, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedNewton:
    """The method prepared for one problem.

    Attributes:
        problem: the problem.
        residual: the judge's residual of the problem.
        equations: the projection equations, with G assembled.
    """

    problem: ContactProblem
    residual: Residual = field(repr=False)
    equations: Equations = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Take Newton steps until the residual reaches the tolerance or a limit; see ``Prepared.solve``."""
        check_stop(stop)
        first = initial_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        newton = _NewtonSolve(self, stop, observe, first)
        for phase in (*PHASES[:-1], replace(PHASES[-1], patience=stop.max_iterations)):
            if newton.outcome() is not None:
                break
            newton.run(phase)
        return newton.solution(newton.outcome() or newton.final_outcome())


class _NewtonSolve:
    """One solve, with the best iterate of its phases."""

    def __init__(self, prepared: PreparedNewton, stop: Stop, observe: Observer | None, first: FloatArray) -> None:
        self._prepared, self._stop, self._observe = prepared, stop, observe
        self._clock = Clock(stop.max_seconds)
        self._newton = NewtonMethod(prepared.equations, self._clock, stop.tolerance)
        self._best, self._best_residual = first, self._newton.residual(first)
        self._iteration, self._cycle = 0, CycleDetector(first)

    def run(self, phase: NewtonSettings) -> None:
        """Take the Newton steps of a phase, beginning at the best Λ so far."""
        self._cycle = CycleDetector(self._best)
        settings = replace(phase, max_steps=self._stop.max_iterations)
        self._best, self._best_residual = self._newton.run(
            settings, self._best, self._best_residual, self._record_iterate
        )

    def outcome(self) -> Outcome | None:
        """Return the outcome if the solve is over, otherwise None."""
        progress = f"residual {self._best_residual:.1e} after {self._iteration} Newton steps"
        if self._best_residual <= self._stop.tolerance:
            return Outcome(Status.SOLVED, "")
        limit = self._clock.reached_limit(self._stop, self._iteration)
        if limit:
            return Outcome(limit, progress)
        if self._newton.solver.lacks_time:
            return Outcome(Status.TIME_LIMIT, f"{progress}; the next step would miss the deadline")
        if self._best_residual <= self._prepared.residual.rounding(self._best):
            return Outcome(Status.STALLED, f"rounding limits the residual to {self._best_residual:.1e}")
        return None

    def final_outcome(self) -> Outcome:
        """Return the outcome if the last phase ended before a limit was reached."""
        if self._cycle.status is Status.STALLED:
            return Outcome(Status.STALLED, f"the impulses no longer change at residual {self._best_residual:.1e}")
        if self._cycle.status is Status.OSCILLATING:
            return Outcome(
                Status.OSCILLATING, f"the iterates repeat in a cycle, best residual {self._best_residual:.1e}"
            )
        if not self._newton.residual(self._cycle.latest) <= DIVERGENCE * self._best_residual:
            return Outcome(Status.DIVERGED, f"the residual grows, best residual {self._best_residual:.1e}")
        return Outcome(Status.STALLED, f"the Newton system is singular at residual {self._best_residual:.1e}")

    def solution(self, outcome: Outcome) -> Solution:
        """Return the best Λ with the outcome of the solve."""
        return Solution(self._best, outcome.status, self._iteration, outcome.reason)

    def _record_iterate(self, iterate: FloatArray) -> bool:
        """Record an iterate, and return whether another step may follow."""
        self._iteration += 1
        self._clock.show(self._observe, self._iteration, iterate)
        self._cycle.record(iterate)
        return self._cycle.status is None and self._clock.reached_limit(self._stop, self._iteration) is None


class CycleDetector:
    """Detector of iterates that repeat in a cycle of any length (Brent 1980).

    Iterates are compared with a reference iterate, which is replaced after 1, 2, 4, … iterations. A cycle is detected
    when the interval between two references is at least as long as the cycle.

    Attributes:
        latest: the latest iterate, shape (n_rows,).
        status: STALLED if an iterate equals the previous one, OSCILLATING if it equals the reference, else None.
    """

    def __init__(self, first: FloatArray) -> None:
        self.latest = first
        self.status: Status | None = None
        self._reference, self._n_since_reference, self._interval = first, 0, 1

    def record(self, iterate: FloatArray) -> None:
        """Compare an iterate, shape (n_rows,), with the previous one and with the reference, and update ``status``."""
        if _are_equal(iterate, self.latest):
            self.status = Status.STALLED
        elif _are_equal(iterate, self._reference):
            self.status = Status.OSCILLATING
        self.latest, self._n_since_reference = iterate, self._n_since_reference + 1
        if self._n_since_reference == self._interval:
            self._reference, self._n_since_reference, self._interval = iterate, 0, 2 * self._interval


def _are_equal(a: FloatArray, b: FloatArray) -> bool:
    """Whether two vectors of impulses are equal up to rounding."""
    return bool((np.abs(a - b) <= ROUNDING * np.maximum(np.abs(a), np.abs(b))).all())
