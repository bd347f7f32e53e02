"""Shared fixtures: recorded steps, and recordings read back without the viewer."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.recordings.scene_recorder import SceneRecorder
from proxbench.bench.simulation.step_row import STATUSES, scene_values, step_columns, step_row
from proxbench.problems.motion.stepping.step import AcceptedStep, Step
from rerun.chunk import RrdReader


class ReadBack:
    """The content of a recording file."""

    def __init__(self, file: Path) -> None:
        reader = RrdReader(file)
        self.logged: dict[tuple[str, str], dict[Any, Any]] = {}
        for chunk in reader.stream():
            batch = chunk.to_record_batch().to_pydict()
            timelines = chunk.timeline_names
            for row in range(chunk.num_rows):
                at = tuple(batch[name][row] for name in sorted(timelines)) or "static"
                for name, values in batch.items():
                    if ":" in name and values[row] is not None:
                        self.logged.setdefault((chunk.entity_path, name), {})[at] = values[row]
        layout = [chunk for entry in reader.blueprints() for chunk in reader.stream(store=entry)]
        self.blueprint = [
            value
            for chunk in layout
            for name, values in chunk.to_record_batch().to_pydict().items()
            if ":" in name
            for value in values
        ]

    def static(self, entity: str, component: str) -> Any:
        return self.logged[entity, component]["static"]

    def over_time(self, entity: str, component: str) -> dict[Any, Any]:
        """Values by the first timeline in alphabetical order (``iteration``, ``step``)."""
        return {at[0]: value for at, value in self.logged[entity, component].items() if at != "static"}

    def curve(self, entity: str) -> dict[int, float]:
        return {at: value[0] for at, value in self.over_time(entity, "Scalars:scalars").items()}


@pytest.fixture
def read_back() -> Callable[[Path], ReadBack]:
    return ReadBack


def record_steps(recorder: SceneRecorder, steps: Sequence[Step], every: int = 1) -> None:
    """Record consecutive steps from the start of a scene, and draw every ``every``-th one."""
    scene, begin, rows = recorder.scene, recorder.scene.start, []
    for step in steps:
        taken = AcceptedStep(begin, step.state, ((step, step.state.time - begin.time),), iterations=step.iterations)
        rows.append(step_row(scene, taken, scene_values(scene, step.state), STATUSES).values)
        begin = step.state
    drawn = list(enumerate(steps, 1))[every - 1 :: every]
    recorder.record(np.array(rows, dtype=step_columns(scene)), drawn)


@pytest.fixture(scope="session")
def record() -> Callable[..., None]:
    """Return the function that records steps."""
    return record_steps
