"""The seconds that the clock in a case's process counts, held against the processor time that the system counts."""

import timeit
from collections.abc import Sequence
from functools import lru_cache
from statistics import median

import numpy as np

from ....problems.contact.problem import ContactProblem

FACTOR = 2.0
"""What a process works may be this many times what is counted and what the harness does beside."""

HARNESS = 2.0
"""What the harness does beside a solve may be this many times what making a problem takes here."""

ALLOWANCE = 0.02
"""Processor time of all rounds together that need not be accounted for [s]."""


class ClockAccount:
    """What the rounds of a case have taken so far, by both clocks.

    Attributes:
        problem: of the case.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self._counted = self._worked = 0.0

    def fault(self, times: Sequence[tuple[float, float]], passed: float, worked: float) -> str | None:
        """Say that a process works more than its clock counts, or None.

        Processor time is the same on a busy machine; where several threads share the work it is more than what passes,
        and the lesser of both counts.

        Args:
            times: of a round, preparing and solving of each solve [s], as the process counted them.
            passed: wall time of the round, from outside [s].
            worked: processor time of the round, from outside [s].
        """
        self._counted += float(np.sum(times)) + len(times) * HARNESS * _fresh_seconds(self.problem)
        self._worked += min(passed, worked)
        if self._worked <= FACTOR * self._counted + ALLOWANCE:
            return None
        worked, counted = self._worked, self._counted
        return f"its process worked for {worked:.3g} s in rounds, of which its own clock explains {counted:.3g} s"


@lru_cache(maxsize=4)
def _fresh_seconds(problem: ContactProblem) -> float:
    """Return the time that making a fresh problem takes here [s], which is most of what is not charged."""
    return median(timeit.repeat(problem.fresh, number=1, repeat=5))
