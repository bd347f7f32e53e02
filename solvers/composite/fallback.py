"""Fallback: several solvers in turn, until one solves the problem.

A problem can be hard for one method and easy for another, and hard from one start and easy from another: the impulses
of the last time step may lead onto a plateau that zero avoids, and one relaxation may circle about a solution that
another finds. The first part is tried from the start, then all parts in turn from zero.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import ModelResidual, Residual
from ...problems.contact.solver import Observer, Prepared, Solution, Solver, SolverError, Status, Stop, shows_iterates
from ..iteration.clock import Clock
from ..iteration.loop import judged
from ..iteration.method import Method, check_option

WARM_ITERATIONS = 500
"""In flow either start is as good as the other; in a pile at rest the impulses of the last step are nearly the answer,
or lead nowhere."""

ITERATIONS = 2000
"""Enough for sweeps on most problems that they solve at all."""


@dataclass(frozen=True, init=False)
class Fallback(Method):
    """Solvers tried in turn: ``Fallback(SORprox(relaxation=1.5), NSGS)``.

    The limits of a solve hold for all parts together. The first solution is returned, else the best impulses of all
    parts by the judge's residual, with the status of that part; the message says which parts ran, and how each ended.

    Attributes:
        parts: the solvers, all of one model; one that does not take a problem is left out.
        warm_iterations: limit of the first try, by the first part from the start; without a start it is left out.
        iterations: limit of each further try, from zero; the last part takes what is left.

    Raises:
        SolverError: without parts, for parts of different models, or for an option out of range.
    """

    parts: tuple[Solver, ...]
    warm_iterations: int
    iterations: int

    def __init__(self, *parts: Solver, warm_iterations: int = WARM_ITERATIONS, iterations: int = ITERATIONS) -> None:
        if not parts:
            raise SolverError("Fallback is made of solvers; name one or more: Fallback(SORprox, NSGS).")
        other = next((part for part in parts if part.model != parts[0].model), None)
        if other is not None:
            raise SolverError(
                f"parts of a Fallback solve one model; {parts[0].name} solves {parts[0].model}, "
                f"{other.name} {other.model}."
            )
        for option, value in (("warm_iterations", warm_iterations), ("iterations", iterations)):
            check_option(option, value, type(value) is int and value >= 1, "a whole number, 1 or more")
            object.__setattr__(self, option, value)
        object.__setattr__(self, "parts", parts)

    @property
    def name(self) -> str:
        """Class name with the names of the parts and the options that differ from the defaults."""
        options = (("warm_iterations", WARM_ITERATIONS), ("iterations", ITERATIONS))
        words = [f"{key}={getattr(self, key)}" for key, default in options if getattr(self, key) != default]
        return f"{type(self).__name__}({', '.join([*(part.name for part in self.parts), *words])})"

    @property
    def model(self) -> Model:
        """The model of the parts."""
        return self.parts[0].model

    @property
    def has_iterates(self) -> bool:
        """Whether every part shows its iterates."""
        return all(map(shows_iterates, self.parts))

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why no part can treat ``problem``, or None."""
        reasons = [part.supports(problem) for part in self.parts]
        if None in reasons:
            return None
        if len(reasons) == 1:
            return reasons[0]
        return "; ".join(f"{part.name}: {reason}" for part, reason in zip(self.parts, reasons, strict=True))

    def prepare(self, problem: ContactProblem) -> "PreparedFallback":
        """Prepare the first part that takes the problem; the others are prepared when their turn comes."""
        parts = tuple(part for part in self.parts if part.supports(problem) is None)
        if not parts:
            self.check_supports(problem)
        return PreparedFallback(problem, self, parts, [parts[0].prepare(problem)])


@dataclass(frozen=True, eq=False)
class PreparedFallback:
    """The parts that take one problem, and those of them that have been prepared."""

    problem: ContactProblem
    fallback: Fallback = field(repr=False)
    parts: tuple[Solver, ...] = field(repr=False)
    prepared: list[Prepared] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Try the parts until one solves the problem; see ``Prepared.solve``. ``iterations`` counts those of all."""
        clock, used, ran = Clock(stop.max_seconds), 0, []
        best, lowest, is_late = None, np.inf, False
        for part, first, limit in self._tries(start, stop.max_iterations):
            if best is not None and clock.limit_met(stop, used) is not None:
                break
            limits = Stop(stop.tolerance, min(limit, stop.max_iterations - used), max(clock.left, 1e-9))
            found = self._part(part).solve(limits, first, self._shown(observe, clock, used))
            used += found.iterations
            origin = "zero" if first is None else "the start"
            ran.append(f"{self.parts[part].name} from {origin}: {found.status}")
            if found.status in (Status.SOLVED, Status.INFEASIBLE):
                return Solution(found.impulses, found.status, used, _message(ran, found))
            is_late = is_late or found.status is Status.TIME_LIMIT
            residual = self._residual(found)
            if best is None or residual < lowest:
                best, lowest = found, residual
        assert best is not None
        # a limit of the whole counts, whichever part is the best, and the limit of a part alone does not
        ended = clock.limit_met(stop, used) or (Status.TIME_LIMIT if is_late else found.status)
        return Solution(best.impulses, ended, used, _message(ran, best))

    def _tries(self, start: FloatArray | None, most: int) -> Iterator[tuple[int, FloatArray | None, int]]:
        """Yield the part, its first impulses (zero if None) and its limit of iterations for each try."""
        if start is not None and np.any(start):
            yield 0, start, self.fallback.warm_iterations
        last = len(self.parts) - 1
        for part in range(last):
            yield part, None, self.fallback.iterations
        yield last, None, most

    def _part(self, part: int) -> Prepared:
        while len(self.prepared) <= part:
            self.prepared.append(self.parts[len(self.prepared)].prepare(self.problem))
        return self.prepared[part]

    def _shown(self, observe: Observer | None, clock: Clock, before: int) -> Observer | None:
        """Return an observer of one try that counts the iterations of those before."""
        if observe is None or not self.fallback.has_iterates:
            return None
        return lambda iteration, impulses: clock.show(observe, before + iteration, impulses)

    def _residual(self, solution: Solution) -> float:
        """Return the judge's residual of the model that the parts solve."""
        model, problem = self.fallback.model, self.problem
        residual = Residual(problem) if model == Model.COULOMB else ModelResidual(problem, model)
        return judged(problem, residual, solution.impulses)


def _message(ran: list[str], last: Solution) -> str:
    return "; ".join([*ran, last.message] if last.message else ran)
