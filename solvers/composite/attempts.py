"""Attempts at Newton's method within the limits of one solve, and what they cost."""

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Status
from ..iteration.loop import Advance
from ..newton.linearised import Equations
from ..newton.steps import Attempt, Newton
from ..newton.work import Work


class Attempts:
    """Newton's method from any iterate of one solve, whose ``advance`` counts and shows each step.

    Attributes:
        work: what sweeps and Newton steps have taken; who sweeps adds to it.
    """

    def __init__(self, problem: ContactProblem, residual: Residual, equations: Equations, advance: Advance) -> None:
        self.problem, self.advance = problem, advance
        self.work = Work(equations.entries)
        monitor = advance.monitor
        self._newton = Newton(problem, residual, equations, monitor.clock, monitor.stop.tolerance, self.work)

    @property
    def is_over(self) -> bool:
        """Whether a limit of the solve is met."""
        return self.limit_met is not None

    @property
    def limit_met(self) -> Status | None:
        """The limit of the solve that is met, or None."""
        monitor = self.advance.monitor
        return monitor.clock.limit_met(monitor.stop, self.advance.iteration)

    def tried(
        self, attempt: Attempt, impulses: FloatArray, residual: float, work_until: float = float("inf")
    ) -> tuple[FloatArray, float]:
        """Return the best Λ [N s] of an attempt from ``impulses``, shape (n_rows,), and its residual.

        No step is begun after ``work_until`` nominal seconds of the whole solve.
        """
        if self.is_over or self.work.seconds >= work_until:
            return impulses, residual

        def goes_on(reached: FloatArray) -> bool:
            self.advance.arrive(reached)
            return not self.is_over and self.work.seconds < work_until

        return self._newton.followed(attempt, impulses, residual, goes_on)

    def judged(self, impulses: FloatArray) -> float:
        """Return the residual of Λ, shape (n_rows,), in the judge's arithmetic."""
        return self._newton.judged(impulses)
