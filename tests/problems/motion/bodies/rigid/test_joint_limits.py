"""Limits, ropes and motors of joints against closed forms."""

from dataclasses import replace
from math import acos, cos, pi, sqrt
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.joints import WORLD, Joint, RigidJoints
from proxbench.problems.motion.bodies.rigid.orientation import IDENTITY, Y_AXIS, about
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.bodies.rigid.shapes import Box
from proxbench.problems.motion.scenes.rigid.linkages import Pendulum, jointed_bodies
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Stop, create

DEPTH, G = 1e-6, 9.81
DOWN = (0.0, 0.0, -1.0)


def steps(system: RigidBodies, start: State, step: float, count: int) -> list[Step]:
    return list(MidpointRule(system, create("Robust"), Stop(1e-12, 100_000), step, depth=DEPTH).steps(start, count))


def one_body(joint: Joint, gravity: float = G) -> RigidBodies:
    return jointed_bodies([Box((0.1, 0.2, 0.3))], np.array([2.0]), [joint], gravity)


def start_of(velocity: tuple[float, ...] = (0.0,) * 6) -> State:
    return State(0.0, np.array([0.0, 0.0, 0.0, *IDENTITY]), np.array(velocity))


def heights(found: list[Step]) -> np.ndarray[Any, Any]:
    return np.array([step.state.position[2] for step in found])


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.5, *(pytest.param(e, marks=pytest.mark.weekly) for e in (0.0, 1.0))])
def test_a_pendulum_rebounds_from_its_limit_to_the_height_that_restitution_leaves(restitution: float) -> None:
    """Released at θ₀, it hits a limit at 0 with ω² ~ 1 − cos θ₀, and returns to θ₁: 1 − cos θ₁ = ε² (1 − cos θ₀)."""
    scene = Pendulum()
    joint = Joint("revolute", 0, WORLD, (0.0, 0.0, 0.5), axis=Y_AXIS, limits=(0.0, 2.0), restitution=restitution)
    found = steps(jointed_bodies([*scene.system().shapes], np.array([1.0]), [joint], G), scene.start(), 2e-3, 550)
    angles = np.array([scene.angle_of(step.state) for step in found])
    hit = int(angles.argmin())
    assert found[hit].state.time == pytest.approx(0.25 * scene.period, abs=4e-3)
    assert angles.min() >= -4e-3 * 2.0  # less than the motion of one step; corrected afterwards
    assert angles[hit + 2 :].min() >= -1.2e-6
    rebound = acos(1.0 - restitution**2 * (1.0 - cos(1.0)))
    assert angles[hit:].max() == pytest.approx(rebound, abs=8e-3)


@pytest.mark.slow
def test_a_slider_falls_against_its_stop_and_rests_there() -> None:
    stop, step = 0.3, 1e-3
    joint = Joint("prismatic", 0, axis=DOWN, limits=(-1.0, stop), restitution=0.0)
    found = steps(one_body(joint), start_of(), step, 400)
    falling = round(sqrt(2.0 * stop / G) / step) - 1
    assert heights(found)[falling - 1] == pytest.approx(-0.5 * G * (falling * step) ** 2, abs=1e-9)
    assert -heights(found)[-1] == pytest.approx(stop, abs=1.2 * DEPTH)
    last = found[-1]
    assert last.contacts is not None
    assert last.contacts.n_contacts == 1
    assert last.impulses[-1] / step == pytest.approx(2.0 * G, rel=1e-9)
    assert np.abs(last.state.velocity).max() <= 1e-12


@pytest.mark.slow
def test_a_slider_bounces_between_two_stops_with_the_velocity_that_restitution_leaves() -> None:
    """Without gravity, the slider takes 0.2/v, 0.2/(εv), … between stops 0.2 m apart."""
    joint = Joint("prismatic", 0, axis=(1.0, 0.0, 0.0), limits=(-0.1, 0.1), restitution=0.5)
    found = steps(one_body(joint, 0.0), start_of((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)), 1e-3, 700)
    speeds = np.array([step.state.velocity[0] for step in found])
    assert speeds[[50, 200, 450, 699]] == pytest.approx([1.0, -0.5, -0.5, 0.25], abs=1e-12)


def test_a_body_on_a_rope_falls_freely_until_it_is_taut() -> None:
    rope, step = 0.2, 1e-3
    joint = Joint("rope", 0, WORLD, (0.0, 0.0, 0.15), (0.0, 0.0, 0.15), length=rope)
    found = steps(one_body(joint), start_of(), step, 400)
    falling = round(sqrt(2.0 * rope / G) / step) - 1
    assert found[falling - 1].problem is None
    assert heights(found)[falling - 1] == pytest.approx(-0.5 * G * (falling * step) ** 2, abs=1e-9)
    assert -heights(found)[-1] == pytest.approx(rope, abs=1.2 * DEPTH)
    assert found[-1].impulses / step == pytest.approx([2.0 * G], rel=1e-9)


def test_a_motor_spins_a_body_up_with_its_moment_and_then_holds_its_speed() -> None:
    """ω = τ t/J up to the target speed; the rule is exact for a constant moment."""
    moment, speed, step = 0.05, 1.0, 1e-3
    joint = Joint("revolute", 0, motor_speed=speed, motor_bound=moment)
    system = one_body(joint, 0.0)
    found = steps(system, start_of(), step, 200)
    rates = np.array([one.state.velocity[5] for one in found])
    times = step * np.arange(1, 201)
    assert rates == pytest.approx(np.minimum(moment * times / system.moments[0, 2], speed), abs=1e-9)
    assert rates[-1] == pytest.approx(speed, abs=1e-12)
    assert abs(found[-1].impulses[-1]) <= 1e-12  # the speed is reached


def test_a_motor_without_enough_force_lets_a_slider_fall_more_slowly() -> None:
    joint = Joint("prismatic", 0, axis=DOWN, motor_speed=-1.0, motor_bound=5.0)
    last = steps(one_body(joint), start_of(), 1e-3, 100)[-1].state
    assert last.velocity[2] == pytest.approx(-(G - 5.0 / 2.0) * last.time, rel=1e-9)


def test_a_motor_of_speed_zero_is_friction() -> None:
    def end(**given: float) -> np.ndarray[Any, Any]:
        joint = Joint("revolute", 0, axis=Y_AXIS, **given)
        return steps(one_body(joint, 0.0), start_of((0.0, 0.0, 0.0, 0.0, 2.0, 0.0)), 1e-3, 50)[-1].state.velocity

    assert (end(friction=0.1) == end(motor_bound=0.1)).all()
    assert 0.0 < end(friction=0.1)[4] < 2.0


@pytest.mark.parametrize("turned", [-3.0, -1.0, 2.0, 3.0])
def test_the_gap_of_a_limit_rises_with_the_rate_of_its_row(turned: float) -> None:
    """This holds beyond π too, where the angle of a rotation jumps."""
    joint = Joint("revolute", 0, axis=Y_AXIS, limits=(2.5, 4.0), rotation=tuple(about(Y_AXIS, 0.3)))
    joints = RigidJoints([joint], 1)
    poses = [np.array([[0.0, 0.0, 0.0, *about(Y_AXIS, turned + 0.3 + shift)]]) for shift in (-1e-6, 0.0, 1e-6)]
    before, (_, gap, rows), after = (joints.limits_below(pose, np.inf) for pose in poses)
    assert rows.toarray()[4] == pytest.approx((after[1] - before[1]) / 2e-6, abs=1e-8)
    assert gap.sum() == pytest.approx(4.0 - 2.5)
    assert 2.5 + gap[0] == pytest.approx(turned + 2.0 * pi * (turned < 0.2))


def test_limits_keep_their_keys_while_others_come_and_go() -> None:
    joints = RigidJoints(
        [Joint("prismatic", 0, axis=(1.0, 0.0, 0.0), limits=(0.0, 1.0)), Joint("rope", 1, length=1.0)], 2
    )
    both = np.array([[1.1, 0.0, 0.0, *IDENTITY], [2.0, 0.0, 0.0, *IDENTITY]])
    rope_only = both - np.array([[0.5, 0, 0, 0, 0, 0, 0], [0] * 7])
    keys = joints.rows_at(both, 1e-3).keys
    assert keys.tolist() == [0, 3, 4]
    assert joints.rows_at(rope_only, 1e-3).keys.tolist() == [0, 4]
    assert joints.limits_below(both, 0.0)[1] == pytest.approx([-0.1, -1.0])


def test_a_start_beyond_a_limit_is_refused() -> None:
    joints = RigidJoints([Joint("prismatic", 0, axis=DOWN, limits=(0.1, 1.0))], 1)
    with pytest.raises(ProblemError, match=r"joint 0 is 0\.1 m or rad beyond its limit at the start"):
        joints.check_start(np.array([[0.0, 0.0, 0.0, *IDENTITY]]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"limits": (1.0, 1.0)}, "finite and ascend"),
        ({"limits": (0.0, np.nan)}, "finite and ascend"),
        ({"limits": (-4.0, 4.0)}, "less than 2π apart"),
        ({"kind": "ball", "limits": (-1.0, 1.0)}, "no axis for limits"),
        ({"kind": "ball", "motor_bound": 1.0}, "no axis for motor_bound"),
        ({"motor_bound": -1.0}, "motor_bound of a joint"),
        ({"motor_speed": np.inf}, "motor_speed of a joint"),
        ({"restitution": 1.5}, "restitution of a joint"),
        ({"kind": "rope"}, "length of a rope joint"),
    ],
)
def test_inconsistent_limits_and_motors_are_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        replace(Joint("revolute", 0), **change)
