"""The seconds that the clock in a case's process counts, held against the processor time that the system counts.

n rounds of N solves with processor seconds P work for P on the clock, and beside it for what the harness does: a
seconds a solve (make a fresh problem) and b seconds a round (check the process). Both are measured here, on the same
core, with a solver that does nothing. The process of a case may work for

    W ≤ (1 + SHARE) P + HARNESS_FACTOR (N a + n b) + n REQUEST_SECONDS + ALLOWANCE_SECONDS

in the rounds that are not excluded. What exceeds that is work off the clock, unless a and b, measured again, explain
it: other programs slow down the harness as well.
"""

import contextlib
from dataclasses import dataclass
from functools import lru_cache
from time import process_time

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.model import Model
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Observer, Solution, Status, Stop
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

IDLE_ROUNDS, IDLE_SOLVES = 5, 12
"""Rounds and solves that do nothing, of which the harness's work is the median."""

MAX_CALIBRATIONS = 5
"""Times that the harness's work is measured again for a case."""


class ClockAccount:
    """What the rounds of a case have taken so far, by both clocks.

    Attributes:
        problem: of the case.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self._again = self._solves = self._rounds = 0
        self._on_clock = self._worked = 0.0
        self._harness = (0.0, 0.0)

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
        self._harness = _larger(self._harness, _first_harness_seconds(self.problem))
        while self._worked > self._explained():
            if self._again == MAX_CALIBRATIONS:
                return (
                    f"its process worked for {self._worked:.3g} s in rounds, of which its own clock explains "
                    f"{self._explained():.3g} s"
                )
            self._again += 1
            self._harness = _larger(self._harness, _harness_seconds(self.problem))
        return None

    def _explained(self) -> float:
        a_solve, a_round = self._harness
        beside = HARNESS_FACTOR * (self._solves * a_solve + self._rounds * a_round) + self._rounds * REQUEST_SECONDS
        return (1.0 + SHARE) * self._on_clock + beside + ALLOWANCE_SECONDS


def _larger(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    return max(one[0], other[0]), max(one[1], other[1])


@lru_cache(maxsize=4)
def _first_harness_seconds(problem: ContactProblem) -> tuple[float, float]:
    return _harness_seconds(problem)


def _harness_seconds(problem: ContactProblem) -> tuple[float, float]:
    """Return the processor time that the harness works beside a solve, and beside a round [s]."""
    measurement = Measurement(problem, _Idle())
    alone, long = (
        float(np.median([_idle_seconds(measurement, count) for _ in range(IDLE_ROUNDS)])) for count in (1, IDLE_SOLVES)
    )
    a_solve = max(long - alone, 0.0) / (IDLE_SOLVES - 1)
    return a_solve, max(alone - a_solve, 0.0)


def _idle_seconds(measurement: Measurement, count: int) -> float:
    """Return the processor time of a round of solves that do nothing [s]."""
    began = process_time()
    with contextlib.suppress(MisbehaviourError):  # other threads of this process may change it meanwhile
        measurement.round(Stop(), 0.0, count)
    return process_time() - began


@dataclass
class _Idle:
    """A solver that does nothing."""

    name = "Idle"
    model = Model.COULOMB
    has_iterates = False
    problem: ContactProblem | None = None

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> "_Idle":
        return _Idle(problem)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        n_rows = 0 if self.problem is None else self.problem.n_rows
        return Solution(np.zeros(n_rows), Status.SOLVED, 0)
