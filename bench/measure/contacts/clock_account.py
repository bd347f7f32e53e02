"""Compare the clock in the process of a case with the processor time that the system counts.

N solves in n rounds take P seconds on the clock; the longer of the wall and processor time of each solve counts.
In addition, the harness creates a fresh problem for each solve, which takes about h seconds. This process measures h on
the same core. The process of a case may use the processor time

    W ≤ (1 + SHARE) P + HARNESS_FACTOR N h + n ROUND_SECONDS + ALLOWANCE_SECONDS

in the rounds that are not excluded. The excess is untimed work, unless a repeated measurement of h explains it: other
programs slow down the harness as well. A round with an excess is discarded and repeated; a second one
(``MAX_DOUBTED_ROUNDS``) proves misbehaviour.
"""

from time import process_time

import numpy as np

from ....problems.contact.problem import ContactProblem
from ..timed_round import TimedRound

SHARE = 0.05
"""Allowed untimed work relative to the time on the clock."""

HARNESS_FACTOR = 2.0
"""Allowed time of the harness per solve, relative to h."""

ROUND_SECONDS = 0.002
"""Processor time of a round to read and answer its request and to compare the process state [s]."""

ALLOWANCE_SECONDS = 0.005
"""Allowed untimed processor time of all rounds together [s]."""

MAX_CALIBRATIONS = 5
"""Largest number of measurements of the harness for a case."""


class ClockAccount:
    """The time of the rounds of a case, by the clock in its process and by the system.

    Attributes:
        problem: problem of the case.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self._calibrations = 0
        self._on_clock = self._processor_seconds = self._n_solves = self._n_rounds = self._harness = 0.0

    def fault(self, timed_round: TimedRound, processor_seconds: float) -> str | None:
        """Add a round, or return a clause if the process then worked more in all of them than its clock explains.

        Args:
            timed_round: a round that is not excluded.
            processor_seconds: processor time of the round, as the system counts it [s].
        """
        before = self._n_solves, self._n_rounds, self._on_clock, self._processor_seconds
        self._n_solves += len(timed_round.totals)
        self._n_rounds += 1
        self._on_clock += float(np.maximum(timed_round.walls, timed_round.processor).sum())
        self._processor_seconds += processor_seconds
        while self._processor_seconds > self._explained() and self._calibrations < MAX_CALIBRATIONS:
            self._calibrations += 1
            self._harness = max(self._harness, _harness_seconds(self.problem))
        if self._processor_seconds <= self._explained():
            return None
        text = (
            f"its process worked for {self._processor_seconds:.3g} s in rounds, of which its own clock explains "
            f"{self._explained():.3g} s"
        )
        self._n_solves, self._n_rounds, self._on_clock, self._processor_seconds = before
        return text

    def _explained(self) -> float:
        """Return the processor time W that the process may use [s]."""
        harness = HARNESS_FACTOR * self._n_solves * self._harness + self._n_rounds * ROUND_SECONDS
        return (1.0 + SHARE) * self._on_clock + harness + ALLOWANCE_SECONDS


def _harness_seconds(problem: ContactProblem) -> float:
    """Return the processor time to create a fresh problem and its digest [s]."""
    began = process_time()
    _ = problem.fresh().digest
    return process_time() - began
