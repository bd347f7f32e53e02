"""Recordings draw the bodies of a plugin's scene, which is simulated in a separate process."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.problems.exchange.plugins.files import PluginFile
from proxbench.problems.exchange.plugins.offers import forget

PLUGIN = Path(__file__).resolve().parents[1] / "plugins" / "scene_plugin.py"


@pytest.fixture
def recorded(tmp_path: Path, read_back: Callable[[Path], Any]) -> Iterator[Callable[[str], Any]]:
    """Return a function that simulates a scene of the plugin and returns its recording."""

    def record(scene: str) -> Any:
        film = tmp_path / "a.rrd"
        line = f"simulate {scene} --duration 0.05 --no-progress --output {tmp_path}/a.npz --recording {film}"
        assert run_command([*line.split(), "--plugin", str(PLUGIN)]) == 0
        return read_back(film)

    yield record
    forget(PluginFile.read(PLUGIN))


@pytest.mark.slow
def test_a_recording_of_an_own_scene_draws_its_balls_and_surfaces(recorded: Callable[[str], Any]) -> None:
    content = recorded("tower(balls=3)")
    places = content.over_time("/scene/bodies/0", "InstancePoses3D:translations")
    np.testing.assert_allclose(places[0][0], [0.0, 0.0, 0.11], atol=1e-6)
    assert content.static("/scene/surfaces/0", "Mesh3D:vertex_positions") is not None


@pytest.mark.slow
def test_a_recording_of_an_own_scene_draws_its_rigid_bodies_and_joints(recorded: Callable[[str], Any]) -> None:
    content = recorded("wiper")
    places = content.over_time("/scene/bodies/0", "InstancePoses3D:translations")
    np.testing.assert_allclose(places[0][0], [0.0, 0.0, -0.25], atol=1e-6)
    assert any(entity.startswith("/scene/joints") for entity, _ in content.logged)
