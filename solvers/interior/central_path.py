"""CentralPath: power series that follow the central path of exact Coulomb friction through its turns.

In the notation of ``interior_point``, the path r∘û = τ e, û = Ĝr + ĉ + s e_N for fixed s is that of a convex program,
with one point for each τ. With s = ‖û_T‖, it is a curve along which τ may increase before it decreases again. At such a
turn, the equations for a smaller τ have no solution nearby, and Newton's method stagnates. The path is therefore
followed by arc length, for which turns are regular:

    1. On the manifold r∘û = τ e (``smoothing``), Newton's method reduces R_p (``interior_point``) to a fraction of τ,
       in the plane normal to the path.
    2. One factorisation gives the tangent and the power series (``power_series``). Its range ends where the term of
       the last order N is ε times the tangent, |a| = (ε/‖x_N‖)^(1/(N−1)); it is shortened until R_p is at most τ there.
    3. The steps repeat from the end of the range, until the residual reaches the tolerance.

Along the whole path det (Ĝ + D) has one sign where τ decreases and the other where it increases (Allgower & Georg,
*Introduction to Numerical Continuation Methods*, 2003, chapter 2). Each point thus determines the direction.
A direction chosen by the angle to the previous tangent would lead backwards at sharp bends of the path. If the solution
is strictly complementary, the path is analytic at τ = 0, and the residual decreases fast. Otherwise it decreases like
√τ.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.loop import infeasible_solution
from ..iteration.method import check_option
from .followed_path import FollowedPath
from .progress import Progress
from .runs import NEGLIGIBLE_STEP, InteriorMethod, PreparedRuns


@dataclass(frozen=True)
class CentralPath(InteriorMethod):
    """The central path, followed by arc length; one iteration is one factorisation.

    Attributes:
        order: order of the power series, 2 to 50.
        form: "delassus" factorises over contacts with the assembled G, "factors" over bodies with W and M⁻¹.

    Raises:
        SolverError: if an option is out of range.
    """

    order: int = 10
    form: Literal["delassus", "factors"] = "delassus"

    def __post_init__(self) -> None:
        check_option("order", self.order, type(self.order) is int and 2 <= self.order <= 50, "a whole number, 2 to 50")
        super().__post_init__()

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        if problem.laws.is_rolling.any():
            return "it has rolling friction, and the path exists only for contacts with one cone each"
        layout = problem.layout
        remote_blocks = np.flatnonzero(
            (layout.partner != np.arange(layout.n_blocks)) & (layout.friction_coefficient > 0.0)
        )
        if len(remote_blocks):
            law = int(layout.friction_law[remote_blocks[0]])
            return f"friction law {law} is bounded by the unilateral law of another contact"
        return super().supports(problem)

    def run(self, prepared: PreparedRuns, progress: Progress) -> None:
        """Follow the path until ``progress`` has an outcome."""
        path = self.path(prepared, progress)
        path.find(progress.best)
        path.follow()

    def path(self, prepared: PreparedRuns, progress: Progress) -> FollowedPath:
        """Return the path, whose first point has not been found yet."""
        return FollowedPath(prepared.scaled_problem, prepared.system, self.order, progress)


@dataclass(eq=False)
class ResumablePath:
    """A path that several solves follow, each from where the previous one stopped.

    Attributes:
        method: the method of the path.
        problem: the problem; the first solve prepares it.
        has_ended: whether the path cannot be followed further.
    """

    method: CentralPath
    problem: ContactProblem
    has_ended: bool = False
    _prepared: PreparedRuns | None = field(default=None, repr=False)
    _path: FollowedPath | None = field(default=None, repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Continue along the path, whose first point is found from ``start``; see ``Prepared.solve``."""
        self._prepared = self._prepared or self.method.prepare(self.problem)
        progress = self._prepared.begin(stop, start, observe, NEGLIGIBLE_STEP)
        if progress is None:
            self.has_ended = True
            return infeasible_solution(self.problem)
        self._path = self._path or self.method.path(self._prepared, progress)
        self._path.resume(progress)
        self.has_ended = progress.outcome is None or progress.outcome[0] is not Status.ITERATION_LIMIT
        return progress.solution()
