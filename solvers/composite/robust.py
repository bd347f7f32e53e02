"""Robust: sweeps while they are fast, and what is known to work where they are not.

Sweeps solve most problems of flowing contacts in less time than one factorisation takes. Where they are slow, Newton's
method often has what they lack, once they have found which contacts stick and slip; and interior points solve what
is left, redundant piles and stacks above all. So

    sweeps          while every window of them gains a digit
    Newton steps    a few from the last swept impulses
    InteriorNewton  interior points, their path, Newton's method, and sweeps with it to the end

A window is as many sweeps as take about a fifth of the time of an interior point method, measured from 2 to 2400
contacts. So what slow sweeps have wasted is little beside what follows, and a solve to 1e-8 that sweeps finish takes at
most about 1.6 times as long as the other would have. No decision depends on the tolerance, or on the clock but for its
limits.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ..interface import Observer, Prepared, Solution, Status, Stop
from ..iteration.loop import Advance, PreparedIteration, first_impulses, looked, refuted
from ..iteration.method import Method
from ..iteration.stopping import Monitor
from ..newton.linearised import Equations
from ..newton.steps import SEARCHING
from .attempts import Attempts
from .interior_newton import taken_in_turn
from .relay import Relay
from .sweeping import sweeps_for

WINDOW, WINDOW_A_CONTACT = 400, 3
"""Sweeps of a window: the first, and the second for each contact."""

FEW_STEPS = replace(SEARCHING, most_steps=8)
"""Newton steps from the last swept impulses, which know the states even where the residual has not fallen yet."""

OVER = (Status.SOLVED, Status.ITERATION_LIMIT, Status.TIME_LIMIT)
"""Ends of the sweeps that are the end of the solve."""


@dataclass(frozen=True)
class Robust(Method):
    """The solver to take first: fast where sweeps are, and exact where they are not.

    The message of a solution says which parts ran, and how each ended. One iteration is one of the part that runs.
    """

    def prepare(self, problem: ContactProblem) -> "PreparedRobust":
        """Prepare the sweeps; the others are prepared when their turn comes."""
        sweeps = sweeps_for(problem)
        return PreparedRobust(problem, sweeps.name, sweeps.prepare(problem))


@dataclass(frozen=True, eq=False)
class PreparedRobust:
    """The sweeps of one problem, and the further parts that have been prepared, by name."""

    problem: ContactProblem
    name: str
    sweeps: PreparedIteration
    prepared: dict[str, Prepared] = field(default_factory=dict, repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep as long as that is fast, then let the others take turns; see ``Prepared.solve``."""
        problem, residual = self.problem, self.sweeps.residual
        first = first_impulses(problem, residual, start)
        if residual.infeasible:
            return refuted(problem)
        monitor = Monitor(stop)
        advance = Advance(self.sweeps.begin(first), self.sweeps.begin, monitor, observe)
        window = Window(WINDOW + WINDOW_A_CONTACT * problem.n_contacts)
        while True:
            latest, present, ended = looked(problem, residual, advance)
            if ended is not None and ended[0] in OVER:
                return Solution(_best(monitor, first), ended[0], advance.iteration, _said(self.name, *ended))
            if ended is not None or window.is_lost(advance.iteration, monitor.best_residual):
                break
            advance.to_next_look()
        relay = Relay(problem, residual, self.prepared, stop, observe, monitor.clock, advance.iteration)
        relay.ran.append(f"{self.name}: {ended[0] if ended else 'slow'}")
        relay.best, relay.lowest = _best(monitor, first), monitor.best_residual
        return self._finished(relay, advance, latest, present)

    def _finished(self, relay: Relay, advance: Advance, latest: FloatArray, present: float) -> Solution:
        """Try Newton's method from Λ = ``latest`` of the residual ``present``, then let the others take turns."""
        assert relay.best is not None
        attempts = Attempts(self.problem, relay.residual, Equations(self.problem, relay.residual), advance)
        found, reached = attempts.tried(FEW_STEPS, latest, present)
        if reached < relay.lowest:
            relay.best, relay.lowest = found, reached
        relay.used = advance.iteration
        is_solved = relay.lowest <= relay.stop.tolerance
        relay.ran.append(f"Newton steps: {Status.SOLVED if is_solved else 'no further'}")
        if is_solved:
            return Solution(relay.best, Status.SOLVED, relay.used, "; ".join(relay.ran))
        limit = attempts.limit_met
        return relay.ended(limit, f"residual {relay.lowest:.1e}") if limit else taken_in_turn(relay, None)


class Window:
    """Whether sweeps gain a digit in every window of ``length`` of them."""

    def __init__(self, length: int) -> None:
        self._length, self._end, self._before = length, length, np.inf

    def is_lost(self, iteration: int, residual: float) -> bool:
        """Whether the window that ends with this many sweeps, of this best residual, has gained less than a digit."""
        if self._before == np.inf:
            self._before = residual
        if iteration < self._end:
            return False
        before, self._before, self._end = self._before, residual, iteration + self._length
        return residual > 0.1 * before


def _best(monitor: Monitor, first: FloatArray) -> FloatArray:
    return first if monitor.best_impulses is None else monitor.best_impulses


def _said(name: str, status: Status, reason: str) -> str:
    return f"{name}: {status}; {reason}" if reason else f"{name}: {status}"
