"""A scene whose bodies cannot be drawn is recorded with a curve for each of its coordinates."""

from pathlib import Path

import numpy as np
from proxbench.bench.recordings.replay import scene_recorder
from proxbench.problems.scenes.registry import make_scene
from proxbench.problems.stepping.moreau import Moreau
from proxbench.solvers import Stop, create


def test_the_curves_of_a_block_are_its_coordinates(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    scene, file = make_scene("block_on_incline(speed=1.0)"), tmp_path / "block.rrd"
    states = [scene.start]
    with scene_recorder(scene, file, 10) as recorder:
        recorder.start(scene.start)
        for step in Moreau(scene.system, create("SORprox"), Stop(), 1e-3).steps(scene.start, 10):
            recorder(step)
            states.append(step.state)
    drawn: dict[str, list[float]] = {}
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch().to_pydict()
        for values in batch.get("Scalars:scalars", []):
            drawn.setdefault(chunk.entity_path, []).extend(values or [])
    for index in range(2):
        curve = [value for name, values in drawn.items() if name.endswith(f"coordinates/q{index}") for value in values]
        np.testing.assert_allclose(sorted(curve), sorted(state.position[index] for state in states))
