"""Starts of the solves of a case: zero, or the solver's own answer to the previous step.

A warm solver first solves the earlier steps in order, to the tolerance of the timed solves. As in a simulation, each
solve starts from the answer to the previous step. These solves are not timed, and run in processes that have not
received the problem. An answer that misses the tolerance is used as well.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Stop
from ....problems.exchange.sequences import start_digest, warm_start_impulses
from .control import Controls


class Starts:
    """The starts of one case.

    Attributes:
        steps: the earlier steps in order; empty for a start from zero.
        problem: the problem.
    """

    def __init__(self, steps: Sequence[ContactProblem], problem: ContactProblem, controls: Controls) -> None:
        """Initialise with the earlier steps, the problem, and the controls that solve the steps."""
        self.steps, self.problem, self._controls = steps, problem, controls
        self._by_tolerance: dict[float, FloatArray | None] = {}

    @cached_property
    def digest(self) -> str:
        """Digest of what determines the starts, from ``start_digest``; empty for starts from zero."""
        return start_digest(self.steps, self.problem)

    def impulses(self, stop: Stop) -> FloatArray | None:
        """Return the start [N s] of a solve with a stop criterion, shape (n_rows,); None for zero.

        Raises:
            Fault: if the solver gives no valid answer to an earlier step.
        """
        if stop.tolerance not in self._by_tolerance:
            start = None
            for step, following in pairwise([*self.steps, self.problem]):
                start = warm_start_impulses(step, self._controls.solve_once(step, stop, start), following)
            self._by_tolerance[stop.tolerance] = start
        return self._by_tolerance[stop.tolerance]
