"""Robust: sweeps while they are fast, and what is known to work where they are not.

Sweeps solve most problems of flowing contacts in less time than one factorisation takes. Where they are slow, Newton's
method often has what they lack, once they have found which contacts stick and slip; and interior points solve what
is left, redundant piles and stacks above all. So

    sweeps          while every window of them gains a digit
    mixed sweeps    for a tenth of a window, and while each gains a digit
    Newton steps    a few from the last swept impulses
    InteriorNewton  interior points, their path, Newton's method, and sweeps with it to the end

A window is as many sweeps as take about a fifth of the time of an interior point method, measured from 2 to 2400
contacts. So what slow sweeps have wasted is little beside what follows, and a solve to 1e-8 that sweeps finish takes at
most about 1.6 times as long as the other would have. Mixing often gains in a few sweeps what momentum does not in all
of them. On few rows Newton steps take no longer than a hundred sweeps, and where there are joints, of which an impulse
passes one a sweep, they lead further: there they are tried after a first short window too, and sweeps go on where they
are of no use. No decision depends on the tolerance, or on the clock but for its limits.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Observer, Prepared, Solution, Status, Stop
from ..iteration.loop import Advance, PreparedIteration, first_impulses, looked, refuted
from ..iteration.method import Method
from ..iteration.stopping import Monitor
from ..newton.linearised import DENSE, Equations
from ..newton.steps import SEARCHING
from ..prox.anderson_sorprox import AndersonSORprox
from .attempts import Attempts
from .interior_newton import taken_in_turn
from .relay import Relay
from .sweeping import may_mix, sweeps_between_looks, sweeps_for

WINDOW, WINDOW_A_CONTACT = 400, 3
"""Sweeps of a window: the first, and the second for each contact."""

SHORT_WINDOW = 90
"""Sweeps of the first window where the systems of Newton steps are dense or there are joints."""

MIXED, MIXED_PART = AndersonSORprox(), 10
"""The sweeps that go on where the others are slow, and what part of their window is one of these."""

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
        return PreparedRobust(problem, sweeps.name, sweeps.prepare(problem), sweeps_between_looks(problem, sweeps))


@dataclass(frozen=True, eq=False)
class PreparedRobust:
    """The sweeps of one problem, how many come between looks, and the further parts that are prepared, by name."""

    problem: ContactProblem
    name: str
    sweeps: PreparedIteration = field(repr=False)
    between_looks: int = 1
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
        equations: Equations | None = None
        windows = _windows(problem)
        for length in windows:
            swept = _swept(relay, advance, self.name, length, first, self.between_looks)
            is_last = swept.has_ended or length == windows[-1]
            if swept.over is None and is_last and may_mix(problem):
                mixed = MIXED.prepare(problem)
                advance = Advance(mixed.begin(swept.best.copy()), mixed.begin, monitor, observe, relay.used)
                swept = _swept(relay, advance, MIXED.name, windows[-1] // MIXED_PART, first)
            if swept.over is not None:
                return swept.over
            equations = equations or Equations(problem, residual)
            over = _stepped(relay, Attempts(problem, residual, equations, advance), swept.latest, swept.present)
            if over is not None:
                return over
            if is_last:
                break
        return taken_in_turn(relay, None)


@dataclass(frozen=True)
class Swept:
    """Where sweeps have come to.

    Attributes:
        best: the best Λ so far [N s], shape (n_rows,).
        latest: the last Λ [N s], shape (n_rows,).
        present: its residual.
        has_ended: whether they go no further.
        over: the solution where that is the end of the solve.
    """

    best: FloatArray
    latest: FloatArray
    present: float
    has_ended: bool
    over: Solution | None


def _swept(relay: Relay, advance: Advance, name: str, length: int, first: FloatArray, least: int = 1) -> Swept:
    """Sweep while each ``length`` of sweeps gains a digit; ``first`` is the best Λ where none has a finite residual.

    The residual is looked at after ``least`` sweeps or more.
    """
    window, monitor = Window(length, advance.iteration), advance.monitor
    while True:
        latest, present, ended = looked(relay.problem, relay.residual, advance)
        if ended is not None or window.is_lost(advance.iteration, monitor.best_residual):
            break
        advance.to_next_look(least)
    best, over = first if monitor.best_impulses is None else monitor.best_impulses, None
    relay.used, relay.best, relay.lowest = advance.iteration, best, monitor.best_residual
    if ended is not None and ended[0] in OVER:
        over = relay.ended(ended[0], f"{name}: {ended[0]}", *([ended[1]] if ended[1] else []))
    relay.ran.append(f"{name}: {ended[0] if ended else 'slow'}")
    return Swept(best, latest, present, ended is not None, over)


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
