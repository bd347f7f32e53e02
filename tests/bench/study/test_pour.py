"""Aggregates of pours: means over the second half, errors against a reference with their spread over seeds."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.bench.study.measuring import Measured
from proxbench.bench.study.plan import StudyPlan
from proxbench.bench.study.points import aggregate_points, seed_spreads
from proxbench.bench.study.running import points, run_study, spreads
from proxbench.problems.mechanics.state import State
from proxbench.problems.scenes.registry import make_scene
from proxbench.problems.scenes.scene import Scene
from proxbench.problems.trajectories.pour import ENERGY, FLOW, HEIGHT, Watch

from .conftest import pour_case


def column(scene: Scene, time: float, through: int) -> State:
    """So many balls below the outlet, the others one metre above it, all at rest."""
    heights = np.where(np.arange(scene.n_balls) < through, -1.0, 1.0)
    position = np.column_stack([np.zeros((scene.n_balls, 2)), heights]).ravel()
    return State(time, position, np.zeros_like(scene.start.velocity))


def test_flow_and_height_are_those_of_the_second_half() -> None:
    scene = make_scene("funnel", {"balls": 10})
    watch = Watch(replace(scene, start=column(scene, 0.0, 0)))
    for time, through in ((1.0, 0), (2.0, 5)):
        watch.note(column(scene, time, through))
    found = watch.aggregates(2.0)
    assert found[FLOW] == pytest.approx(5.0)
    assert found[HEIGHT] == pytest.approx(0.75)
    weight = float(make_scene("funnel", {"balls": 10}).potential_energy(column(scene, 0.0, 0).position)) / 10.0
    assert found[ENERGY] == pytest.approx(weight * 2.0 * 2.5, rel=1e-9)


def test_a_pour_that_ends_early_stays_as_it_was() -> None:
    scene = make_scene("funnel", {"balls": 4})
    watch = Watch(replace(scene, start=column(scene, 0.0, 0)))
    watch.note(column(scene, 1.0, 4))
    found = watch.aggregates(4.0)
    assert found[FLOW] == 0.0
    assert found[HEIGHT] == 0.0


def test_a_pile_has_no_flow() -> None:
    scene = make_scene("pile", {"balls": 3})
    watch = Watch(scene)
    watch.note(replace(scene.start, time=1.0))
    assert set(watch.aggregates(1.0)) == {HEIGHT, ENERGY}


def measured(value: float, failure: str = "") -> Measured:
    return Measured(1.0, 10, 0, {} if failure else {HEIGHT: value}, failure)


def test_what_seeds_have_in_common_cancels_in_the_error() -> None:
    reference = {0: measured(1.0), 1: measured(3.0)}
    (point,) = aggregate_points(pour_case(1e-3), {0: measured(1.2), 1: measured(3.2)}, reference)
    assert (point.error, point.low, point.high) == pytest.approx((0.1, 0.1, 0.1))
    (point,) = aggregate_points(pour_case(1e-3), {0: measured(1.1), 1: measured(3.3)}, reference)
    assert (point.error, point.low, point.high) == pytest.approx((0.1, 0.05, 0.15))
    assert seed_spreads(reference)[HEIGHT] == pytest.approx((2.0, 0.5))


def test_seeds_that_failed_are_left_out_and_counted() -> None:
    reference = {0: measured(1.0), 1: measured(3.0), 2: measured(2.0)}
    (point,) = aggregate_points(
        pour_case(1e-3), {0: measured(1.0), 1: measured(0.0, "boom"), 2: measured(2.0)}, reference
    )
    assert (point.error, point.members, point.failed) == (0.0, 2, 1)
    assert not aggregate_points(pour_case(1e-3), {0: measured(1.0), 1: measured(0.0, "boom")}, reference)


def test_aggregates_of_a_small_pour_have_a_spread_and_the_reference_has_no_error(pour_plan: StudyPlan) -> None:
    same = replace(pour_plan.cases[0], part="steppers")
    study = run_study(replace(pour_plan, cases=(*pour_plan.cases, same)))
    assert set(spreads(study)) == {FLOW, HEIGHT, ENERGY}
    assert all(spreads(study)[quantity][1] > 0.0 for quantity in (HEIGHT, ENERGY))
    found = {(point.setting, point.quantity): point for point in points(study)}
    for quantity in (HEIGHT, ENERGY):
        assert found["Δt 0.002 s", quantity].error == 0.0
        assert 0.0 < found["Δt 0.008 s", quantity].error < 1.0
        assert found["Δt 0.008 s", quantity].high > found["Δt 0.004 s", quantity].error
    coarse, middle, fine = (found[f"Δt {size:g} s", HEIGHT].solves for size in (8e-3, 4e-3, 2e-3))
    assert 1.8 * coarse < middle < fine / 1.8
