"""Starts of the solves of a case: zero, or the solver's own answer to the step before.

A warm solver solves the steps that precede its problem in their order, each from its answer to the one before and to
the tolerance of the timed solves, as it does in a simulation. It does so off the clock, in processes that have not seen
the problem. An answer that misses the tolerance is a start like any other.
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
        steps: the steps before the problem, from the first on; none for a start from zero.
        problem: the problem.
    """

    def __init__(self, steps: Sequence[ContactProblem], problem: ContactProblem, controls: Controls) -> None:
        """Initialise with the earlier steps, the problem, and the process that solves the steps."""
        self.steps, self.problem, self._controls = steps, problem, controls
        self._known: dict[float, FloatArray | None] = {}

    @cached_property
    def digest(self) -> str:
        """Digest of what determines the starts, as ``start_digest``; empty for starts from zero."""
        return start_digest(self.steps, self.problem)

    def impulses(self, stop: Stop) -> FloatArray | None:
        """Return the start of a solve with a stop criterion [N s], shape (n_rows,); None for zero.

        Raises:
            Fault: if the solver has no valid answer to a step before.
        """
        if stop.tolerance not in self._known:
            start = None
            for step, following in pairwise([*self.steps, self.problem]):
                start = warm_start_impulses(step, self._controls.solve_once(step, stop, start), following)
            self._known[stop.tolerance] = start
        return self._known[stop.tolerance]
