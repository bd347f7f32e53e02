"""Spheres and a block on a plane: constant accelerations are exact; errors of stops and reversals have their order."""

from collections.abc import Callable
from math import atan, cos, sin, tan

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.inclines import BlockOnIncline, SlidingSphere, SphereOnIncline

StepErrors = Callable[[object, float, int], tuple[NDArray[np.float64], NDArray[np.float64]]]
Order = Callable[[list[float], list[float]], float]


@pytest.mark.parametrize("time_step", [1e-1, 1e-2, 2.5e-3])
@pytest.mark.parametrize(("slope", "friction"), [(0.3, 0.5), (0.3, 0.02), (0.8, 0.1), (1.2, 0.9), (0.2, 0.0)])
def test_the_sphere_is_exact_at_any_time_step(
    step_errors: StepErrors, slope: float, friction: float, time_step: float
) -> None:
    """Both accelerations are constant, so the midpoint rule is exact up to the tolerance of the solver."""
    positions, velocities = step_errors(SphereOnIncline(slope, friction), time_step, round(0.4 / time_step))
    assert positions.max() <= 1e-11
    assert velocities.max() <= 1e-10


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_the_sphere_rolls_up_to_seven_halves_of_the_friction(step_errors: StepErrors, friction: float) -> None:
    """A change of 0.1 % in the slope on either side of tan θ = 7μ/2 is decisive."""
    for factor, rolls in ((0.999, True), (1.001, False)):
        scene = SphereOnIncline(atan(factor * 3.5 * friction), friction)
        assert scene.rolls is rolls
        assert step_errors(scene, 1e-2, 20)[1].max() <= 1e-10
        slip = scene.acceleration - scene.radius * scene.spin_acceleration
        assert slip == pytest.approx(0.0, abs=1e-13) if rolls else slip > 1e-3


def test_a_block_at_the_limit_of_friction_stays_and_beyond_it_slides(step_errors: StepErrors) -> None:
    """At tan θ = μ it rests; at θ + 1e-9 it moves by g (sin θ − μ cos θ) t²/2, some nanometres."""
    slope, friction = 0.4, tan(0.4)
    for steeper, holds in ((0.0, True), (1e-9, False)):
        scene = BlockOnIncline(slope + steeper, friction, 0.0)
        assert scene.holds is holds
        positions, velocities = step_errors(scene, 1e-2, 100)
        assert positions.max() <= 1e-11
        assert velocities.max() <= 1e-11
        if not holds:
            assert scene.exact(1.0).velocity[0] == pytest.approx(9.81 * 1e-9 / cos(slope), rel=1e-6)


@pytest.mark.parametrize("time_step", [1e-1, 1e-2, 2.5e-3])
def test_a_sliding_block_is_exact_until_it_stops(step_errors: StepErrors, time_step: float) -> None:
    for scene in (BlockOnIncline(0.8, 0.1, 0.0), BlockOnIncline(0.8, 0.1, 1.0), BlockOnIncline(0.3, 0.5, 1.0)):
        steps = int(min(scene.stop_time, 0.4) / time_step) if scene.speed else 4
        positions, velocities = step_errors(scene, time_step, steps)
        assert positions.max() <= 1e-11
        assert velocities.max() <= 1e-11


def test_stopping_gives_a_second_order_position_error_and_an_exact_velocity(
    step_errors: StepErrors, order: Order
) -> None:
    """The block stops at a fraction s of a step; the trapezoid over the kink has the error a s (1 − s) Δt²/2."""
    scene, fraction = BlockOnIncline(0.3, 0.5, -1.0), 0.25
    deceleration, time_steps, errors = 9.81 * (0.5 * cos(0.3) + sin(0.3)), [], []
    for steps in (10, 30, 90):
        time_step = scene.stop_time / (steps + fraction)
        positions, velocities = step_errors(scene, time_step, 2 * steps)
        assert velocities.max() <= 1e-11
        predicted = 0.5 * deceleration * fraction * (1.0 - fraction) * time_step**2
        assert positions[-1] == pytest.approx(predicted, rel=1e-6)
        time_steps.append(time_step)
        errors.append(positions[-1])
    assert order(time_steps, errors) == pytest.approx(2.0, abs=1e-3)


def test_reversal_gives_a_first_order_velocity_error(step_errors: StepErrors, order: Order) -> None:
    """The block reverses at a fraction s of a step, but friction has the new direction during the whole step.

    This changes the velocity permanently by 2 s μ g cos θ Δt.
    """
    scene, fraction, time_steps, errors = BlockOnIncline(0.5, 0.2, -1.0), 0.25, [], []
    for steps in (10, 30, 90):
        time_step = scene.stop_time / (steps + fraction)
        _, velocities = step_errors(scene, time_step, 2 * steps)
        assert velocities[-1] == pytest.approx(2.0 * fraction * 0.2 * 9.81 * cos(0.5) * time_step, rel=1e-6)
        time_steps.append(time_step)
        errors.append(velocities[-1])
    assert order(time_steps, errors) == pytest.approx(1.0, abs=1e-3)


def test_slope_out_of_range_is_refused() -> None:
    for scene in (SphereOnIncline, BlockOnIncline):
        with pytest.raises(ProblemError, match="slope"):
            scene(1.6)


def test_a_sliding_sphere_rolls_from_the_known_time_on_at_five_sevenths_of_its_speed() -> None:
    scene = SlidingSphere(2.0, 0.25)
    assert scene.rolling_time == pytest.approx(2.0 * 2.0 / (7.0 * 0.25 * 9.81), rel=1e-15)
    for time in (scene.rolling_time, 3.0 * scene.rolling_time):
        velocity = scene.exact(time).velocity
        assert velocity[0] == pytest.approx(2.0 * 5.0 / 7.0, rel=1e-14)
        assert velocity[0] == pytest.approx(scene.radius * velocity[4], rel=1e-14)
    before = scene.exact(0.99 * scene.rolling_time).velocity
    assert before[0] > scene.radius * before[4]


def test_the_sliding_sphere_has_the_exact_velocity_and_second_order_in_position(
    step_errors: StepErrors, order: Order
) -> None:
    """Rolling begins at a fraction s of a step; the trapezoid over the kink has the error μ g s (1 − s) Δt²/2."""
    scene, fraction, time_steps, errors = SlidingSphere(), 0.5, [], []
    for steps in (10, 30, 90):
        time_step = scene.rolling_time / (steps + fraction)
        positions, velocities = step_errors(scene, time_step, 2 * steps)
        assert velocities.max() <= 1e-10
        predicted = 0.5 * 0.3 * 9.81 * fraction * (1.0 - fraction) * time_step**2
        assert positions[-1] == pytest.approx(predicted, rel=1e-4)
        time_steps.append(time_step)
        errors.append(positions[-1])
    assert order(time_steps, errors) == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("name", ["speed", "friction", "gravity"])
def test_invalid_parameter_of_a_sliding_sphere_is_refused(name: str) -> None:
    with pytest.raises(ProblemError, match=name):
        SlidingSphere(**{name: 0.0})
