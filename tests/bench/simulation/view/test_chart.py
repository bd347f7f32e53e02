"""The chart of a simulation with a fixed step agrees with its data."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace as changed
from proxbench.bench.simulation.history import planned_segment
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.simulation import Simulation
from proxbench.bench.simulation.step_row import step_columns
from proxbench.bench.simulation.view.chart import simulation_chart


def subtitle(simulation: Simulation, seconds: float = 0.5) -> str:
    drawing: dict[str, Any] = simulation_chart(simulation, seconds).to_dict()
    return " ".join(drawing["title"]["subtitle"])


@pytest.mark.parametrize(
    ("residuals", "tolerance", "words"),
    [
        ([1e-5, 3e-4, 1.0], 1e-4, "MomentumFallback to 1e-4, 2 unsolved steps"),
        ([1e-5, 1e-5, 1e-5], 2.5e-5, "MomentumFallback to 2.5e-5, 0 unsolved steps"),
    ],
)
def test_the_subtitle_counts_the_steps_that_were_missed(residuals: list[float], tolerance: float, words: str) -> None:
    simulation = Simulation(make_simulation_plan("funnel", {"balls": 1}, tolerance=tolerance))
    steps = np.zeros(3, dtype=step_columns(simulation.plan.scene))
    steps["time"], steps["residual"] = [0.1, 0.2, 0.3], residuals
    simulation.restore(steps, replace(simulation.state, time=0.3))
    assert subtitle(simulation).endswith(words)


def woodpecker(*changes: dict[str, Any], residual: float = 0.0) -> Simulation:
    """A simulation of ten fixed steps of 0.1 s in equally long segments with changed settings."""
    plan = make_simulation_plan("woodpecker", stepper="Moreau(step=0.1)", solver="SORprox", tolerance=1e-10)
    simulation = Simulation(plan)
    steps = np.zeros(10, dtype=step_columns(plan.scene))
    steps["time"], steps["length"], steps["residual"] = 0.1 * np.arange(1, 11), 0.1, residual
    length = 10 // len(changes)
    segments = [
        changed(planned_segment(plan, 0), first=number * length, **change) for number, change in enumerate(changes)
    ]
    times, start = [0.0, *steps["time"]], plan.scene.start
    states = [replace(start, time=time) for time in times]
    simulation.kept_states.restore(states, [True] * len(states), 0)
    simulation.restore(steps, states[-1], segments=segments)
    return simulation


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (
            {},
            {"solver": "SORprox(relaxation=1.5)"},
            "Moreau(step=0.1), SORprox to 1e-10, then SORprox(relaxation=1.5) to 1e-10",
        ),
        (
            {"solver": "Fallback(NSGS)"},
            {"solver": "Fallback(Lemke)"},
            "Moreau(step=0.1), Fallback(NSGS) to 1e-10, then Fallback(Lemke) to 1e-10",
        ),
        (
            {"stepper": "Moreau(step=0.2)"},
            {},
            "Moreau(step=0.2), SORprox to 1e-10, then Moreau(step=0.1), SORprox to 1e-10",
        ),
        ({"tolerance": 2.4e-6}, {"tolerance": 1.6e-6}, "SORprox to 2.4e-6, then SORprox to 1.6e-6"),
        ({}, {"start": "cold"}, "SORprox to 1e-10, warm starts, then SORprox to 1e-10, cold starts"),
        ({}, {"max_iterations": 7}, "SORprox to 1e-10, at most 7 iterations, 0 unsolved steps"),
    ],
)
def test_the_subtitle_shows_how_segments_differ(first: dict[str, Any], second: dict[str, Any], words: str) -> None:
    assert words in subtitle(woodpecker(first, second), seconds=np.inf)


def test_the_subtitle_is_about_the_shown_time_and_also_counts_earlier_unsolved_steps() -> None:
    simulation = woodpecker({"solver": "NSGS"}, {}, residual=1.0)
    assert subtitle(simulation, seconds=0.25) == "Moreau(step=0.1), SORprox to 1e-10, 3 unsolved steps and 7 earlier"


def test_a_long_subtitle_is_wrapped() -> None:
    names = [{"solver": f"SORprox(relaxation=1.{digit})"} for digit in (1, 2, 3, 4, 5)]
    drawing: dict[str, Any] = simulation_chart(woodpecker(*names), np.inf).to_dict()
    lines = drawing["title"]["subtitle"]
    assert len(lines) > 1
    assert max(map(len, lines)) < 130
