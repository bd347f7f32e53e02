"""CentralPath: the central path of exact Coulomb friction, followed by power series through its turns.

For fixed s the path r∘û = τ e, û = Ĝr + ĉ + s e_N is that of a convex program, one for each τ. With s = ‖û_T‖ it is a
curve that may turn back in τ before it goes down again: there Newton's method towards a smaller τ has nothing to
converge to, and stands still. So the path is followed by its arc length, in which a turn is nothing special:

    1. On the manifold r∘û = τ e (``smoothing``) Newton's method brings R_p below κτ, along the plane across the path.
    2. One factorisation gives tangent and power series (``power_series``). Their range is where the last order has
       grown to ε of the tangent, |a| = (ε/‖x_N‖)^(1/(N−1)); it is shortened until R_p is below τ there.
    3. From there again, until the judged residual reaches the tolerance.

τ is free to rise. Along the whole path det (Ĝ + D) has one sign where τ falls and the other where it rises (Allgower &
Georg, *Introduction to Numerical Continuation Methods*, 2003, chapter 2). So each point says by itself which way goes
on; the angle to the tangent before does not where the path bends sharply, and led back along what was followed already.
Where the answer is strictly complementary the path is analytic at τ = 0 and its end comes fast; where it is not, the
residual goes down like √τ.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.loop import refuted
from ..iteration.method import check_form, check_option
from .followed_path import FollowedPath
from .interior_point import NewtonSystem, form_obstacle, newton_system
from .progress import Progress
from .runs import HARDLY, InRuns, PreparedRuns
from .scaled_problem import ScaledProblem


@dataclass(frozen=True)
class CentralPath(InRuns):
    """The central path followed by arc length; one iteration is one factorisation.

    Attributes:
        order: of the power series, 2 or more.
        form: factorise over contacts, with the "delassus" matrix assembled, or over bodies, by the "factors".

    Raises:
        SolverError: for an option out of range.
    """

    order: int = 10
    form: Literal["delassus", "factors"] = "delassus"

    def __post_init__(self) -> None:
        check_option("order", self.order, type(self.order) is int and 2 <= self.order <= 50, "a whole number, 2 to 50")
        check_form(self.form)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        if problem.laws.is_rolling.any():
            return "it has rolling friction, and this path is that of contacts with one cone each"
        layout = problem.layout
        remote = np.flatnonzero((layout.partner != np.arange(layout.n_blocks)) & (layout.friction_coefficient > 0.0))
        if len(remote):
            law = int(layout.friction_law[remote[0]])
            return f"friction law {law} is bounded by a unilateral law that it does not follow"
        return form_obstacle(problem, self.form)

    def prepare(self, problem: ContactProblem) -> "PreparedPath":
        """Scale the problem, assemble what the form needs, and order the factorisation."""
        self.check_supports(problem)
        residual = Residual(problem)
        scaled = ScaledProblem(problem, residual, "de_saxce")
        return PreparedPath(problem, residual, scaled, newton_system(problem, scaled, self.form), self.order)


@dataclass(frozen=True, eq=False)
class PreparedPath(PreparedRuns):
    """The scaled problem and its ordered factorisation."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    scaled: ScaledProblem = field(repr=False)
    system: NewtonSystem = field(repr=False)
    order: int

    @property
    def flops(self) -> float:
        """See ``PreparedRuns``."""
        return self.system.flops

    def run(self, progress: Progress) -> None:
        """Follow the path until the progress has ended."""
        path = self.path(progress)
        path.begin(progress.best)
        path.follow()

    def path(self, progress: Progress) -> FollowedPath:
        """Return the path, which is not found yet."""
        return FollowedPath(self.scaled, self.system, self.order, progress)


@dataclass(eq=False)
class PathInTurns:
    """One path that several solves follow, each on from where the one before was left, once it has been found.

    Attributes:
        method: whose path it is.
        problem: the problem, which is prepared when the first solve begins.
        has_ended: whether it leads no further.
    """

    method: CentralPath
    problem: ContactProblem
    has_ended: bool = False
    _prepared: PreparedPath | None = field(default=None, repr=False)
    _path: FollowedPath | None = field(default=None, repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Go on along the path; it is looked for from ``start`` until it is found; see ``Prepared.solve``."""
        self._prepared = self._prepared or self.method.prepare(self.problem)
        progress = self._prepared.begun(stop, start, observe, HARDLY)
        if progress is None:
            self.has_ended = True
            return refuted(self.problem)
        self._path = self._path or self._prepared.path(progress)
        self._path.go_on(progress)
        self.has_ended = progress.ended is None or progress.ended[0] is not Status.ITERATION_LIMIT
        return progress.solution()
