"""Fallback: several solvers in sequence, until one solves the problem.

A problem can be hard for one method or start, and easy for another. The impulses of the last time step may lead to a
plateau of the residual that a start at zero avoids. Sweeps with one relaxation factor may oscillate about a solution
that another factor reaches. The first solver runs from the given impulses, unless they are zero. Then all solvers run
from zero.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual, residual_under
from ...problems.contact.solver import (
    Observer,
    Prepared,
    Solution,
    Solver,
    SolverError,
    Stop,
    check_stop,
    shows_iterates,
    threads_of,
)
from ..iteration.loop import PreparedIteration
from ..iteration.method import Method, check_option
from ..iteration.stopping import Clock
from ..prox.sorprox import SORprox
from .robust import Robust
from .sequence import SolverRun, SolverSequence
from .sweep_selection import FAST_MOMENTUM, FAST_RELAXATION

WARM_ITERATIONS = 500
"""Default of ``warm_iterations``. In flow, the impulses of the last step are as good a start as zero. In a pile at
rest, they are either close to a solution or do not lead to one."""

ITERATIONS = 2000
"""Default of ``iterations``. It suffices for most problems that sweeps solve."""

MOMENTUM_PARTS = ((FAST_RELAXATION, FAST_MOMENTUM), (1.0, 0.97), (1.2, 0.985), (1.0, 0.985))
"""Relaxation and momentum of the parts of ``MomentumFallback``. Momentum that follows the measured rate of convergence
is fastest on hundreds of contacts or more. A constant momentum close to 1 solves most of the rare steps of a settling
pile on which measured momentum reaches a plateau."""


@dataclass(frozen=True, init=False)
class Fallback(Method):
    """Solvers in sequence: ``Fallback(SORprox(relaxation=1.5), NSGS)``.

    The limits of a solve apply to all parts together. The result is the first solution or, without one, the impulses
    with the lowest residual of all parts. The message lists the parts that ran and the outcome of each.

    Attributes:
        parts: the solvers, all of the same model; parts that do not support a problem are skipped.
        warm_iterations: iteration limit of the first part from a nonzero start; without one, this run is omitted.
        iterations: iteration limit of each run from zero; the last part has no separate limit.

    Raises:
        SolverError: if there are no parts, a part is not a solver, the parts have different models, or an option is out
            of range.
    """

    parts: tuple[Solver, ...]
    warm_iterations: int
    iterations: int

    def __init__(self, *parts: Solver, warm_iterations: int = WARM_ITERATIONS, iterations: int = ITERATIONS) -> None:
        if not parts:
            raise SolverError("Fallback has no parts; name one or more solvers: Fallback(SORprox, NSGS).")
        for part in parts:
            if not callable(getattr(part, "prepare", None)):
                raise SolverError(f"the parts of a Fallback must be solvers such as create('SORprox'), got {part!r}.")
        other = next((solver for solver in parts if solver.model != parts[0].model), None)
        if other is not None:
            raise SolverError(
                f"the parts of a Fallback must solve the same model; {parts[0].name} solves {parts[0].model}, "
                f"and {other.name} {other.model}."
            )
        for option, value in (("warm_iterations", warm_iterations), ("iterations", iterations)):
            check_option(option, value, type(value) is int and value >= 1, "a whole number, 1 or more")
            object.__setattr__(self, option, value)
        object.__setattr__(self, "parts", parts)

    @property
    def name(self) -> str:
        """Class name with the names of the parts and the options that differ from the defaults."""
        options = (("warm_iterations", WARM_ITERATIONS), ("iterations", ITERATIONS))
        changed = [f"{key}={getattr(self, key)}" for key, default in options if getattr(self, key) != default]
        return f"{type(self).__name__}({', '.join([*(solver.name for solver in self.parts), *changed])})"

    @property
    def model(self) -> Model:
        """The model of the parts."""
        return self.parts[0].model

    @property
    def has_iterates(self) -> bool:
        """Whether every part passes its iterates to the observer."""
        return all(map(shows_iterates, self.parts))

    @property
    def threads(self) -> int:
        """The largest number of threads that a part uses."""
        return max(map(threads_of, self.parts))

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why no part can solve ``problem``, or None."""
        reasons = []
        for solver in self.parts:
            reason = solver.supports(problem)
            if reason is None:
                return None
            reasons.append(reason)
        if len(reasons) == 1:
            return reasons[0]
        return "; ".join(f"{solver.name}: {reason}" for solver, reason in zip(self.parts, reasons, strict=True))

    def prepare(self, problem: ContactProblem) -> "PreparedFallback":
        """Prepare the first part that supports the problem; other parts are prepared when they first run."""
        parts = tuple(solver for solver in self.parts if solver.supports(problem) is None)
        if not parts:
            self.check_supports(problem)
        return PreparedFallback(problem, self, parts, {parts[0].name: parts[0].prepare(problem)})


@dataclass(frozen=True, eq=False)
class PreparedFallback:
    """The parts that support one problem, and the prepared parts by name."""

    problem: ContactProblem
    fallback: Fallback = field(repr=False)
    parts: tuple[Solver, ...] = field(repr=False)
    prepared: dict[str, Prepared] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Run the parts until one solves the problem; see ``Prepared.solve``. ``iterations`` counts all parts."""
        check_stop(stop)
        observe = observe if self.fallback.has_iterates else None
        clock = Clock(stop.max_seconds)
        sequence = SolverSequence(self.problem, self._residual(), self.prepared, stop, observe, clock)
        for run in self._runs(sequence, start):
            solution = sequence.run(run)
            if solution is not None:
                return solution
        return sequence.finish(sequence.status)

    def _residual(self) -> Residual:
        """Return the residual of the first part, or a new one if that part has none."""
        model, first = self.fallback.model, self.prepared[self.parts[0].name]
        if isinstance(first, PreparedIteration):
            return first.residual
        return residual_under(self.problem, model)

    def _runs(self, sequence: SolverSequence, start: FloatArray | None) -> Iterator[SolverRun]:
        """Yield the run of the first part from the start, then those of all parts from zero."""
        first = self.parts[0]
        if start is not None and np.any(start):
            name = f"{first.name} from the start"
            yield SolverRun(name, sequence.prepare(first), start, self.fallback.warm_iterations)
        for number, solver in enumerate(self.parts, 1):
            limit = sequence.stop.max_iterations if number == len(self.parts) else self.fallback.iterations
            yield SolverRun(f"{solver.name} from zero", sequence.prepare(solver), None, limit)


@dataclass(frozen=True, init=False)
class MomentumFallback(Fallback):
    """A preset of ``Fallback``: SORprox with the momentum "measured", 0.97, 0.985 and 0.985, then ``Robust``.

    The sweeps use the factors. On problems without factors, only ``Robust`` runs. This is the default of
    ``proxbench simulate`` for scenes with many contacts.
    """

    def __init__(self) -> None:
        sweeps = (SORprox(relaxation=omega, form="factors", momentum=beta) for omega, beta in MOMENTUM_PARTS)
        super().__init__(*sweeps, Robust())

    @property
    def name(self) -> str:
        """Class name."""
        return type(self).__name__
