"""Shared: recordings read back, without the viewer."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
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
