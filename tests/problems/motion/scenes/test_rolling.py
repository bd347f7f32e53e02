"""The sphere that slides and then rolls."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.rolling import SlidingSphere

StepErrors = Callable[[object, float, int], tuple[NDArray[np.float64], NDArray[np.float64]]]
Order = Callable[[list[float], list[float]], float]


def test_it_rolls_from_the_known_time_on_at_five_sevenths_of_its_speed() -> None:
    scene = SlidingSphere(2.0, 0.25)
    assert scene.rolling_time == pytest.approx(2.0 * 2.0 / (7.0 * 0.25 * 9.81), rel=1e-15)
    for time in (scene.rolling_time, 3.0 * scene.rolling_time):
        velocity = scene.exact(time).velocity
        assert velocity[0] == pytest.approx(2.0 * 5.0 / 7.0, rel=1e-14)
        assert velocity[0] == pytest.approx(scene.radius * velocity[4], rel=1e-14)
    before = scene.exact(0.99 * scene.rolling_time).velocity
    assert before[0] > scene.radius * before[4]


def test_time_stepping_has_the_exact_velocity_and_second_order_in_position(
    step_errors: StepErrors, order: Order
) -> None:
    """Rolling begins a fraction s into a step; the trapezoid over the kink errs by μ g s (1 − s) Δt²/2."""
    scene, fraction, time_steps, errors = SlidingSphere(), 0.5, [], []
    for steps in (10, 30, 90, 270):
        time_step = scene.rolling_time / (steps + fraction)
        positions, velocities = step_errors(scene, time_step, 2 * steps)
        assert velocities.max() <= 1e-10
        predicted = 0.5 * 0.3 * 9.81 * fraction * (1.0 - fraction) * time_step**2
        assert positions[-1] == pytest.approx(predicted, rel=1e-4)
        time_steps.append(time_step)
        errors.append(positions[-1])
    assert order(time_steps, errors) == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("name", ["speed", "friction", "gravity"])
def test_a_number_out_of_range_is_named(name: str) -> None:
    with pytest.raises(ProblemError, match=name):
        SlidingSphere(**{name: 0.0})
