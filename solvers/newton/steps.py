"""Newton steps on the projection equations, taken as long as they reduce the residual.

Each step solves the linearised equations, scaled and damped (``linear_solver``).

If contacts over-determine the motion of bodies, the Jacobian is rank-deficient. Damping makes the step a proximal one
and leaves the solution unchanged, because it penalises δ instead of Λ, and δ vanishes at a solution (Levenberg 1944;
Marquardt 1963; for equations with non-isolated solutions: Yamashita & Fukushima 2001). Little damping gives Newton's
quadratic convergence; more keeps undetermined impulses bounded.

Far from a solution, full steps may cycle between contact states. A line search for the first of
t = 1, ½, …, 1/64 with

    ρ(Λ + tδ) < (1 − 10⁻⁴ t) ρ(Λ),      ρ the judge's residual,

breaks the cycle (De Luca, Facchinei & Kanzow 1996). At a kink of ρ, there may be no such t; the shortest step is
then taken. The best Λ of all steps is returned. Neither full nor shortened steps are always better.
Solvers therefore alternate between them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from ..iteration.loop import IterationDriver
from ..iteration.stopping import Clock
from .linear_solver import LinearSolver
from .linearised import Equations
from .work import Work

DIVERGENCE = 1e2
"""A run ends when the residual exceeds this multiple of its initial value."""

SUFFICIENT_DECREASE = 1e-4
"""Share of the linear decrease that a shortened step has to reach."""

MIN_STEP = 1.0 / 64.0
"""The smallest fraction of a step in a line search."""


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of a run of Newton's method.

    Attributes:
        damping: weight of δ in the equations, relative to α.
        max_steps: largest number of steps.
        min_step: smallest fraction of a step in the line search; 1 means full steps.
        gain: the run ends when a new best residual exceeds this fraction of the previous residual.
        patience: the run ends after this many steps without a new best residual.
    """

    damping: float
    max_steps: int
    min_step: float = 1.0
    gain: float = 0.5
    patience: int = 100


SHARP = NewtonSettings(damping=1e-12, max_steps=8)
"""Full steps with almost no damping; they may at first increase the residual while contact states change."""

DAMPED = NewtonSettings(damping=1e-3, max_steps=10)
"""Full steps with enough damping to bound undetermined impulses."""

THOROUGH = tuple(
    NewtonSettings(damping, max_steps=30, min_step=min_step, gain=1.0, patience=10)
    for damping in (1e-12, 1e-6, 1e-3)
    for min_step in (1.0, MIN_STEP)
)
"""Settings for problems on which ``SHARP`` and ``DAMPED`` fail."""

LINE_SEARCH = THOROUGH[1]
"""The most successful settings of ``THOROUGH``."""


def full_step(equations: Equations, solver: LinearSolver, impulses: FloatArray, damping: float) -> FloatArray | None:
    """Return Λ after a full Newton step, shape (n_rows,), or None if the system is singular or would take too long."""
    system = equations.linearise(impulses)
    goal = system.base
    if len(system.active):
        step = solver.solve(system, 1.0 / np.sqrt(equations.row_alpha[system.active]), damping)
        if step is None or not np.isfinite(step).all():
            return None
        goal[system.active] += step
    return goal


def search_line(
    residual: Callable[[FloatArray], float], origin: FloatArray, old_residual: float, goal: FloatArray, min_step: float
) -> tuple[FloatArray, float]:
    """Return the first point on the way back from ``goal`` that reduces the residual enough, and its residual.

    If there is none, return the last point of the search.

    Args:
        residual: Λ ↦ its residual.
        origin: Λ before the step [N s], shape (n_rows,).
        old_residual: the residual of ``origin``.
        goal: Λ after the full step, shape (n_rows,).
        min_step: smallest fraction of the step; 1 accepts the full step.
    """
    fraction, point, current = 1.0, goal, residual(goal)
    while fraction > min_step and not current < (1.0 - SUFFICIENT_DECREASE * fraction) * old_residual:
        fraction *= 0.5
        point = origin + fraction * (goal - origin)
        current = residual(point)
    return point, current


class NewtonMethod:
    """Newton's method on the equations of one problem, within the limits of one solve.

    Attributes:
        solver: the linear solver; it starts no factorisation that would miss the deadline, and counts the work.
    """

    def __init__(self, equations: Equations, clock: Clock, tolerance: float, work: Work | None = None) -> None:
        self.solver = LinearSolver(clock, work or Work(equations.entries))
        self._equations, self._tolerance = equations, tolerance

    def residual(self, impulses: FloatArray) -> float:
        """Return the residual of Λ [N s], shape (n_rows,), as the judge computes it."""
        return self._equations.residual.judged(self._equations.problem, impulses)

    def run(
        self, settings: NewtonSettings, impulses: FloatArray, first: float, may_continue: Callable[[FloatArray], bool]
    ) -> tuple[FloatArray, float]:
        """Do Newton steps from Λ [N s], shape (n_rows,), with residual ``first``; return the best Λ and its residual.

        ``may_continue`` receives each iterate and returns whether another step may follow.
        """
        best, lowest, current, n_stale = impulses, first, first, 0
        for _ in range(settings.max_steps):
            goal = full_step(self._equations, self.solver, impulses, settings.damping)
            if goal is None:
                break
            old_residual = current
            impulses, current = search_line(self.residual, impulses, old_residual, goal, settings.min_step)
            is_over = not may_continue(impulses)
            n_stale += 1
            is_new = current < lowest
            if is_new:
                best, lowest, n_stale = impulses, current, 0
            gains_little = is_new and current > settings.gain * old_residual
            if is_over or lowest <= self._tolerance or gains_little:
                break
            if n_stale >= settings.patience or not current <= DIVERGENCE * first:
                break
        return best, lowest


class NewtonRunner:
    """Newton's method from any iterate of one solve; the driver counts each step and shows it to the observer.

    Attributes:
        driver: runs the sweeps of the solve.
        work: work of sweeps and Newton steps; callers must add the sweeps that they do.
    """

    def __init__(self, equations: Equations, driver: IterationDriver) -> None:
        self.equations, self.driver = equations, driver
        self.work = Work(equations.entries)
        self._newton = NewtonMethod(equations, driver.monitor.clock, driver.monitor.stop.tolerance, self.work)

    @property
    def is_over(self) -> bool:
        """Whether the solve has reached a limit."""
        return self.reached_limit is not None

    @property
    def reached_limit(self) -> Status | None:
        """The limit that the solve has reached, or None."""
        monitor = self.driver.monitor
        return monitor.clock.reached_limit(monitor.stop, self.driver.iteration)

    def run(
        self, settings: NewtonSettings, impulses: FloatArray, residual: float, work_until: float = float("inf")
    ) -> tuple[FloatArray, float]:
        """Run Newton's method from ``impulses`` [N s], shape (n_rows,); return the best Λ and its residual.

        No step starts once the solve has done ``work_until`` nominal seconds of work.
        """
        if self.is_over or self.work.seconds >= work_until:
            return impulses, residual

        def may_continue(iterate: FloatArray) -> bool:
            self.driver.record(iterate)
            return not self.is_over and self.work.seconds < work_until

        return self._newton.run(settings, impulses, residual, may_continue)

    def residual(self, impulses: FloatArray) -> float:
        """Return the residual of Λ [N s], shape (n_rows,), as the judge computes it."""
        return self._newton.residual(impulses)
