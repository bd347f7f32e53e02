"""ProximalPoint: a chain of contact problems that are regular, each solved by Newton's method.

    Λ^{k+1} solves   −(GΛ + c + ρ_k A (Λ − Λ^k)) ∈ N_{C(Λ)}(Λ),      A = diag(α),

(Rockafellar, Monotone operators and the proximal point algorithm, SIAM J. Control Optim. 14, 1976, for friction: Acary,
Brémond & Huber 2018). G + ρA has full rank however many contacts are redundant, and whatever limit the chain has solves
the problem itself. Small ρ make long steps, and inner problems as hard as the whole. So ρ follows the inner solves: one
that takes few Newton steps divides it, one that does not converge multiplies it and is begun again.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.clock import Clock
from ..iteration.loop import first_impulses, judged, refuted
from ..iteration.method import Method
from .linear_solver import LinearSolver
from .linearised import Equations
from .steps import SHORTEST, SUFFICIENT
from .work import Work

FIRST_WEIGHT, LEAST_WEIGHT, LARGEST_WEIGHT = 1e-2, 1e-12, 1e4
"""ρ at first, and its limits."""

FEW, MOST = 6, 20
"""Newton steps after which an inner solve counts as easy, and as failed."""

EASIER, HARDER = 10.0, 10.0
"""What ρ is divided by after an easy inner solve, and multiplied with after a failed one."""

INNER = 1e-2
"""An inner problem is solved to this share of the residual of its centre."""

DAMPING = 1e-14
"""What keeps inner Jacobians from being exactly singular, relative to α."""


@dataclass(frozen=True)
class ProximalPoint(Method):
    """The proximal point algorithm with Newton's method inside and a regularisation that adapts.

    One iteration is one Newton step.
    """

    def prepare(self, problem: ContactProblem) -> "PreparedProximalPoint":
        """Assemble G."""
        residual = Residual(problem)
        return PreparedProximalPoint(problem, residual, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedProximalPoint:
    """Newton's equations of one problem."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    equations: Equations = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Follow the chain to the judge's residual; see ``Prepared.solve``."""
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return refuted(self.problem)
        clock = Clock(stop.max_seconds)
        chain = _Chain(self, clock)
        best, lowest, count = first, chain.judged(first), 0
        steps = chain.steps(first)
        while lowest > stop.tolerance:
            limit = clock.limit_met(stop, count)
            newest = next(steps, None) if limit is None else None
            if newest is None:
                return Solution(best, *self._ended(limit, chain, best, lowest, count))
            count += 1
            clock.show(observe, count, newest)
            present = chain.judged(newest)
            if present < lowest:
                best, lowest = newest, present
        return Solution(best, Status.SOLVED, count)

    def _ended(
        self, limit: Status | None, chain: "_Chain", best: FloatArray, lowest: float, count: int
    ) -> tuple[Status, int, str]:
        reached = f"residual {lowest:.1e} after {count} Newton steps"
        if limit is not None or chain.solver.lacks_time:
            return limit or Status.TIME_LIMIT, count, reached
        if lowest <= self.residual.rounding(best):
            return Status.STALLED, count, f"rounding leaves the residual at {lowest:.1e}"
        return Status.STALLED, count, f"no regularisation leads further than a residual of {lowest:.1e}"


class _Chain:
    """The inner problems of one solve."""

    def __init__(self, prepared: PreparedProximalPoint, clock: Clock) -> None:
        self._problem, self._residual, self._equations = prepared.problem, prepared.residual, prepared.equations
        self.solver = LinearSolver(clock, Work(prepared.equations.entries))

    def judged(self, impulses: FloatArray) -> float:
        """Return the residual of Λ, shape (n_rows,), in the judge's arithmetic."""
        return judged(self._problem, self._residual, impulses)

    def steps(self, first: FloatArray) -> Iterator[FloatArray]:
        """Yield Λ after each Newton step, until the chain neither moves nor may be regularised more."""
        centre, weight = first, FIRST_WEIGHT
        while weight <= LARGEST_WEIGHT:
            inner = self._equations.regularised(weight, centre)
            newest, count, is_solved = centre, 0, False
            goal = INNER * self._inner_residual(inner, centre)
            while count < MOST and not is_solved:
                following = self._stepped(inner, newest)
                if following is None:
                    break
                newest, count = following, count + 1
                yield newest
                is_solved = self._inner_residual(inner, newest) <= goal
            if self.solver.lacks_time:
                return
            if not is_solved:
                weight *= HARDER
                continue
            if np.array_equal(newest, centre):
                return
            centre = newest
            if count <= FEW:
                weight = max(weight / EASIER, LEAST_WEIGHT)

    def _inner_residual(self, inner: Equations, impulses: FloatArray) -> float:
        return self._residual(impulses, inner.velocity(impulses))

    def _stepped(self, inner: Equations, origin: FloatArray) -> FloatArray | None:
        """Return Λ after one Newton step with a search along it, None where there is no step."""
        system = inner.linearised(origin)
        goal = system.base
        if len(system.active):
            step = self.solver.solve(system, 1.0 / np.sqrt(inner.row_alpha[system.active]), DAMPING)
            if step is None or not np.isfinite(step).all():
                return None
            goal[system.active] += step
        before, part, point = self._inner_residual(inner, origin), 1.0, goal
        while part > SHORTEST and not self._inner_residual(inner, point) < (1.0 - SUFFICIENT * part) * before:
            part *= 0.5
            point = origin + part * (goal - origin)
        return point
