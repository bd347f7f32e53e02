"""HybridNewton: sweeps, and Newton's method on the projection equations where these are slow.

Sweeps find quickly which contacts are open, stick and slip, but settle the impulses slowly where masses differ or many
contacts hang together; Newton's method does the reverse. So sweeps come first, and Newton's method is tried when they
are slow. What it finds is kept only where the judge's residual has fallen.

Newton's method converges from nearby alone, and sweeps of high friction may lead away for ever. Where they lead
nowhere, Newton's method is tried from other predictors (``restarts``), from the best iterate and from the first.

No decision depends on the tolerance: a solve to a tighter one begins with the same iterates, and ends no worse. None
depends on the speed of the machine either, but near the deadline, where no Newton step is begun that would not end in
time (``linear_solver``).
"""

from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.loop import Advance, first_impulses, looked, refuted
from ..iteration.method import Method
from ..iteration.stopping import Monitor
from ..newton.linearised import Equations
from ..newton.steps import DAMPED, SHARP, THOROUGH
from ..sweeps.delassus import DelassusIterates, DelassusSweep
from ..sweeps.safeguarded import SafeguardedIterates
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes
from .attempts import Attempts
from .restarts import Restarts

SWEEPS_BEFORE = 200
"""Sweeps before Newton's method is considered, and between two measurements of how fast they converge."""

SLOW = 500
"""Newton's method is tried where the sweeps take more than this for a digit: a few of its steps cost as much as a few
thousand sweeps, on ten contacts as on a thousand."""

IN_TURN = (SHARP, DAMPED, *THOROUGH)
"""What successive attempts try between sweeps."""

SUCCESS = 0.1
"""After an attempt that lowers the residual to this fraction the next follows at once; after others, sweeps do."""

STUCK = (Status.STALLED, Status.DIVERGED, Status.OSCILLATING)
"""Where sweeps lead nowhere, and other predictors may."""


@dataclass(frozen=True)
class HybridNewton(Method):
    """Safeguarded sweeps, with Newton's method on the projection equations Λ_i = prox(Λ_i − ξ_i/α_i) in between.

    One iteration is a sweep or a Newton step.

    Attributes:
        relaxation: ω of the sweeps, see ``SafeguardedSORprox``.

    Raises:
        SolverError: for an option out of range.
    """

    relaxation: float = 1.5

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    def prepare(self, problem: ContactProblem) -> "PreparedHybrid":
        """Assemble G, and the first step sizes of the sweeps."""
        residual = Residual(problem)
        sweep = DelassusSweep.over(problem, diagonal_step_sizes(problem, self.relaxation))
        return PreparedHybrid(problem, residual, sweep, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedHybrid:
    """Sweeps and Newton's equations of one problem."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    sweep: DelassusSweep = field(repr=False)
    equations: Equations = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep, and try Newton's method where that is slow; see ``Prepared.solve``."""
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return refuted(self.problem)
        monitor = Monitor(stop)
        iterates = self._begin(first)
        advance = Advance(iterates, self._begin, monitor, observe)
        attempts = Attempts(self.problem, self.residual, self.equations, advance)
        restarts = Restarts(attempts, self.sweep, first)
        pace, wait, tried = Pace(), SWEEPS_BEFORE, 0
        while True:
            impulses, residual, ended = looked(self.problem, self.residual, advance)
            if self._leads_nowhere(ended, monitor) and restarts.are_due:
                before = monitor.best_residual
                over = restarts.tried()
                advance.iterates = iterates
                if over is None and monitor.best_residual <= SUCCESS * before:
                    iterates.move_to(restarts.best)
                    pace = Pace()
                    continue
                ended = over or ended
            if ended is not None:
                return monitor.solution(ended, advance.iteration, self.problem.n_rows)
            if pace.sweeps >= wait and pace.sweeps_a_digit(residual) > SLOW:
                found, lowest = attempts.tried(IN_TURN[tried % len(IN_TURN)], impulses, residual)
                if lowest < residual:
                    iterates.move_to(found)
                if lowest > SUCCESS * residual:
                    tried, wait = tried + 1, 2 * wait
                    pace = Pace()
                continue
            count = advance.to_next_look()
            attempts.work.count_sweeps(count)
            pace.note(count, residual)

    def _begin(self, impulses: FloatArray) -> SafeguardedIterates:
        return SafeguardedIterates(DelassusIterates(self.sweep, impulses))

    def _leads_nowhere(self, ended: tuple[Status, str] | None, monitor: Monitor) -> bool:
        """Whether sweeps lead nowhere, and the best residual is more than rounding may leave."""
        is_stuck = monitor.lacks_progress if ended is None else ended[0] in STUCK
        if not is_stuck:
            return False
        best = monitor.best_impulses
        return best is None or monitor.best_residual > self.residual.rounding(best)


class Pace:
    """How fast sweeps converge; ``sweeps`` have been noted so far."""

    def __init__(self) -> None:
        self.sweeps = 0
        self._marks: list[tuple[int, float]] = []

    def note(self, count: int, residual: float) -> None:
        """Note that ``count`` sweeps began with ``residual``."""
        self._marks.append((self.sweeps, residual))
        self.sweeps += count

    def sweeps_a_digit(self, residual: float) -> float:
        """Return the sweeps to a tenth of the residual at the rate of the last ``SWEEPS_BEFORE`` or more."""
        earlier = [mark for mark in self._marks if mark[0] <= self.sweeps - SWEEPS_BEFORE]
        if not earlier or not residual < earlier[-1][1]:
            return np.inf
        since, before = earlier[-1]
        return float((self.sweeps - since) / np.log10(before / residual)) if residual > 0.0 else 0.0
