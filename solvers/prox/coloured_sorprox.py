"""ColouredSORprox: SORprox over slabs of contacts in two colours, so that several threads can share a sweep.

The slabs of one colour share no movable body; see ``parallel.slabs`` and ``parallel.coloured_sweep``.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Prepared, Solution, Stop
from ..iteration.loop import PreparedIteration
from ..iteration.method import SLIDING, Method
from ..iteration.momentum import Momentum, begin_with_momentum, check_momentum
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes
from .parallel.coloured_sweep import ColouredIterates, ColouredSweep
from .parallel.pairs import unsupported_reason
from .parallel.team import check_threads


@dataclass(frozen=True)
class PreparedWithFewerThreads:
    """A projected iteration in which the requested threads would save little time.

    Attributes:
        iteration: the iteration.
        requested: number of threads that the options of the solver request.
        threads: number of threads that sweep.
    """

    iteration: PreparedIteration
    requested: int
    threads: int

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep until the residual reaches the tolerance; the message gives the number of threads."""
        solution = self.iteration.solve(stop, start, observe)
        threads = f"{self.threads} of {self.requested} threads used, because more would save little time"
        return replace(solution, message="; ".join(filter(None, [solution.message, threads])))


@dataclass(frozen=True)
class ColouredSORprox(Method):
    """Projected Gauss–Seidel over the factors, by slabs in two colours, for contacts of one or two bodies.

    The impulses are identical for any number of threads.

    Attributes:
        relaxation: ω, as in ``SORprox``.
        momentum: β, the fraction of the last change that is added before each sweep, as in ``SORprox``.
        momentum_delay: d; after k sweeps, β is at most k/(k + d), as in ``SORprox``.
        threads: number of threads, at most the number of cores that the process may use. Fewer are used, and the
            message says so, if there are fewer than 2000 contacts per thread, or if few slabs hold most contacts.

    Raises:
        SolverError: if an option is out of range.
    """

    relaxation: float = 1.0
    momentum: Momentum = 0.0
    momentum_delay: float = 0.0
    threads: int = 1

    law_kinds: ClassVar[frozenset[int]] = SLIDING

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)
        check_momentum(self.momentum, self.momentum_delay)
        check_threads(self.threads)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or unsupported_reason(problem)

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Divide the contacts into slabs, and assemble the data of the batches."""
        self.check_supports(problem)
        sweep = ColouredSweep.over(problem, diagonal_step_sizes(problem, self.relaxation), self.threads)
        begin = begin_with_momentum(partial(ColouredIterates, sweep), self.momentum, self.momentum_delay)
        iteration = PreparedIteration(problem, Residual(problem), begin)
        if sweep.threads < self.threads:
            return PreparedWithFewerThreads(iteration, self.threads, int(sweep.threads))
        return iteration
