"""Coulomb friction by De Saxcé's fixed point over cone programs (De Saxcé & Feng 1998; Acary & Cadoux 2013).

Coulomb's law is the associated law for the velocity whose normal part is raised by s = μ‖ξ_T‖,

    −(ξ + s e_N) ∈ N_K(Λ),      s = μ ‖ξ_T‖      for every contact,

so each outer iteration solves one cone program with c_N + s and takes s from the velocity that results. The plain
iteration converges linearly, and slowly on many contacts; Anderson acceleration of s ≥ 0 shortens it. Where mixing lets
the residual rise far above its best value, the pairs are forgotten and the plain iteration goes on from the last s.
"""

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...problems.contact import ContactProblem
from ...problems.judge import Residual
from ...problems.laws import FloatArray
from ...problems.model import Model
from ..interface import Observer, Solution, SolverError, Status, Stop, described
from .anderson import Anderson
from .clarabel_socp import check_form, converged, obstacle
from .programs import ConicProgram, Form, conic_program

TIGHTEST = 1e-13
"""Clarabel's tolerance below which its factorisations begin to fail."""

LOOSEST = 1e-8
"""Clarabel's tolerance above which a cone program that it gives up is not tried again."""

LOOSENING = 100.0
"""Factor on Clarabel's tolerance when it gives up and its result is no progress either."""

PROGRESS = 0.9
"""A residual below this fraction of the best one is progress."""

RISE = 10.0
"""The pairs of the acceleration are forgotten when the residual exceeds its best value by this factor."""

PATIENCE = 25
"""Outer iterations without a new best residual after which the iteration is called stalled."""


@dataclass(frozen=True)
class ClarabelCoulomb:
    """Exact Coulomb friction by a fixed point over Clarabel's solutions of the convex model.

    Attributes:
        form: impulses over the "delassus" matrix as variables, or velocities over the "factors" W and M⁻¹.
        memory: pairs that Anderson acceleration of the outer iteration remembers; 0 leaves it plain.

    Raises:
        SolverError: for an option out of range.
    """

    form: Form = "delassus"
    memory: int = 5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_form(self.form)
        if not isinstance(self.memory, int) or self.memory < 0:
            raise SolverError(f"memory must be a whole number, 0 or more, got {self.memory!r}.")

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return obstacle(problem, self.form)

    def prepare(self, problem: ContactProblem) -> "PreparedFixedPoint":
        """Set the program up, once for all outer iterations."""
        reason = self.supports(problem)
        if reason:
            raise SolverError(f"{self.name} cannot treat {problem.name!r}: {reason}.")
        residual = Residual(problem)
        program = conic_program(problem, residual, self.form)
        return PreparedFixedPoint(problem, residual, program, self.memory)


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
            result = self.program.run(shift, accuracy, stop.max_iterations, deadline - time.perf_counter())
            iteration, inner = iteration + 1, inner + result.iterations
            if not np.isfinite(result.impulses).all():
                reason = f"Clarabel ended with {result.status} at residual {best_residual:.1e}"
                return Solution(best, Status.STALLED, iteration, reason)
            velocity = self.problem.relative_velocity(result.impulses)
            residual = self.residual(result.impulses, velocity)
            if not converged(result.status) and residual > PROGRESS * best_residual and accuracy < LOOSEST:
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
            if time.perf_counter() > deadline:
                reason = f"residual {best_residual:.1e} after {iteration} cone programs of {inner} steps"
                return Solution(best, Status.TIME_LIMIT, iteration, reason)
            if since_best >= PATIENCE:
                reason = f"the residual stays at {best_residual:.1e}; Clarabel ended with {result.status}"
                return Solution(best, Status.STALLED, iteration, reason)
            image = self._lift(velocity)
            if residual > RISE * best_residual:
                anderson.forget()
            shift = np.maximum(anderson.next(shift, image), 0.0)
        reason = f"residual {best_residual:.1e} after {iteration} cone programs of {inner} steps"
        return Solution(best, Status.ITERATION_LIMIT, iteration, reason)

    def _lift(self, velocity: FloatArray) -> FloatArray:
        """Return s = μ‖ξ_T‖ of each block [m/s]."""
        layout = self.problem.layout
        lanes = layout.pad(velocity)
        lift: FloatArray = layout.friction_coefficient * np.sqrt((lanes[:, 1:] ** 2).sum(axis=1))
        return lift
