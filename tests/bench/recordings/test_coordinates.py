"""A scene whose bodies cannot be drawn is recorded with a curve for each of its coordinates."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.recordings.replay import scene_recorder
from proxbench.bench.recordings.scene_recorder import axis_range
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create


def test_the_curves_of_a_block_are_its_coordinates(tmp_path: Path, record: Callable[..., None]) -> None:
    from rerun.chunk import RrdReader

    scene, file = make_scene("block_on_incline(speed=1.0)"), tmp_path / "block.rrd"
    steps = list(MidpointRule(scene.system, create("SORprox"), Stop(), 1e-3).steps(scene.start, 10))
    record(scene_recorder(scene, file, 10), steps)
    states = [scene.start, *(step.state for step in steps)]
    drawn: dict[str, list[float]] = {}
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch().to_pydict()
        for values in batch.get("Scalars:scalars", []):
            drawn.setdefault(chunk.entity_path, []).extend(values or [])
    for index in range(2):
        curve = [value for name, values in drawn.items() if name.endswith(f"coordinates/q{index}") for value in values]
        np.testing.assert_allclose(sorted(curve), sorted(state.position[index] for state in states))


@pytest.mark.parametrize(
    "values", [[-1e-9, 0.0], [0.5, 0.5000000000000001], [-3.0, -3.0 - 4e-16], [1e9, 1e9 + 1e-6], [-1.0000000000000002]]
)
def test_axis_of_a_constant_curve_does_not_magnify_rounding(values: list[float]) -> None:
    heights = axis_range(values, 1e-6)
    assert heights is not None
    low, high = heights
    assert low < min(values) <= max(values) < high
    assert high - low >= 1e-6 * max(1.0, *map(abs, values))


@pytest.mark.parametrize("values", [[], [0.0, 1e-3], [5.0, 5.1], [1e-6, -1e-6]])
def test_curves_that_move_keep_the_axis_that_they_need(values: list[float]) -> None:
    assert axis_range(values, 1e-6) is None


def test_a_recording_of_a_block_at_rest_has_axes_that_do_not_magnify_rounding(
    tmp_path: Path, read_back: Callable[[Path], Any], record: Callable[..., None]
) -> None:
    scene, file = make_scene("block_on_incline(speed=0.0)"), tmp_path / "block.rrd"
    steps = list(MidpointRule(scene.system, create("SORprox"), Stop(), 1e-3).steps(scene.start, 10))
    record(scene_recorder(scene, file, 10), steps)
    ranges = [value for value in read_back(file).blueprint if isinstance(value, list) and np.shape(value) == (1, 2)]
    spans = {round(float(high - low), 9) for ((low, high),) in ranges}
    assert {0.4, 2e-6} <= spans  # of the step size, a logarithm, and of the coordinates [m]
