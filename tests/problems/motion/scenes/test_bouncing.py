"""The bouncing ball against the geometric series of its flights."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

from ..general_ball import general_start, general_system

StepErrors = Callable[[object, float, int], tuple[NDArray[np.float64], NDArray[np.float64]]]
Order = Callable[[list[float], list[float]], float]


def test_the_closed_form_is_free_flight_between_impacts_that_obey_newtons_law() -> None:
    ball = BouncingBall(restitution=0.6)
    sample, gap = 1e-6, 1e-9
    for impact in range(6):
        before, after = ball.exact(ball.impact_time(impact) - gap), ball.exact(ball.impact_time(impact) + gap)
        assert after.velocity[2] == pytest.approx(-0.6 * before.velocity[2], abs=1e-6)
        assert after.position[2] == pytest.approx(ball.radius, abs=1e-7)
        middle = 0.5 * (ball.impact_time(impact) + ball.impact_time(impact + 1))
        heights = [ball.exact(middle + k * sample).position[2] for k in (-100, 0, 100)]
        assert heights[0] - 2.0 * heights[1] + heights[2] == pytest.approx(-9.81 * (100 * sample) ** 2, rel=1e-6)
    assert ball.impact_time(200) == pytest.approx(ball.rest_time, rel=1e-14)
    assert ball.rest_time == pytest.approx(np.sqrt(2.0 / 9.81) * 1.6 / 0.4, rel=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(("finest", "error"), [(900, 3e-3), pytest.param(2700, 1e-3, marks=pytest.mark.weekly)])
def test_time_stepping_is_of_first_order_through_infinitely_many_impacts(
    step_errors: StepErrors, order: Order, finest: int, error: float
) -> None:
    """The mean error of the height is erratic in single runs, because an impact occurs anywhere in its step.

    Medians are therefore taken over nine neighbouring Δt. The order is one, because each impact is late by a part of a
    step.
    """
    ball = BouncingBall()
    end, time_steps, errors = 1.1 * ball.rest_time, [], []
    for steps in [steps for steps in (100, 300, 900, 2700) if steps <= finest]:
        counts = [round(steps * (1.0 + 0.02 * k)) for k in range(9)]
        errors.append(float(np.median([step_errors(ball, end / n, n)[0].mean() for n in counts])))
        time_steps.append(end / counts[4])
    assert 0.75 <= order(time_steps, errors) <= 1.25
    assert errors[-1] <= error


@pytest.mark.slow
def test_the_ball_comes_to_rest_at_the_accumulation_point() -> None:
    """The last impacts occur within a few steps, so Moreau's rule comes to rest within twenty Δt of the closed form."""
    ball = BouncingBall()
    for steps in (300, 1000, 3000):
        time_step, moving = 1.1 * ball.rest_time / steps, 0.0
        moreau = MidpointRule(ball.system(), create("SORprox"), Stop(1e-12), time_step)
        for step in moreau.steps(ball.start(), steps):
            if abs(step.state.velocity[2]) > 1e-6:
                moving = step.state.time
        assert abs(moving - ball.rest_time) <= 20.0 * time_step


def test_general_system_gives_the_motion_of_the_ball_system() -> None:
    ball = BouncingBall()
    ends = []
    for system, begin in ((ball.system(), ball.start()), (general_system(ball), general_start(ball))):
        *_, last = MidpointRule(system, create("SORprox"), Stop(1e-12), 1e-3).steps(begin, 700)
        ends.append(last.state)
    state, general = ends
    assert general.position[0] == pytest.approx(state.position[2], abs=1e-12)
    assert general.velocity[0] == pytest.approx(state.velocity[2], abs=1e-12)


@pytest.mark.parametrize(("name", "value"), [("height", 0.0), ("restitution", 1.0), ("gravity", -9.81)])
def test_error_names_the_invalid_parameter(name: str, value: float) -> None:
    with pytest.raises(ProblemError, match=name):
        BouncingBall(**{name: value})
