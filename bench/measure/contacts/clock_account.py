"""The seconds that the clock in a case's process counts, compared with the processor time that the system counts.

N solves in n rounds with processor seconds P work for P on the clock, and beside each of them for what the harness
does: h seconds, measured here on the same core with a solver that does nothing. The process of a case may work for

    W ≤ (1 + SHARE) P + HARNESS_FACTOR N h + n REQUEST_SECONDS + ALLOWANCE_SECONDS

in the rounds that are not excluded. What exceeds that is work off the clock, unless h, measured again, explains it:
other programs slow down the harness as well.
"""

import contextlib
from dataclasses import dataclass
from time import process_time

import numpy as np

from ....problems.contact.model import Model
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Solution, Status, Stop
from ...isolation.child import MisbehaviourError
from .protocol import Measurement
from .timed_round import TimedRound

SHARE = 0.05
"""Share of the time on the clock that may be worked beside it."""

HARNESS_FACTOR = 1.5
"""What the harness does in a case's process may be this many times what it does here."""

REQUEST_SECONDS = 0.001
"""Processor time of a round in which its request is read and answered [s]."""

ALLOWANCE_SECONDS = 0.005
"""Processor time of all rounds together that need not be accounted for [s]."""

IDLE_ROUNDS, MAX_IDLE_SOLVES = 3, 100
"""Rounds, and their solves at most, that do nothing; the harness's work is the median of the rounds."""

MAX_CALIBRATIONS = 5
"""Times that the harness's work is measured for a case."""


class ClockAccount:
    """What the rounds of a case have taken so far, by both clocks.

    Attributes:
        problem: of the case.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self._calibrations = self._solves = self._rounds = 0
        self._on_clock = self._worked = self._harness = 0.0

    def fault(self, timed: TimedRound, worked: float) -> str | None:
        """Return a sentence if the process works more than its clock explains, else None.

        Args:
            timed: a round that is not excluded.
            worked: processor time of the round, from outside [s].
        """
        self._solves += len(timed.totals)
        self._rounds += 1
        self._on_clock += float(np.maximum(timed.totals, timed.processor).sum())
        self._worked += worked
        while self._worked > self._explained():
            if self._calibrations == MAX_CALIBRATIONS:
                return (
                    f"its process worked for {self._worked:.3g} s in rounds, of which its own clock explains "
                    f"{self._explained():.3g} s"
                )
            self._calibrations += 1
            self._harness = max(self._harness, _harness_seconds(self.problem, self._solves // self._rounds))
        return None

    def _explained(self) -> float:
        beside = HARNESS_FACTOR * self._solves * self._harness + self._rounds * REQUEST_SECONDS
        return (1.0 + SHARE) * self._on_clock + beside + ALLOWANCE_SECONDS


def _harness_seconds(problem: ContactProblem, n_solves: int) -> float:
    """Return the processor time that the harness works beside each of ``n_solves`` solves of a round [s]."""
    measurement, count = Measurement(problem, _Idle()), min(n_solves, MAX_IDLE_SOLVES)
    seconds = []
    for _ in range(IDLE_ROUNDS):
        began = process_time()
        with contextlib.suppress(MisbehaviourError):  # other threads of this process may change it meanwhile
            measurement.round(Stop(), 0.0, count)
        seconds.append(process_time() - began)
    return float(np.median(seconds)) / count


@dataclass
class _Idle:
    """A solver that does nothing."""

    name = "Idle"
    model = Model.COULOMB
    n_rows: int = 0

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> "_Idle":
        return _Idle(problem.n_rows)

    def solve(self, stop: Stop, start: object = None, observe: object = None) -> Solution:
        return Solution(np.zeros(self.n_rows), Status.SOLVED, 0)
