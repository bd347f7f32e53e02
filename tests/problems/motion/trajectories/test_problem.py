"""Errors of trajectories: medians over neighbours, deviations seed by seed, and a digest of all numbers."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.woodpecker import DESCENT, LIMIT_CYCLE, PERIOD, section_error, section_start
from proxbench.problems.motion.state import State
from proxbench.problems.motion.trajectories.pour import HEIGHT, MotionRecorder
from proxbench.problems.motion.trajectories.problem import (
    ERROR,
    Aggregates,
    EndPosition,
    Estimate,
    LimitCycle,
    TrajectoryProblem,
)

POUR = Aggregates({0.0: {HEIGHT: 1.0}, 1.0: {HEIGHT: 3.0}})


def after_a_period(off: float = 0.0) -> State:
    """The woodpecker back in its section, with an error in φ_S."""
    start = section_start()
    return State(PERIOD, start.position - [DESCENT, 0.0, off], start.velocity)


def test_section_error_is_the_largest_of_three_scaled_errors() -> None:
    reached = after_a_period()
    assert section_error(reached) <= 1e-15
    off = State(
        PERIOD, reached.position + np.array([1e-6, 5.0, 1e-6]), reached.velocity + np.array([7.0, 7.0, 17.57e-3])
    )
    assert section_error(off) == pytest.approx(1e-3)


def test_the_error_of_neighbours_is_their_median_from_the_least_to_the_largest() -> None:
    measure, members = LimitCycle(LIMIT_CYCLE, 3), {}
    for factor, error in ((0.9, 1e-3), (1.0, 1e-5), (1.1, 1e-4)):
        recorder = MotionRecorder(make_scene("woodpecker"))
        recorder.record(after_a_period(0.47 * error))
        members[factor] = measure.values(recorder, PERIOD)
    found = measure.estimates(members)[ERROR]
    assert (found.error, found.low, found.high) == pytest.approx((1e-4, 1e-5, 1e-3), rel=1e-9)


def test_study_without_members_has_no_error_estimates() -> None:
    assert LimitCycle(LIMIT_CYCLE, 3).estimates({}) == {}


def test_the_error_of_an_end_is_the_largest_difference_over_the_way() -> None:
    measure = EndPosition({"q0": 1.0, "q1": 2.0}, scale=4.0)
    assert measure.estimates({1.0: {"q0": 1.1, "q1": 1.6}})[ERROR].error == pytest.approx(0.1)


def test_the_error_compares_each_seed_with_its_own_reference() -> None:
    (point,) = POUR.estimates({0.0: {HEIGHT: 1.2}, 1.0: {HEIGHT: 3.2}}).values()
    assert (point.error, point.low, point.high) == pytest.approx((0.1, 0.1, 0.1))
    (point,) = POUR.estimates({0.0: {HEIGHT: 1.1}, 1.0: {HEIGHT: 3.3}}).values()
    assert (point.error, point.low, point.high) == pytest.approx((0.1, 0.05, 0.15))
    assert POUR.spreads()[HEIGHT] == pytest.approx((2.0, 0.5))


def test_seeds_that_failed_are_left_out_and_one_alone_has_no_error() -> None:
    reference = Aggregates({**POUR.reference, 2.0: {HEIGHT: 2.0}})
    assert reference.estimates({0.0: {HEIGHT: 1.0}, 2.0: {HEIGHT: 2.0}}) == {HEIGHT: Estimate(0.0, 0.0, 0.0)}
    assert reference.estimates({0.0: {HEIGHT: 1.0}}) == {}
    assert Aggregates({0.0: {HEIGHT: 1.0}}).spreads() == {}


def test_the_digest_depends_on_every_number() -> None:
    problem = TrajectoryProblem("funnel(balls=3)", 0.5, (0.0, 1.0), POUR)
    others = [
        replace(problem, name="funnel(balls=4)"),
        replace(problem, duration=0.6),
        replace(problem, members=(0.0, 2.0)),
        replace(problem, measure=Aggregates({**POUR.reference, 1.0: {HEIGHT: np.nextafter(3.0, 4.0)}})),
        replace(problem, measure=EndPosition()),
    ]
    assert replace(problem, members=(0, 1)).digest == problem.digest
    assert len({problem.digest, *(other.digest for other in others)}) == 6
