"""A sequence ends as its last solver did, unless an earlier one lacked time for its next step."""

from dataclasses import dataclass

import numpy as np
import pytest
from proxbench.problems import ContactProblem
from proxbench.problems.contact.residual import Residual
from proxbench.solvers import Model, Solution, Status, Stop
from proxbench.solvers.composite.sequence import SolverSequence
from proxbench.solvers.iteration.stopping import Clock

ONE = ContactProblem.from_delassus([[1.0]], [-1.0], dim=1)


@dataclass(frozen=True)
class Scripted:
    """Returns zero with a given status."""

    name: str
    status: Status

    model = Model.COULOMB
    has_iterates = True

    def supports(self, problem: ContactProblem) -> None:
        return None

    def prepare(self, problem: ContactProblem) -> "Scripted":
        return self

    def solve(self, stop: Stop, start: np.ndarray | None = None, observe: object = None) -> Solution:
        return Solution(np.zeros(1), self.status, 1)


@pytest.mark.parametrize(
    ("ends", "status"),
    [
        ((Status.STALLED, Status.OSCILLATING), Status.OSCILLATING),
        ((Status.ITERATION_LIMIT, Status.STALLED), Status.STALLED),
        ((Status.TIME_LIMIT, Status.STALLED), Status.TIME_LIMIT),
        ((Status.TIME_LIMIT, Status.DIVERGED, Status.STALLED), Status.TIME_LIMIT),
    ],
)
def test_the_status_is_that_of_the_last_run_or_a_time_limit(ends: tuple[Status, ...], status: Status) -> None:
    stop = Stop(1e-8)
    sequence = SolverSequence(ONE, Residual(ONE), {}, stop, None, Clock(stop.max_seconds))
    for number, end in enumerate(ends):
        assert sequence.run(sequence.plan(Scripted(f"part {number}", end), None, 10)) is None
    assert sequence.finish(sequence.status).status is status
