"""Scenes of known motion, stepped with Moreau's rule and SORprox."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems.motion.scenes.scene import ClosedFormScene
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create

Errors = tuple[NDArray[np.float64], NDArray[np.float64]]
StepErrors = Callable[[ClosedFormScene, float, int], Errors]


@pytest.fixture
def step_errors() -> StepErrors:
    """Return a function for the largest errors of positions and velocities after a number of steps Δt."""

    def measure(scene: ClosedFormScene, time_step: float, steps: int) -> Errors:
        positions, velocities = np.empty(steps), np.empty(steps)
        moreau = MidpointRule(scene.system(), create("SORprox"), Stop(1e-12, 100_000), time_step)
        for index, step in enumerate(moreau.steps(scene.start(), steps)):
            assert step.status in (None, Status.SOLVED)
            exact = scene.exact(step.state.time)
            positions[index] = np.abs(step.state.position - exact.position).max()
            velocities[index] = np.abs(step.state.velocity - exact.velocity).max()
        return positions, velocities

    return measure


@pytest.fixture
def order() -> Callable[[list[float], list[float]], float]:
    """Return a function for the slope of the straight line through log(error) over log(Δt)."""

    def fitted(time_steps: list[float], errors: list[float]) -> float:
        return float(np.polyfit(np.log(time_steps), np.log(errors), 1)[0])

    return fitted
