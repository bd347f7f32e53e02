"""The chart shows named coordinates with dots, or energies and numbers of switching points."""

from typing import Any

import numpy as np
import pytest
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.simulation import SWITCH, Simulation
from proxbench.bench.simulation.step_row import step_columns
from proxbench.bench.simulation.view.chart import simulation_chart
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.step import LawStates


def made(scene: str, motion: float = 1.0, switches: tuple[tuple[float, int], ...] = ()) -> Simulation:
    """A simulation of ten steps of 0.1 s in which coordinates move by ``motion``; switches are times and laws."""
    options = {"balls": 3} if scene == "pile" else None
    plan = make_simulation_plan(scene, options, stepper="Extrapolated", duration=1.0)
    simulation = Simulation(plan)
    steps = np.zeros(10, dtype=step_columns(simulation.plan.scene))
    steps["time"], steps["length"] = 0.1 * np.arange(1, 11), 0.1
    steps["kinetic_energy"], steps["potential_energy"] = np.arange(10.0), 7.0
    start = plan.scene.start
    places = [start.position + 0.5 + motion * number for number in range(10)]
    states = [State(time, place, 0.0 * start.velocity) for time, place in zip(steps["time"], places, strict=True)]
    simulation.kept_states.restore(states, [True] * 10, 0)
    rows = np.zeros(len(switches), dtype=SWITCH)
    rows["begin"] = rows["end"] = [time for time, _ in switches]
    rows["law"] = [law for _, law in switches]
    simulation.restore(steps, states[-1], rows, LawStates())
    return simulation


def panels(simulation: Simulation, seconds: float = np.inf) -> dict[str, dict[str, Any]]:
    """Return the panels by the title of their vertical axis."""
    drawing = simulation_chart(simulation, seconds).to_dict()
    return {title(panel): panel for panel in drawing["vconcat"]}


def title(panel: dict[str, Any]) -> str:
    found = vertical(panel)["title"]
    return found if isinstance(found, str) else found[0]


def vertical(panel: dict[str, Any]) -> dict[str, Any]:
    first = panel["layer"][0] if "layer" in panel else panel
    encoding: dict[str, Any] = first["encoding"]["y"]
    return encoding


def subtitle(simulation: Simulation, seconds: float = np.inf) -> str:
    return " ".join(simulation_chart(simulation, seconds).to_dict()["title"]["subtitle"])


def test_balls_have_energies_and_numbers_of_switching_points_instead_of_coordinates() -> None:
    drawn = panels(made("pile", switches=((0.35, 0), (0.35, 1), (0.35, 1))))
    assert list(drawn) == ["contacts", "iterations", "depth / r", "energy [J]", "switching points", "step size [s]"]
    assert not any("layer" in panel for panel in drawn.values())  # no dots


@pytest.mark.slow
def test_switching_points_are_counted_per_part_of_the_time() -> None:
    switches = ((0.051, 0), (0.355, 0), (0.355, 1), (0.356, 1), (1.0, 0))
    drawing = simulation_chart(made("pile", switches=switches)).to_dict()
    bars = drawing["datasets"][drawing["vconcat"][4]["data"]["name"]]
    counted = sorted((round(bar["time"], 6), bar["law"][:4], bar["count"]) for bar in bars)
    assert counted == [(0.05, "cont", 1), (0.35, "cont", 1), (0.35, "slip", 2), (0.99, "cont", 1)]


@pytest.mark.slow
def test_the_figure_is_drawn_without_any_switching_point() -> None:
    assert "no switching points" in subtitle(made("pile"))
    assert "no switching points" in subtitle(made("woodpecker"))


def test_the_woodpecker_keeps_its_coordinates_with_dots() -> None:
    drawn = panels(made("woodpecker", switches=((0.35, 0),)))
    assert list(drawn) == ["sleeve angle [rad]", "bird angle [rad]", "sleeve height [m]", "step size [s]"]
    assert all("layer" in panel for name, panel in drawn.items() if name != "step size [s]")


@pytest.mark.parametrize("motion", [0.0, 1e-16, 1e-9])
def test_an_axis_does_not_magnify_rounding(motion: float) -> None:
    panel = panels(made("woodpecker", motion))["sleeve angle [rad]"]
    low, high = vertical(panel)["scale"]["domain"]
    assert high - low > 0.01
    assert low < 0.5 + made("woodpecker", motion).plan.scene.start.position[1] < high


def test_an_axis_follows_what_moves() -> None:
    assert "domain" not in vertical(panels(made("woodpecker", 1e-3))["sleeve angle [rad]"])["scale"]


@pytest.mark.slow
def test_switching_points_are_laws_that_switch_and_instants_are_listed_beside() -> None:
    simulation = made("woodpecker", switches=((0.35, 0), (0.35, 1), (0.85, 0)))
    assert "10 steps" in subtitle(simulation)
    assert "3 switching points at 2 instants" in subtitle(simulation)
    assert simulation_chart(simulation, 0.25).to_dict()["title"]["text"].endswith("after 0.75 s")
    late = subtitle(simulation, 0.25)
    assert "3 steps" in late
    assert "1 switching point at 1 instant" in late
