"""A body that leaves the world ends a simulation, and earlier steps are kept."""

from pathlib import Path

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.simulation.file import read_simulation

PLUGIN = """
import numpy as np
from proxbench.problems.motion.bodies.rigid.shapes import Box
from proxbench.problems.motion.scenes.effects import Gravity
from proxbench.problems.motion.scenes.rigid.effects import rigid_bodies
from proxbench.problems.motion.state import State

def lost(height=1.0):
    system = rigid_bodies([Box((0.1, 0.1, 0.1))], np.array([1.0]), [], [Gravity()])
    return system, State(0.0, np.array([0, 0, height, 1.0, 0, 0, 0]), np.array([0, 0, -2e6, 0, 0, 0]))

SCENES = {"lost": lost}
"""


def test_a_box_that_leaves_the_world_ends_the_simulation_and_its_steps_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "lost.npz"
    words = ["simulate", "thrown_box(speed=2e6)", "--duration", "1", "--output", str(file)]
    assert run_command([*words, "--stepper", "Moreau(step=1e-3)", "--no-progress"]) == 1
    assert "ended at 0.006 s: a body is 12000 m from the origin" in capsys.readouterr().out
    assert run_command(["report", str(file), "--quiet"]) == 1
    assert "a body is 12000 m from the origin, beyond the limit of 10000 m" in capsys.readouterr().err
    stored = read_simulation(file)
    assert stored.ending == "left-world"
    assert stored.is_finished
    assert stored.n_steps == 6
    assert stored.steps["farthest"] == pytest.approx(2e3 * np.arange(1, 7), rel=1e-4)
    assert stored.state.position[0] == pytest.approx(1.2e4, rel=1e-4)


@pytest.mark.slow
def test_a_body_of_a_plugin_that_leaves_the_world_ends_the_simulation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plugin, file = tmp_path / "lost.py", tmp_path / "lost.npz"
    plugin.write_text(PLUGIN)
    words = ["simulate", "lost", "--plugin", str(plugin), "--duration", "1"]
    assert run_command([*words, "--output", str(file), "--no-progress"]) == 1
    assert "m from the origin, beyond the limit of" in capsys.readouterr().out
    stored = read_simulation(file)
    assert (stored.ending, stored.n_steps) == ("left-world", int(1e4 / 2e6 / 5e-4) + 1)
