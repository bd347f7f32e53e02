"""SemismoothNewton: Newton's method on the projection equations, led near the solution by safeguarded sweeps.

Sweeps find quickly which contacts are open, stick and slip, but settle the impulses slowly where masses differ or many
contacts hang together; Newton's method does the reverse. So sweeps come first, and Newton's method is tried when they
promise to take long. What it finds is kept only where the judge's residual has fallen.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...problems.contact import ContactProblem
from ...problems.judge import Residual
from ...problems.laws import FloatArray
from ...problems.model import Model
from ..interface import Observer, Solution, Status, Stop, described
from ..prox.delassus_sweep import DelassusSweep
from ..prox.iteration import Advance, confirmed, first_impulses
from ..prox.monitor import Monitor, sweeps_to_next_look
from ..prox.safeguarded import SafeguardedIterates
from ..prox.step_size import check_relaxation, diagonal_step_sizes
from .linearised import Equations
from .steps import DAMPINGS, newton_steps

SWEEPS_BEFORE = 200
"""Sweeps before Newton's method is thought of, and between two measurements of how fast they converge."""

WORTH = 3000
"""Newton's method is tried where the sweeps left, at their present rate, are more than this: a few of its steps cost
as much, on ten contacts as on a thousand."""

SUCCESS = 0.1
"""After an attempt that lowers the residual to this fraction the next follows at once; after others, sweeps do."""


@dataclass(frozen=True)
class SemismoothNewton:
    """Newton's method on the projection equations Λ_i = prox(Λ_i − ξ_i/α_i), with safeguarded sweeps in between.

    One iteration is a sweep or a Newton step.

    Attributes:
        relaxation: ω of the sweeps, see ``SafeguardedSORprox``.

    Raises:
        SolverError: for an option out of range.
    """

    relaxation: float = 1.5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> "PreparedNewton":
        """Assemble G, and the first step sizes of the sweeps."""
        residual = Residual(problem)
        sizes = diagonal_step_sizes(problem, self.relaxation)
        sweep = DelassusSweep.over(problem, problem.delassus_blocks(), sizes)
        return PreparedNewton(problem, residual, sweep, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedNewton:
    """Sweeps and Newton's equations of one problem."""

    problem: ContactProblem
    residual: Residual
    sweep: DelassusSweep
    equations: Equations

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep, and try Newton's method where that promises to be faster; see ``Prepared.solve``."""
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return Solution(first, Status.INFEASIBLE, 0, "a unilateral law has G_ii = 0 and c_i < 0")
        monitor = Monitor(stop)
        iterates = SafeguardedIterates(self.sweep, first)
        advance = Advance(iterates, monitor, observe)
        pace, wait, attempts = Pace(stop.tolerance), SWEEPS_BEFORE, 0
        while True:
            impulses = iterates.impulses()
            residual = self.residual(impulses, iterates.relative_velocity())
            if residual <= stop.tolerance:
                residual = confirmed(self.problem, self.residual, impulses, residual, stop.tolerance)
            ended = monitor.look(advance.iteration, residual, impulses)
            if ended is not None:
                return monitor.solution(ended, advance.iteration, self.problem.n_rows)
            if pace.sweeps >= wait and pace.sweeps_left(residual) > WORTH:
                damping = DAMPINGS[attempts % len(DAMPINGS)]
                found, lowest = newton_steps(self.equations, self._judged, impulses, residual, damping, stop, advance)
                if lowest < residual:
                    iterates.move_to(found)
                if lowest > SUCCESS * residual:
                    attempts, wait = attempts + 1, 2 * wait
                    pace = Pace(stop.tolerance)
                continue
            count = min(stop.max_iterations - advance.iteration, sweeps_to_next_look(advance.iteration))
            advance.by(count)
            pace.note(count, residual)

    def _judged(self, impulses: FloatArray) -> float:
        return self.residual(impulses, self.problem.relative_velocity(impulses))


class Pace:
    """How fast sweeps converge.

    Attributes:
        sweeps: sweeps noted so far.
    """

    def __init__(self, tolerance: float) -> None:
        self.sweeps = 0
        self._tolerance = tolerance
        self._marks: list[tuple[int, float]] = []

    def note(self, count: int, residual: float) -> None:
        """Note that ``count`` sweeps began with ``residual``."""
        self._marks.append((self.sweeps, residual))
        self.sweeps += count

    def sweeps_left(self, residual: float) -> float:
        """Return the sweeps to the tolerance at the rate of the last ``SWEEPS_BEFORE`` sweeps or more, inf for none."""
        earlier = [mark for mark in self._marks if mark[0] <= self.sweeps - SWEEPS_BEFORE]
        if not earlier or not residual < earlier[-1][1]:
            return np.inf
        since, before = earlier[-1]
        return float((self.sweeps - since) * np.log(residual / self._tolerance) / np.log(before / residual))
