"""Impacts: velocities are exact for any time step, and positions are late by less than a step."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.impacts import NewtonsCradle, ObliqueImpact
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

StepErrors = Callable[[object, float, int], tuple[NDArray[np.float64], NDArray[np.float64]]]
Order = Callable[[list[float], list[float]], float]

FRICTION, RESTITUTION = 0.2, 0.5
LIMIT = 3.5 * FRICTION * (1.0 + RESTITUTION)
"""|v_T|/|v_N| up to which the oblique impact sticks."""


@pytest.mark.parametrize("ratio", [0.0, 0.3, -0.9, 0.999, 1.001, -1.5, 4.0])
def test_an_oblique_impact_sticks_up_to_its_limit(step_errors: StepErrors, ratio: float) -> None:
    scene = ObliqueImpact(2.0, 2.0 * ratio * LIMIT, FRICTION, RESTITUTION)
    assert scene.sticks is (abs(ratio) <= 1.0)
    _, velocities = step_errors(scene, scene.impact_time / 10.25, 20)
    assert velocities[:10].max() <= 1e-12
    assert velocities[11:].max() <= 1e-10
    after = scene.exact(2.0 * scene.impact_time).velocity
    slip = after[0] - scene.radius * after[4]
    assert slip == pytest.approx(0.0, abs=1e-13) if scene.sticks else slip * ratio > 0.0


@pytest.mark.parametrize("scene", [ObliqueImpact(), ObliqueImpact(1.0, 3.0), NewtonsCradle(), NewtonsCradle(3, 0.9)])
def test_positions_are_of_first_order_because_the_impact_is_late(
    step_errors: StepErrors, order: Order, scene: ObliqueImpact | NewtonsCradle
) -> None:
    """The impact occurs at a quarter of a step and acts at its midpoint: the error is Δt/4 times the velocity jump."""
    jump = scene.exact(scene.impact_time).velocity - scene.exact(0.0).velocity
    spins = isinstance(scene, ObliqueImpact)
    largest, time_steps, errors = float(np.abs(jump[:3] if spins else jump).max()), [], []
    for steps in (10, 30, 90, 270):
        time_step = scene.impact_time / (steps + 0.25)
        positions, velocities = step_errors(scene, time_step, 2 * steps)
        assert positions[-1] == pytest.approx(0.25 * time_step * largest, rel=1e-6)
        assert velocities[-1] <= 1e-10
        time_steps.append(time_step)
        errors.append(positions[-1])
    assert order(time_steps, errors) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("n_balls", [2, 3, 5, 8])
@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
def test_newtons_cradle_is_resolved_in_one_coupled_solve(n_balls: int, restitution: float) -> None:
    """Velocities are (1 + e)/n, that of the first ball (1 + e)/n − e, in one step with all contacts in its problem."""
    scene = NewtonsCradle(n_balls, restitution)
    moreau = MidpointRule(scene.system(), create("SORprox"), Stop(1e-13, 100_000), scene.impact_time / 4.25)
    struck = [step for step in moreau.steps(scene.start(), 6) if np.abs(step.impulses).max(initial=0.0) > 1e-9]
    assert len(struck) == 1
    assert struck[0].problem is not None
    assert struck[0].problem.n_contacts == n_balls - 1
    speeds = struck[0].state.velocity.reshape(n_balls, 3)[:, 0]
    assert speeds[0] == pytest.approx((1.0 + restitution) / n_balls - restitution, abs=1e-11)
    assert speeds[1:] == pytest.approx(np.full(n_balls - 1, (1.0 + restitution) / n_balls), abs=1e-11)


def test_error_names_the_invalid_parameter() -> None:
    with pytest.raises(ProblemError, match="normal_speed"):
        ObliqueImpact(normal_speed=0.0)
    with pytest.raises(ProblemError, match="n_balls"):
        NewtonsCradle(1)
    with pytest.raises(ProblemError, match="distance"):
        NewtonsCradle(distance=0.0)
