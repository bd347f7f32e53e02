"""InteriorNewton: interior points for what happens to each contact, Newton's method for how much.

An interior point method finds from anywhere, in a few dozen factorisations, which contacts open, stick and slip. Its
last digits are slow where an answer is not strictly complementary, and its path may turn. So four methods take turns,
each from what the others have found:

    InteriorPoint       fast where the path goes straight down
    CentralPath         from the beginning, through the turns of the path
    SemismoothNewton    from the best impulses so far: the last digits, least squares by its damping
    HybridNewton        sweeps from there, which rearrange contacts one by one where no path led

The first three have budgets of iterations, so that what is done does not depend on the machine.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ..interface import Observer, Prepared, Solution, Solver, Status, Stop
from ..interior.central_path import CentralPath
from ..interior.interior_point import InteriorPoint
from ..iteration.clock import Clock
from ..iteration.loop import judged
from ..iteration.method import Method
from ..newton.semismooth_newton import SemismoothNewton
from .hybrid_newton import HybridNewton

STRAIGHT, THROUGH_TURNS, LAST_DIGITS = 80, 200, 90
"""Most iterations of the first three methods."""


@dataclass(frozen=True)
class InteriorNewton(Method):
    """Interior points, their path through its turns, Newton's method on the states found, and sweeps where all fail.

    One iteration is a Newton step, a factorisation of the path, or a sweep.
    """

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return InteriorPoint().supports(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedRelay":
        """Prepare the first method; the others are prepared when their turn comes."""
        first = InteriorPoint().prepare(problem)
        return PreparedRelay(problem, Residual(problem), {"InteriorPoint": first})


@dataclass(frozen=True, eq=False)
class PreparedRelay:
    """The methods for one problem that have been prepared, by name."""

    problem: ContactProblem
    residual: Residual
    prepared: dict[str, Prepared] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Let the methods take turns until one solves the problem; see ``Prepared.solve``."""
        clock, used, ran = Clock(stop.max_seconds), 0, []
        best, lowest, last = None, np.inf, None
        for method, first, most in self._turns(start, stop.max_iterations):
            left = stop.max_iterations - used
            if last is not None and (left < 1 or clock.is_up):
                break
            limits = Stop(stop.tolerance, min(most, left), max(clock.left, 1e-9))
            origin = best if first is None else first
            last = self._ready(method).solve(limits, origin, _shown(observe, clock, used))
            used += last.iterations
            ran.append(f"{method.name}: {last.status}")
            residual = judged(self.problem, self.residual, last.impulses)
            if best is None or residual < lowest:
                best, lowest = last.impulses, residual
            if last.status in (Status.SOLVED, Status.INFEASIBLE):
                return Solution(last.impulses, last.status, used, "; ".join(ran))
        assert best is not None
        assert last is not None
        status = clock.limit_met(stop, used) or last.status
        return Solution(best, status, used, f"{'; '.join(ran)}; residual {lowest:.1e}")

    def _turns(self, start: FloatArray | None, most: int) -> Iterator[tuple[Solver, FloatArray | None, int]]:
        """Yield each method, where it begins (None for the best so far), and its limit of iterations."""
        zeros = np.zeros(self.problem.n_rows)
        yield InteriorPoint(), zeros if start is None else start, STRAIGHT
        if CentralPath().supports(self.problem) is None:
            yield CentralPath(), zeros, THROUGH_TURNS
        yield SemismoothNewton(), None, LAST_DIGITS
        yield HybridNewton(), None, most

    def _ready(self, method: Solver) -> Prepared:
        if method.name not in self.prepared:
            self.prepared[method.name] = method.prepare(self.problem)
        return self.prepared[method.name]


def _shown(observe: Observer | None, clock: Clock, before: int) -> Observer | None:
    """Return an observer of one turn that counts the iterations of those before."""
    if observe is None:
        return None
    return lambda iteration, impulses: clock.show(observe, before + iteration, impulses)
