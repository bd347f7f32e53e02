"""Shared fixture: a short pour with contacts from the first steps on."""

from collections.abc import Callable
from typing import Any

import pytest
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan


@pytest.fixture
def pour() -> Callable[..., SimulationPlan]:
    """Return a function that makes the plan of thirty settling balls, with steps long enough for early contacts."""

    def make(steps: int = 200, **numbers: Any) -> SimulationPlan:
        options = {"balls": 30, **numbers.pop("options", {})}
        return make_simulation_plan("pile", options, stepper="Moreau(step=1e-3)", duration=steps * 1e-3, **numbers)

    return make
