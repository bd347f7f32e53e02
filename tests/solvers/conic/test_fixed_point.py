"""The outer iteration tells truly why it ended, whatever the conic solver inside does."""

import numpy as np
import pytest
from proxbench.problems import load
from proxbench.problems.judge import Residual
from proxbench.solvers import Status, Stop, create
from proxbench.solvers.conic.fixed_point import PreparedFixedPoint
from proxbench.solvers.conic.programs import ConicResult, Ended

PROBLEM = load("hard-counterexample")


class EndsWith:
    """A conic solver that returns the same impulses every time and says the same of it."""

    def __init__(self, ended: Ended, impulse: float) -> None:
        self.result = ConicResult(np.full(PROBLEM.n_rows, impulse), 1, 0.0, ended)

    def run(self, shift: np.ndarray, accuracy: float, iterations: int, seconds: float) -> ConicResult:
        return self.result


@pytest.mark.parametrize("impulse", [0.01, np.nan], ids=["finite", "nothing"])
@pytest.mark.parametrize(
    ("ended", "status"), [(Ended.TIME_LIMIT, Status.TIME_LIMIT), (Ended.GAVE_UP, Status.STALLED)], ids=str
)
def test_no_time_left_for_the_conic_solver_is_a_time_limit_and_no_stall(
    ended: Ended, status: Status, impulse: float
) -> None:
    prepared = PreparedFixedPoint(PROBLEM, Residual(PROBLEM), EndsWith(ended, impulse), memory=5)
    solution = prepared.solve(Stop(1e-8, 1000, 60.0))
    assert solution.status is status
    assert np.isfinite(solution.impulses).all()


@pytest.mark.parametrize("name", ["ClarabelCoulomb", "CvxpyCoulomb"])
def test_a_limit_of_outer_iterations_leaves_the_cone_programs_as_they_are(name: str) -> None:
    """The first iterates do not depend on how many are allowed."""
    prepared = create(name).prepare(load("funnel-30-early"))
    few: list[np.ndarray] = []
    many: list[np.ndarray] = []
    prepared.solve(Stop(1e-8, 2, 60.0), observe=lambda iteration, impulses: few.append(impulses))
    prepared.solve(Stop(1e-8, 1000, 60.0), observe=lambda iteration, impulses: many.append(impulses))
    assert len(few) == 2
    assert np.array_equal(few, many[:2])
