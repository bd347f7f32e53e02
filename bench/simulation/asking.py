"""How a simulation asks its solver: whether it can treat a step at all, and again where a try falls short.

Steps of a pile at rest are hard now and then: the impulses of the last step may lead onto a plateau that zero avoids,
and one relaxation may circle about a solution that another finds. A step is tried again before it counts as unsolved.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Residual
from ...problems.contact.problem import ContactProblem
from ...solvers.interface import Observer, Prepared, Solution, Solver, Status, Stop
from ..errors import BenchError

WARM_ITERATIONS = 500
"""Iterations from the impulses of the last step. While balls flow either start is as good as the other; in a pile at
rest the right one ends at once."""

TRY_ITERATIONS = 2000
"""Iterations of any further try but the last, which takes what is left."""

_FINAL = (Status.SOLVED, Status.INFEASIBLE, Status.UNSUPPORTED)


@dataclass(frozen=True)
class Asked:
    """A solver as ``Moreau`` wants it.

    Attributes:
        solver: the solver that is asked.
        others: asked after it where it falls short.
    """

    solver: Solver
    others: Sequence[Solver] = ()

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Prepare ``problem``.

        Raises:
            BenchError: if the solver cannot treat it.
        """
        reason = self.solver.supports(problem)
        if reason:
            raise BenchError(f"it cannot treat this step: {reason}")
        return Tries(problem, self.solver.prepare(problem), self.others)


@dataclass(frozen=True)
class Tries:
    """A prepared solver that begins at zero, and leaves the problem to others, where it falls short.

    Attributes:
        problem: the problem.
        prepared: the solver, ready for it.
        others: solvers that are prepared only if it comes to that.
    """

    problem: ContactProblem
    prepared: Prepared
    others: Sequence[Solver] = ()

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Return the first solution that is solved, else the best; the limit and the count are those of all tries."""
        best, used = None, 0
        for prepared, begin, limit in self._tries(start, stop.max_iterations):
            left = stop.max_iterations - used
            if best is not None and left < 1:
                break
            found = prepared.solve(replace(stop, max_iterations=min(limit, left)), begin, observe)
            used += found.iterations
            if found.status in _FINAL:
                return replace(found, iterations=used)
            if best is None or self._residual(found) < self._residual(best):
                best = found
        assert best is not None
        return replace(best, iterations=used)

    def _tries(self, start: FloatArray | None, most: int) -> Iterator[tuple[Prepared, FloatArray | None, int]]:
        """Yield who is asked, from where, and with how many iterations."""
        if start is not None and start.any():
            yield self.prepared, start, WARM_ITERATIONS
        yield self.prepared, None, TRY_ITERATIONS if self.others else most
        for index, solver in enumerate(self.others, 1):
            yield solver.prepare(self.problem), None, TRY_ITERATIONS if index < len(self.others) else most

    def _residual(self, solution: Solution) -> float:
        return Residual(self.problem)(solution.impulses, self.problem.relative_velocity(solution.impulses))
