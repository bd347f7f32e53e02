"""ProximalPoint: a sequence of regular contact problems, each solved by Newton's method.

    Λ^{k+1} solves   −(GΛ + c + ρ_k A (Λ − Λ^k)) ∈ N_{C(Λ)}(Λ),      A = diag(α),

(Rockafellar, Monotone operators and the proximal point algorithm, SIAM J. Control Optim. 14, 1976; for friction: Acary,
Brémond & Huber 2018). G + ρA has full rank for any number of redundant contacts, and a limit of the sequence solves the
problem itself. With small ρ, steps are long, but inner problems are as hard as the original one. Therefore ρ is reduced
after an inner solve that takes few Newton steps. It is increased if an inner solve does not converge, and this solve is
repeated.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop
from ..iteration.loop import infeasible_solution, initial_impulses
from ..iteration.method import Method
from ..iteration.stopping import Clock
from .linear_solver import LinearSolver
from .linearised import Equations
from .steps import MIN_STEP, full_step, search_line
from .work import Work

FIRST_WEIGHT, MIN_WEIGHT, MAX_WEIGHT = 1e-2, 1e-12, 1e4
"""The first ρ, and its limits."""

EASY_STEPS, MAX_STEPS = 6, 20
"""Largest number of Newton steps of an easy inner solve, and of any inner solve."""

DECREASE, INCREASE = 10.0, 10.0
"""Divisor of ρ after an easy inner solve, and its factor after a failed one."""

INNER_TOLERANCE = 1e-2
"""Tolerance of an inner solve, relative to the residual of its centre."""

DAMPING = 1e-14
"""Damping, relative to α, that prevents exactly singular inner Jacobians."""


@dataclass(frozen=True)
class ProximalPoint(Method):
    """The proximal point algorithm with an adaptive regularisation and Newton's method for the inner problems.

    One iteration is one Newton step.
    """

    def prepare(self, problem: ContactProblem) -> "PreparedProximalPoint":
        """Assemble G."""
        self.check_supports(problem)
        residual = Residual(problem)
        return PreparedProximalPoint(problem, residual, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedProximalPoint:
    """The projection equations of one problem."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    equations: Equations = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve inner problems until the residual reaches the tolerance; see ``Prepared.solve``."""
        check_stop(stop)
        first = initial_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        clock = Clock(stop.max_seconds)
        inner = _InnerProblems(self, clock)
        best, lowest, count = first, inner.residual(first), 0
        steps = inner.steps(first)
        while lowest > stop.tolerance:
            limit = clock.reached_limit(stop, count)
            iterate = next(steps, None) if limit is None else None
            if iterate is None:
                status, message = self._failure(limit, inner, best, lowest, count)
                return Solution(best, status, count, message)
            count += 1
            clock.show(observe, count, iterate)
            current_residual = inner.residual(iterate)
            if current_residual < lowest:
                best, lowest = iterate, current_residual
        return Solution(best, Status.SOLVED, count)

    def _failure(
        self, limit: Status | None, inner: "_InnerProblems", best: FloatArray, lowest: float, count: int
    ) -> tuple[Status, str]:
        """Return the status and message of a solve that has not reached the tolerance."""
        if limit is not None or inner.solver.lacks_time:
            return limit or Status.TIME_LIMIT, f"residual {lowest:.1e} after {count} Newton steps"
        if lowest <= self.residual.rounding(best):
            return Status.STALLED, f"rounding limits the residual to {lowest:.1e}"
        return Status.STALLED, f"no regularisation reduces the residual below {lowest:.1e}"


class _InnerProblems:
    """The inner problems of one solve."""

    def __init__(self, prepared: PreparedProximalPoint, clock: Clock) -> None:
        self._problem, self._residual, self._equations = prepared.problem, prepared.residual, prepared.equations
        self.solver = LinearSolver(clock, Work(prepared.equations.entries))

    def residual(self, impulses: FloatArray) -> float:
        """Return the residual of Λ, shape (n_rows,), in the judge's arithmetic."""
        return self._residual.judged(self._problem, impulses)

    def steps(self, first: FloatArray) -> Iterator[FloatArray]:
        """Yield Λ after each Newton step, until Λ no longer changes or ρ reaches its limit."""
        centre, weight = first, FIRST_WEIGHT
        while weight <= MAX_WEIGHT:
            inner = self._equations.regularised(weight, centre)
            residual = partial(self._inner_residual, inner)
            iterate, current_residual, count, is_solved = centre, residual(centre), 0, False
            tolerance = INNER_TOLERANCE * current_residual
            while count < MAX_STEPS and not is_solved:
                goal = full_step(inner, self.solver, iterate, DAMPING)
                if goal is None:
                    break
                iterate, current_residual = search_line(residual, iterate, current_residual, goal, MIN_STEP)
                count += 1
                yield iterate
                is_solved = current_residual <= tolerance
            if self.solver.lacks_time:
                return
            if not is_solved:
                weight *= INCREASE
                continue
            if np.array_equal(iterate, centre):
                return
            centre = iterate
            if count <= EASY_STEPS:
                weight = max(weight / DECREASE, MIN_WEIGHT)

    def _inner_residual(self, inner: Equations, impulses: FloatArray) -> float:
        return self._residual(impulses, inner.velocity(impulses))
