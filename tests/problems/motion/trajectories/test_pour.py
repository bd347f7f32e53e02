"""Aggregates of pours are means over the second half, and a finished pour does not change."""

from dataclasses import replace

import numpy as np
import pytest
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.scene import Scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.trajectories.pour import ENERGY, HEIGHT, MotionRecorder


def column(scene: Scene, time: float, through: int) -> State:
    """Return ``through`` balls below the outlet and the others one metre above it, all at rest."""
    heights = np.where(np.arange(scene.n_balls) < through, -1.0, 1.0)
    position = np.column_stack([np.zeros((scene.n_balls, 2)), heights]).ravel()
    return State(time, position, np.zeros_like(scene.start.velocity))


def test_flow_and_height_are_those_of_the_second_half() -> None:
    scene = make_scene("funnel", {"balls": 10})
    recorder = MotionRecorder(replace(scene, start=column(scene, 0.0, 0)))
    for time, through in ((1.0, 0), (2.0, 5)):
        recorder.record(column(scene, time, through))
    found = recorder.aggregates(2.0)
    assert found["flow rate"] == pytest.approx(5.0)
    assert found[HEIGHT] == pytest.approx(0.75)
    weight = float(scene.potential_energy(column(scene, 0.0, 0).position)) / 10.0
    assert found[ENERGY] == pytest.approx(weight * 2.0 * 2.5, rel=1e-9)


def test_pour_that_ends_in_the_first_half_has_no_flow() -> None:
    scene = make_scene("funnel", {"balls": 4})
    recorder = MotionRecorder(replace(scene, start=column(scene, 0.0, 0)))
    recorder.record(column(scene, 1.0, 4))
    found = recorder.aggregates(4.0)
    assert found["flow rate"] == 0.0
    assert found[HEIGHT] == 0.0


def test_pile_has_no_flow_rate() -> None:
    scene = make_scene("pile", {"balls": 3})
    recorder = MotionRecorder(scene)
    recorder.record(replace(scene.start, time=1.0))
    assert set(recorder.aggregates(1.0)) == {HEIGHT, ENERGY}
