"""How a simulation asks its solver: whether it can treat a step at all, and once more if the first try falls short."""

from dataclasses import dataclass, replace

from ...problems.contact import ContactProblem
from ...problems.laws import FloatArray
from ...solvers.interface import Observer, Prepared, Solution, Solver, Status, Stop
from ..errors import BenchError

WARM_ITERATIONS = 500
"""Iterations from the impulses of the last step after which a solver is asked to begin at zero. While balls flow either
start is as good; in a pile at rest, the right one ends at once and a wrong one may lead to a plateau."""


@dataclass(frozen=True)
class Asked:
    """A solver as ``Moreau`` wants it.

    Attributes:
        solver: the solver that is asked.
    """

    solver: Solver

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Prepare ``problem``.

        Raises:
            BenchError: if the solver cannot treat it.
        """
        reason = self.solver.supports(problem)
        if reason:
            raise BenchError(f"it cannot treat this step: {reason}")
        return TwoStarts(self.solver.prepare(problem))


@dataclass(frozen=True)
class TwoStarts:
    """A prepared solver that begins at zero where the start that it was given does not lead to the tolerance.

    Attributes:
        prepared: the solver.
    """

    prepared: Prepared

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Return the solution from ``start``, or from zero if that falls short; iterations are those of both."""
        if start is None or not start.any():
            return self.prepared.solve(stop, start, observe)
        warm = self.prepared.solve(replace(stop, max_iterations=min(stop.max_iterations, WARM_ITERATIONS)), start)
        left = stop.max_iterations - warm.iterations
        if warm.status in (Status.SOLVED, Status.INFEASIBLE, Status.UNSUPPORTED) or left < 1:
            return warm
        cold = self.prepared.solve(replace(stop, max_iterations=left), None)
        return replace(cold, iterations=warm.iterations + cold.iterations)
