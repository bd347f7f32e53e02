"""Enumeration of contact states: all solutions of a tiny planar problem, as a reference for other methods.

A unilateral law is open (Λ_N = 0) or closed (ξ_N = 0). A planar friction law sticks (ξ_T = 0) or slips at one of its
bounds (Λ_T = ±(a + μ Λ_N)). Each combination of states gives a linear system. The judge checks whether its solution
also satisfies the inequalities. Without fixed bounds there are at most 5ⁿ combinations for n contacts.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop, start_impulses
from ..iteration.loop import infeasible_solution
from ..iteration.method import SLIDING, Method
from ..iteration.stopping import Clock

MAX_CONTACTS = 6
"""Largest number of contacts; all combinations of states then take about a second."""

SINGULAR = 1e-12
"""Ratio of singular values below which a system counts as singular; its solution of least norm is then used."""

NO_SOLUTION = 1e-3
"""If the lowest residual is larger, the problem has no solution; a smaller residual may be due to rounding."""

SAME_SOLUTION = 1e-9
"""Impulses that differ by less, relative to the largest one, count as the same solution."""


@dataclass(frozen=True)
class Enumeration(Method):
    """All combinations of contact states, one after the other."""

    has_iterates: ClassVar[bool] = False
    law_kinds: ClassVar[frozenset[int]] = SLIDING

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        reason = super().supports(problem)
        if reason:
            return reason
        if (problem.laws.row_count > 1).any():
            return "it has spatial friction, whose directions of slip cannot be enumerated"
        if problem.n_contacts > MAX_CONTACTS:
            return f"it has {problem.n_contacts} contacts; more than {MAX_CONTACTS} have too many states"
        return None

    def prepare(self, problem: ContactProblem) -> "PreparedEnumeration":
        """Assemble dense G."""
        self.check_supports(problem)
        return PreparedEnumeration(problem, problem.delassus().toarray(), Residual(problem))


@dataclass(frozen=True, eq=False)
class PreparedEnumeration:
    """The combinations of one problem."""

    problem: ContactProblem
    matrix: FloatArray = field(repr=False)
    residual: Residual = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Return the first solution; INFEASIBLE if all combinations are regular and no residual is small.

        ``iterations`` counts combinations.
        """
        check_stop(stop)
        n_rows = self.problem.n_rows
        start_impulses(start, n_rows)  # raises an error if the start is invalid
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        if n_rows == 0:
            return Solution(np.zeros(0), Status.SOLVED, 0)
        best, best_residual, n_tried, n_singular = np.zeros(n_rows), np.inf, 0, 0
        clock = Clock(stop.max_seconds)
        for impulses, is_regular in self._candidates():
            if n_tried >= stop.max_iterations:
                reason = f"residual {best_residual:.1e} after {n_tried} combinations"
                return Solution(best, Status.ITERATION_LIMIT, n_tried, reason)
            n_tried += 1
            n_singular += not is_regular
            residual = self.residual.judged(self.problem, impulses)
            if residual < best_residual:
                best, best_residual = impulses, residual
            if best_residual <= stop.tolerance:
                return Solution(best, Status.SOLVED, n_tried)
            if clock.has_expired:
                reason = f"residual {best_residual:.1e} after {n_tried} combinations"
                return Solution(best, Status.TIME_LIMIT, n_tried, reason)
        if n_singular:
            reason = (
                f"none of {n_tried} combinations is a solution; of the {n_singular} singular ones only the solution of "
                "least norm was tried"
            )
            return Solution(best, Status.STALLED, n_tried, reason)
        if best_residual <= max(NO_SOLUTION, stop.tolerance):
            reason = f"rounding limits the best of {n_tried} combinations to residual {best_residual:.1e}"
            return Solution(best, Status.STALLED, n_tried, reason)
        return Solution(
            best, Status.INFEASIBLE, n_tried, f"none of {n_tried} combinations is a solution, and none is singular"
        )

    def all_solutions(self, tolerance: float) -> list[FloatArray]:
        """Return all different Λ whose residual in the judge's arithmetic is at most ``tolerance``."""
        solutions: list[FloatArray] = []
        for impulses, _ in self._candidates():
            if self.residual.judged(self.problem, impulses) > tolerance:
                continue
            scale = max(float(np.abs(impulses).max(initial=0.0)), np.finfo(float).tiny)
            if not any(np.abs(impulses - known).max(initial=0.0) <= SAME_SOLUTION * scale for known in solutions):
                solutions.append(impulses)
        return solutions

    def _candidates(self) -> Iterator[tuple[FloatArray, bool]]:
        """Yield the impulses of each combination of states, and whether its system is regular."""
        laws = self.problem.laws
        choices = [("stick", "+", "-") if is_friction else ("open", "closed") for is_friction in laws.is_friction]
        for states in itertools.product(*choices):
            is_duplicate = any(
                state == "-" and laws.fixed_bound[law] == 0.0 and states[laws.partner[law]] == "open"
                for law, state in enumerate(states)
            )
            if not is_duplicate:  # with a bound of zero, "-" is the same state as "+"
                yield self._solve(states)

    def _solve(self, states: tuple[str, ...]) -> tuple[FloatArray, bool]:
        laws, n_rows = self.problem.laws, self.problem.n_rows
        system, right = self.matrix.copy(), -self.problem.free_velocity
        for law, state in enumerate(states):
            row = laws.first_row[law]
            if state in ("closed", "stick"):
                continue
            system[row], right[row] = 0.0, 0.0
            system[row, row] = 1.0
            if state in ("+", "-"):
                sign = 1.0 if state == "+" else -1.0
                right[row] = sign * laws.fixed_bound[law]
                if laws.partner[law] >= 0:
                    system[row, laws.first_row[laws.partner[law]]] = -sign * laws.friction_coefficient[law]
        solved = np.linalg.lstsq(system, right, rcond=SINGULAR)
        impulses: FloatArray = solved[0].astype(np.float64)
        return impulses, int(solved[2]) == n_rows
