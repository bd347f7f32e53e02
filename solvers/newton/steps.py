"""Newton steps on the projection equations, until they no longer help.

Each step solves the linearised equations, scaled and damped (``linear_solver``).

Where contacts over-determine the bodies their matrix has no full rank. The damping makes the step the proximal one,
which leaves the solution where it is: it weighs δ, not Λ, and δ vanishes there (Levenberg 1944; Marquardt 1963; for
equations whose solutions are not isolated: Yamashita & Fukushima 2001). Little damping gives Newton's quadratic
convergence; more keeps undetermined impulses from running away.

Far from a solution a full step may lead to other states that lead back, a cycle. A search along the step, for the first
of t = 1, ½, …, 1/64 with

    ρ(Λ + tδ) < (1 − 10⁻⁴ t) ρ(Λ),      ρ the judge's residual,

breaks it (De Luca, Facchinei & Kanzow 1996). ρ has kinks, where no t may do; the shortest step is taken there, and the
best Λ of all is what counts. Neither way is better everywhere: attempts take them in turn.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..iteration.clock import Clock
from ..iteration.loop import judged
from .linear_solver import LinearSolver
from .linearised import Equations
from .work import Work

DIVERGENCE = 1e2
"""An attempt ends when the residual exceeds this many times the one it began with."""

SUFFICIENT = 1e-4
"""Share of the linear decrease that a shortened step has to reach."""

SHORTEST = 1.0 / 64.0
"""The shortest part of a step where there is a search."""


@dataclass(frozen=True)
class Attempt:
    """How far and how carefully Newton's method is followed.

    Attributes:
        damping: what δ is weighed with, relative to α.
        most_steps: number of steps.
        shortest: shortest part of a step that a search allows, and takes if none is better; 1 for full steps.
        gain: the attempt ends when a new best residual is more than this share of the residual before.
        patience: and when so many steps bring no new best residual.
    """

    damping: float
    most_steps: int
    shortest: float = 1.0
    gain: float = 0.5
    patience: int = 100


SHARP = Attempt(damping=1e-12, most_steps=8)
"""Full steps with hardly more damping than rounding: they may raise the residual at first, while states change."""

DAMPED = Attempt(damping=1e-3, most_steps=10)
"""Full steps where undetermined impulses run away."""

THOROUGH = tuple(
    Attempt(damping, most_steps=30, shortest=shortest, gain=1.0, patience=10)
    for damping in (1e-12, 1e-6, 1e-3)
    for shortest in (1.0, SHORTEST)
)
"""What is tried where nothing else helps."""

SEARCHING = THOROUGH[1]
"""The one of them that helps most often."""


class Newton:
    """Newton's method on one problem, to a residual of ``tolerance`` and within the limits of one solve.

    Attributes:
        solver: of the linear systems; it begins none that would not end in time, and adds each step to the work.
    """

    def __init__(
        self,
        problem: ContactProblem,
        residual: Residual,
        equations: Equations,
        clock: Clock,
        tolerance: float,
        work: Work,
    ) -> None:
        self.solver = LinearSolver(clock, work)
        self._problem, self._residual, self._equations, self._tolerance = problem, residual, equations, tolerance

    def judged(self, impulses: FloatArray) -> float:
        """Return the residual of Λ, shape (n_rows,), in the judge's arithmetic."""
        return judged(self._problem, self._residual, impulses)

    def followed(
        self, attempt: Attempt, impulses: FloatArray, first: float, goes_on: Callable[[FloatArray], bool]
    ) -> tuple[FloatArray, float]:
        """Do Newton steps from Λ [N s], shape (n_rows,), of residual ``first``; return the best Λ and its residual.

        ``goes_on`` is shown each iterate, and says whether there may be another.
        """
        best, lowest, present, waited = impulses, first, first, 0
        for _ in range(attempt.most_steps):
            step = self._stepped(impulses, attempt.damping)
            if step is None:
                break
            before = present
            impulses, present = self._shortened(impulses, before, step, attempt.shortest)
            is_over = not goes_on(impulses)
            waited += 1
            is_new = present < lowest
            if is_new:
                best, lowest, waited = impulses, present, 0
            converged = lowest <= self._tolerance or (is_new and present > attempt.gain * before)
            if is_over or converged or waited >= attempt.patience or not present <= DIVERGENCE * first:
                break
        return best, lowest

    def _shortened(
        self, origin: FloatArray, before: float, goal: FloatArray, shortest: float
    ) -> tuple[FloatArray, float]:
        """Return the first point from ``goal`` back where the residual falls, or the last, and its residual."""
        part, point, present = 1.0, goal, self.judged(goal)
        while part > shortest and not present < (1.0 - SUFFICIENT * part) * before:
            part *= 0.5
            point = origin + part * (goal - origin)
            present = self.judged(point)
        return point, present

    def _stepped(self, impulses: FloatArray, damping: float) -> FloatArray | None:
        """Return Λ after one step, or None where the system cannot be solved or would take too long."""
        system = self._equations.linearised(impulses)
        if len(system.active) == 0:
            return system.base
        step = self.solver.solve(system, 1.0 / np.sqrt(self._equations.row_alpha[system.active]), damping)
        if step is None or not np.isfinite(step).all():
            return None
        moved = system.base
        moved[system.active] += step
        return moved
