"""Balls held by several contacts stay at rest, or move as one body."""

from collections.abc import Callable
from math import atan, sin

import numpy as np
import pytest
from numpy.typing import NDArray
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.inclines import SphereOnIncline
from proxbench.problems.motion.scenes.resting import Stack, VGroove
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

StepErrors = Callable[[object, float, int], tuple[NDArray[np.float64], NDArray[np.float64]]]
Order = Callable[[list[float], list[float]], float]


@pytest.mark.weekly
@pytest.mark.parametrize(("masses", "friction"), [((1.0, 3.0, 10.0), 0.3), ((1.0,) * 5, None)])
def test_a_stack_rests_for_ten_seconds(
    step_errors: StepErrors, masses: tuple[float, ...], friction: float | None
) -> None:
    positions, velocities = step_errors(Stack(masses, friction), 2e-3, 5000)
    assert positions.max() <= 1e-11
    assert velocities.max() <= 1e-11


@pytest.mark.parametrize("time_step", [1e-2, 1e-3])
def test_each_contact_of_a_stack_carries_the_weight_above_it(time_step: float) -> None:
    scene = Stack((1.0, 3.0, 10.0, 2.0))
    step = MidpointRule(scene.system(), create("SORprox"), Stop(1e-13, 100_000), time_step).step(scene.start())
    assert step.contacts is not None
    pairs = np.append(np.arange(3) * 5 + np.arange(1, 4), 4)  # the keys of balls k, k + 1, and of ball 0 on the ground
    impulse = dict(zip(step.contacts.keys.tolist(), step.impulses.tolist(), strict=True))
    found = [impulse[4], *(impulse[key] for key in pairs[:3].tolist())]
    assert found == pytest.approx(scene.supports() * time_step, rel=1e-10)


def test_touching_bodies_penetrate_by_second_order(step_errors: StepErrors, order: Order) -> None:
    """Without overlap, the ball falls by g Δt²/2 in the first step, and as far again until the second one stops it."""
    scene, time_steps, errors = Stack((1.0,), overlap=0.0), [1e-2, 5e-3, 2.5e-3, 1.25e-3], []
    for time_step in time_steps:
        positions, velocities = step_errors(scene, time_step, 100)
        assert velocities[-1] <= 1e-11
        assert positions[-1] == pytest.approx(9.81 * time_step**2, rel=1e-9)
        errors.append(float(positions[-1]))
    assert order(time_steps, errors) == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize("friction", [None, 0.0, 0.3, 1.5])
def test_a_ball_in_a_level_groove_rests(step_errors: StepErrors, friction: float | None) -> None:
    positions, velocities = step_errors(VGroove(friction=friction, slope=0.0), 1e-3, 200)
    assert positions.max() <= 1e-11
    assert velocities.max() <= 1e-11


def test_the_walls_of_a_groove_without_friction_share_the_weight() -> None:
    scene = VGroove(half_angle=0.4, friction=None, slope=0.0)
    step = MidpointRule(scene.system(), create("SORprox"), Stop(1e-13, 100_000), 1e-3).step(scene.start())
    assert step.impulses == pytest.approx([9.81e-3 / (2.0 * sin(0.4))] * 2, rel=1e-10)
    assert scene.wall_force == pytest.approx(9.81 / (2.0 * sin(0.4)), rel=1e-14)


@pytest.mark.parametrize("time_step", [1e-1, 1e-2, 2.5e-3])
@pytest.mark.parametrize("friction", [None, 0.3, 0.05])
def test_a_ball_in_an_inclined_groove_is_exact_at_any_time_step(
    step_errors: StepErrors, friction: float | None, time_step: float
) -> None:
    """Rolling, sliding with spin, and sliding: the accelerations are constant, so the midpoint rule is exact."""
    scene = VGroove(friction=friction, slope=0.5)
    assert scene.rolls is (friction == 0.3)
    positions, velocities = step_errors(scene, time_step, round(0.4 / time_step))
    assert positions.max() <= 1e-10
    assert velocities.max() <= 1e-9


def test_a_flat_groove_is_an_incline() -> None:
    for friction in (0.5, 0.02):
        groove, incline = VGroove(0.5 * np.pi - 1e-9, friction, 0.3), SphereOnIncline(0.3, friction)
        assert groove.rolls is incline.rolls
        assert groove.acceleration == pytest.approx(incline.acceleration, rel=1e-12)
        assert groove.spin_acceleration == pytest.approx(incline.spin_acceleration, rel=1e-12)


def test_rolling_in_a_groove_uses_all_friction_at_its_limit() -> None:
    """Just below the limit, the friction of rolling is μ times the wall forces, and both accelerations are equal."""
    lever = sin(0.6)
    limit = atan(0.3 * (5.0 * lever**2 + 2.0) / (2.0 * lever))
    below, above = VGroove(slope=limit - 1e-9), VGroove(slope=limit + 1e-9)
    assert below.rolls
    assert not above.rolls
    assert below.acceleration == pytest.approx(above.acceleration, rel=1e-7)
    assert below.spin_acceleration == pytest.approx(above.spin_acceleration, rel=1e-7)


def test_error_names_the_invalid_parameter() -> None:
    with pytest.raises(ProblemError, match="ball"):
        Stack(())
    with pytest.raises(ProblemError, match="overlap"):
        Stack(overlap=-1.0)
    with pytest.raises(ProblemError, match="half_angle"):
        VGroove(half_angle=0.0)
    with pytest.raises(ProblemError, match="slope"):
        VGroove(slope=2.0)
