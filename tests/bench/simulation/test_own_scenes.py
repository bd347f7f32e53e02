"""Energies and balls of a plugin's scene are known completely, or are absent."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.plugins.ball_records import describe_balls
from proxbench.bench.plugins.files import use_plugin_files
from proxbench.bench.plugins.remote_scene import local_or_remote_scene
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.view.chart import simulation_chart
from proxbench.problems.exchange.plugins.files import PluginFile
from proxbench.problems.exchange.plugins.offers import forget
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.scenes.effects import Drag, Force, Friction, Gravity, Spring, ball_system
from proxbench.problems.motion.scenes.funnel import Funnel
from proxbench.problems.motion.scenes.scene import GROUND
from proxbench.problems.motion.trajectories.pour import ENERGY, MotionRecorder

PLUGIN = Path(__file__).resolve().parents[1] / "plugins" / "scene_plugin.py"


class Wind(Force):
    """A force without a known potential."""

    def accelerate(self, centres: Any, velocities: Any, masses: Any) -> Any:
        return np.ones_like(centres)


class Uneven(Gravity):
    """Gravity of another acceleration, whose potential is not known."""

    def accelerate(self, centres: Any, velocities: Any, masses: Any) -> Any:
        return 2.0 * super().accelerate(centres, velocities, masses)


class Ground(Plane):
    """A plane of a new class."""


@pytest.fixture(autouse=True)
def in_use() -> Iterator[None]:
    """Register the plugin for one test."""
    use_plugin_files([PLUGIN])
    yield
    forget(PluginFile.read(PLUGIN))


def test_a_free_fall_of_an_own_scene_of_balls_keeps_its_energy() -> None:
    steps = simulate(make_simulation_plan("tower(balls=2)", stepper="Moreau(step=1e-4)", duration=0.01)).steps
    energy = steps["kinetic_energy"] + steps["potential_energy"]
    assert steps["kinetic_energy"][-1] > 1e-3
    np.testing.assert_allclose(energy, 2.0 * 9.81 * (0.11 + 0.5 * 0.205), rtol=1e-9)


@pytest.mark.parametrize(
    ("effects", "known"),
    [
        ([], 0.0),
        ([Gravity(2.0), Friction(0.5)], 2.0 * 3.0 * 0.5),
        ([Gravity(2.0), Spring(4.0, (0.0, 0.0, 0.0)), Drag(1.0)], 2.0 * 3.0 * 0.5 + 2.0 * 0.25),
        ([Gravity(2.0), Wind()], None),
        ([Uneven(2.0)], None),
    ],
)
def test_potential_energy_of_balls_is_known_if_that_of_every_force_is(effects: list[Any], known: float | None) -> None:
    system = ball_system(np.array([0.1]), np.array([3.0]), [GROUND], effects)
    energy = system.potential_energy
    assert (None if energy is None else energy(np.array([0.0, 0.0, 0.5]))) == known


@pytest.mark.slow
def test_a_scene_that_does_not_know_its_potential_energy_shows_no_energy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = f"simulate block --duration 0.02 --stepper Moreau(step=1e-3) --no-progress --output {tmp_path}/a.npz"
    assert run_command([*line.split(), "--plugin", str(PLUGIN)]) == 0
    assert "E [J]" not in capsys.readouterr().out
    assert run_command(["report", f"{tmp_path}/a.npz", "--json", "--plugin", str(PLUGIN)]) == 0
    assert [row["energy"] for row in json.loads(capsys.readouterr().out)["windows"]] == [None]
    simulation = simulate(make_simulation_plan("block", stepper="Moreau(step=1e-3)", duration=0.02))
    text = json.dumps(simulation_chart(simulation).to_dict())
    assert '"kinetic"' in text
    assert '"total"' not in text
    recorder = MotionRecorder(simulation.plan.scene)
    assert ENERGY not in (recorder.aggregates(0.02) if recorder.scene.n_balls else {})


def test_balls_of_a_remote_scene_have_its_radii_masses_and_surfaces() -> None:
    balls = local_or_remote_scene("tower(balls=3)").balls
    assert balls is not None
    np.testing.assert_array_equal(balls.radii, [0.1, 0.1, 0.1])
    np.testing.assert_array_equal(balls.masses, [1.0, 1.0, 1.0])
    assert balls.surfaces == [Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
    funnel = local_or_remote_scene("twin(balls=3)").balls
    assert funnel is not None
    drawn = [surface for surface in Funnel(3).system().surfaces if type(surface).__name__ != "Rim"]
    assert list(funnel.surfaces) == drawn
    assert local_or_remote_scene("block").balls is None


def test_a_surface_of_a_class_of_its_own_is_drawn_as_the_one_it_extends() -> None:
    system = ball_system(np.array([0.1]), np.array([3.0]), [Ground((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))], [])
    (surface,) = describe_balls(system).planes
    assert type(surface) is Plane
    assert (list(surface.point), list(surface.normal)) == ([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
