"""A solve in rounds ends by the judge's residual, not by the claim of an external solver."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge
from proxbench.problems.arrays import FloatArray
from proxbench.solvers import Status, Stop, create
from proxbench.solvers.peers.rounds import Call, PreparedRounds, Round

PROBLEM = ContactProblem.from_delassus(np.eye(3), (-1.0, 0.1, 0.0), 0.3)
ANSWER = create("NSGS").prepare(PROBLEM).solve(Stop(1e-14)).impulses


class Outside(PreparedRounds):
    """A solver with the error ``error(iterations done, own tolerance)``, from which its claims follow."""

    def __init__(self, error: Callable[[int, float], float], claims: bool, seconds: float = 0.0) -> None:
        super().__init__(PROBLEM)
        self.error, self.claims, self.seconds, self.asked = error, claims, seconds, list[tuple[float, int]]()

    def begin(self, max_seconds: float) -> Call:
        def call(impulses: FloatArray, tolerance: float, iterations: int) -> Round:
            self.asked.append((tolerance, iterations))
            time.sleep(self.seconds * iterations)
            done = sum(count for _, count in self.asked)
            return Round(ANSWER * (1.0 + self.error(done, tolerance)), iterations, self.claims)

        return call


def test_a_wrong_claim_tightens_the_next_tolerance() -> None:
    outside = Outside(lambda done, tolerance: 1000.0 * tolerance, claims=True)
    solution = outside.solve(Stop(1e-4))
    assert solution.status is Status.SOLVED
    assert judge(PROBLEM, solution.impulses).residual <= 1e-4
    assert [tolerance for tolerance, _ in outside.asked] == pytest.approx([10.0**-k for k in range(4, 8)], rel=1e-9)


def test_wrong_claims_at_all_tolerances_end_stalled_with_the_best_impulses() -> None:
    solution = Outside(lambda done, tolerance: 1e-3, claims=True).solve(Stop(1e-6))
    assert solution.status is Status.STALLED
    assert f"the residual is {judge(PROBLEM, solution.impulses).residual:.1e}" in solution.message


def test_a_solved_problem_needs_no_claim() -> None:
    solution = Outside(lambda done, tolerance: 0.5**done, claims=False).solve(Stop(1e-6))
    assert solution.status is Status.SOLVED


def test_rounds_stay_within_both_limits() -> None:
    outside = Outside(lambda done, tolerance: 0.1, claims=False)
    solution = outside.solve(Stop(1e-6, max_iterations=77))
    assert (solution.status, solution.iterations) == (Status.ITERATION_LIMIT, 77)
    assert sum(count for _, count in outside.asked) == 77
    slow = Outside(lambda done, tolerance: 0.1, claims=False, seconds=1e-3)
    solution = slow.solve(Stop(1e-6, max_seconds=0.2))
    assert solution.status is Status.TIME_LIMIT
    assert sum(count for _, count in slow.asked) * 1e-3 <= 0.2


def test_non_finite_numbers_end_a_solve_with_the_best_impulses() -> None:
    solution = Outside(lambda done, tolerance: np.nan, claims=True).solve(Stop(1e-6), start=0.5 * ANSWER)
    assert solution.status is Status.DIVERGED
    np.testing.assert_array_equal(solution.impulses, 0.5 * ANSWER)
