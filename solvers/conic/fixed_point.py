"""Coulomb friction by De Saxcé's fixed point over cone programs (De Saxcé & Feng 1998; Acary & Cadoux 2013).

Coulomb's law is the associated law for the velocity whose normal part is raised by s = μ‖ξ_T‖,

    −(ξ + s e_N) ∈ N_K(Λ),      s = μ ‖ξ_T‖      for every contact,

so each outer iteration solves one cone program with c_N + s and takes s from the velocity that results. The plain
iteration converges linearly, and slowly on many contacts; Anderson acceleration of s ≥ 0 shortens it. Where mixing lets
the residual rise far above its best value, the pairs are forgotten and the plain iteration goes on from the last s.
"""

import time
from dataclasses import dataclass

import numpy as np

from ...problems.contact import ContactProblem
from ...problems.judge import Residual
from ...problems.laws import FloatArray
from ..interface import Observer, Solution, SolverError, Status, Stop
from .anderson import Anderson
from .programs import ConicProgram, ConicResult, Ended

TIGHTEST = 1e-13
"""A conic solver's tolerance below which its factorisations begin to fail."""

LOOSEST = 1e-8
"""The tolerance above which a cone program that it gives up is not tried again."""

LOOSENING = 100.0
"""Factor on the tolerance when the conic solver gives up and its result is no progress either."""

PROGRESS = 0.9
"""A residual below this fraction of the best one is progress."""

RISE = 10.0
"""The pairs of the acceleration are forgotten when the residual exceeds its best value by this factor."""

INNER_ITERATIONS = 1_000_000
"""Limit of iterations of one cone program, which each conic solver lowers to what makes sense for it."""

PATIENCE = 25
"""Outer iterations without a new best residual after which the iteration is called stalled."""


def check_memory(memory: int) -> None:
    """Raise ``SolverError`` unless ``memory`` is a number of pairs."""
    if not isinstance(memory, int) or memory < 0:
        raise SolverError(f"memory must be a whole number, 0 or more, got {memory!r}.")


@dataclass(frozen=True)
class PreparedFixedPoint:
    """The outer iteration over the cone program of one problem."""

    problem: ContactProblem
    residual: Residual
    program: ConicProgram
    memory: int

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Iterate to the judge's residual; ``iterations`` counts cone programs, and ``start`` gives the first s."""
        n_rows = self.problem.n_rows
        if self.residual.infeasible:
            return Solution(np.zeros(n_rows), Status.INFEASIBLE, 0, "a unilateral law has G_ii = 0 and c_i < 0")
        if n_rows == 0 or self.residual.scale == 0.0:
            return Solution(np.zeros(n_rows), Status.SOLVED, 0)
        first = np.zeros(n_rows) if start is None else np.array(start, dtype=np.float64)
        velocity = self.problem.relative_velocity(first)
        best, best_residual = first, self.residual(first, velocity)
        if best_residual <= stop.tolerance:
            return Solution(first, Status.SOLVED, 0)
        shift = np.zeros(self.problem.n_contacts) if start is None else self._lift(velocity)
        anderson, deadline = Anderson(self.memory), time.perf_counter() + stop.max_seconds
        accuracy = max(TIGHTEST, stop.tolerance**2)
        iteration, since_best, inner = 0, 0, 0
        while iteration < stop.max_iterations:
            result = self.program.run(shift, accuracy, INNER_ITERATIONS, deadline - time.perf_counter())
            iteration, inner = iteration + 1, inner + result.iterations
            if not np.isfinite(result.impulses).all():
                status = Status.TIME_LIMIT if self._is_late(result, deadline) else Status.STALLED
                reason = f"the conic solver ended with {result.ended} at residual {best_residual:.1e}"
                return Solution(best, status, iteration, reason)
            velocity = self.problem.relative_velocity(result.impulses)
            residual = self.residual(result.impulses, velocity)
            if result.ended is not Ended.CONVERGED and residual > PROGRESS * best_residual and accuracy < LOOSEST:
                accuracy *= LOOSENING
            if observe is not None:
                began = time.perf_counter()
                shown = result.impulses.copy()
                shown.setflags(write=False)
                observe(iteration, shown)
                deadline += time.perf_counter() - began
            since_best = 0 if residual < best_residual else since_best + 1
            if residual < best_residual:
                best, best_residual = result.impulses, residual
            if best_residual <= stop.tolerance:
                return Solution(best, Status.SOLVED, iteration)
            if self._is_late(result, deadline):
                reason = f"residual {best_residual:.1e} after {iteration} cone programs of {inner} steps"
                return Solution(best, Status.TIME_LIMIT, iteration, reason)
            if since_best >= PATIENCE:
                reason = f"the residual stays at {best_residual:.1e}; the conic solver ended with {result.ended}"
                return Solution(best, Status.STALLED, iteration, reason)
            image = self._lift(velocity)
            if residual > RISE * best_residual:
                anderson.forget()
            shift = np.maximum(anderson.next(shift, image), 0.0)
        reason = f"residual {best_residual:.1e} after {iteration} cone programs of {inner} steps"
        return Solution(best, Status.ITERATION_LIMIT, iteration, reason)

    @staticmethod
    def _is_late(result: ConicResult, deadline: float) -> bool:
        """Whether the time is over, by this clock or by the conic solver's own."""
        return result.ended is Ended.TIME_LIMIT or time.perf_counter() > deadline

    def _lift(self, velocity: FloatArray) -> FloatArray:
        """Return s = μ‖ξ_T‖ of each block [m/s]."""
        layout = self.problem.layout
        lanes = layout.pad(velocity)
        lift: FloatArray = layout.friction_coefficient * np.sqrt((lanes[:, 1:] ** 2).sum(axis=1))
        return lift
