"""Shared: a short pour with contacts from the first steps on."""

from collections.abc import Callable
from typing import Any

import pytest
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan


@pytest.fixture
def pour() -> Callable[..., SimulationPlan]:
    """Make the plan of thirty balls settling, with steps long enough to meet contacts soon."""

    def make(steps: int = 200, **numbers: Any) -> SimulationPlan:
        options = {"balls": 30, **numbers.pop("options", {})}
        return make_simulation_plan("pile", options, stepper="Moreau(step=1e-3)", duration=steps * 1e-3, **numbers)

    return make
