"""The chart of a simulation with a fixed step agrees with its data."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.step_row import step_columns
from proxbench.bench.simulation.trajectory import Simulation
from proxbench.bench.simulation.view.chart import simulation_chart


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
    drawing: dict[str, Any] = simulation_chart(simulation).to_dict()
    assert drawing["title"]["subtitle"].endswith(words)
