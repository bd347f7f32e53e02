"""Robust: sweeps while they are fast, and what is known to work where they are not.

Sweeps solve most problems of flowing contacts in less time than one factorisation takes. Where they are slow, Newton's
method often has what they lack, once they have found which contacts stick and slip; and interior points solve what
is left, redundant piles and stacks above all. So

    sweeps          while every window of them gains a digit
    Newton steps    a few from the last swept impulses
    InteriorNewton  interior points, their path, Newton's method, and sweeps with it to the end

A window is as many sweeps as take about a fifth of the time of an interior point method, measured from 2 to 2400
contacts. So what slow sweeps have wasted is little beside what follows, and a solve to 1e-8 that sweeps finish takes at
most about 1.6 times as long as the other would have. On few rows Newton steps take no longer than a hundred sweeps,
and where there are joints, of which an impulse passes one a sweep, they lead further: there they are tried after a
first short window too, and sweeps go on where they are of no use. No decision depends on the tolerance, or on the clock
but for its limits.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ..interface import Observer, Prepared, Solution, Status, Stop
from ..iteration.loop import Advance, PreparedIteration, first_impulses, looked, refuted
from ..iteration.method import Method
from ..iteration.stopping import Monitor
from ..newton.linearised import DENSE, Equations
from ..newton.steps import SEARCHING
from .attempts import Attempts
from .interior_newton import taken_in_turn
from .relay import Relay
from .sweeping import sweeps_for

WINDOW, WINDOW_A_CONTACT = 400, 3
"""Sweeps of a window: the first, and the second for each contact."""

SHORT_WINDOW = 90
"""Sweeps of the first window where the systems of Newton steps are dense or there are joints."""

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
        relay = Relay(problem, residual, self.prepared, stop, observe, monitor.clock)
        attempts: Attempts | None = None
        for length in _windows(problem):
            latest, present, ended = self._swept(advance, length)
            relay.best, relay.lowest, relay.used = _best(monitor, first), monitor.best_residual, advance.iteration
            if ended is not None and ended[0] in OVER:
                return relay.ended(ended[0], *self._said(*ended))
            relay.ran.append(f"{self.name}: {ended[0] if ended else 'slow'}")
            attempts = attempts or Attempts(problem, residual, Equations(problem, residual), advance)
            over = _stepped(relay, attempts, latest, present)
            if over is not None:
                return over
            if ended is not None:
                break
        return taken_in_turn(relay, None)

    def _swept(self, advance: Advance, length: int) -> tuple[FloatArray, float, tuple[Status, str] | None]:
        """Sweep while each ``length`` of sweeps gains a digit; return Λ, its residual, and how sweeps ended, if so."""
        window = Window(length, advance.iteration)
        while True:
            latest, present, ended = looked(self.problem, self.sweeps.residual, advance)
            if ended is not None or window.is_lost(advance.iteration, advance.monitor.best_residual):
                return latest, present, ended
            advance.to_next_look()

    def _said(self, status: Status, reason: str) -> list[str]:
        return [f"{self.name}: {status}", *([reason] if reason else [])]


class Window:
    """Whether sweeps gain a digit in every window of ``length`` of them, the first from the sweep ``begin`` on."""

    def __init__(self, length: int, begin: int = 0) -> None:
        self._length, self._end, self._before = length, begin + length, np.inf

    def is_lost(self, iteration: int, residual: float) -> bool:
        """Whether the window that ends with this many sweeps, of this best residual, has gained less than a digit."""
        if self._before == np.inf:
            self._before = residual
        if iteration < self._end:
            return False
        before, self._before, self._end = self._before, residual, iteration + self._length
        return residual > 0.1 * before


def _windows(problem: ContactProblem) -> list[int]:
    """Return the lengths of windows, after each of which Newton steps are tried."""
    whole = WINDOW + WINDOW_A_CONTACT * problem.n_contacts
    is_short = problem.n_rows <= DENSE or problem.laws.is_bilateral.any()
    return [SHORT_WINDOW, whole] if is_short else [whole]


def _stepped(relay: Relay, attempts: Attempts, latest: FloatArray, present: float) -> Solution | None:
    """Try Newton's method from Λ = ``latest`` of the residual ``present``; return the solution if that is the end."""
    found, reached = attempts.tried(FEW_STEPS, latest, present)
    relay.keep(found, reached)
    relay.used = attempts.advance.iteration
    is_solved = relay.lowest <= relay.stop.tolerance
    relay.ran.append(f"Newton steps: {Status.SOLVED if is_solved else 'no further'}")
    if is_solved:
        return relay.ended(Status.SOLVED)
    limit = attempts.limit_met
    return relay.ended(limit, f"residual {relay.lowest:.1e}") if limit else None


def _best(monitor: Monitor, first: FloatArray) -> FloatArray:
    return first if monitor.best_impulses is None else monitor.best_impulses
