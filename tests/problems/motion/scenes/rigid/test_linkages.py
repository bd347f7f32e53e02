"""Pendulum, chains and four-bar linkage against their closed forms."""

from dataclasses import replace
from math import cos

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.linkages import BallOnChain, Chain, FourBar, Pendulum
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step, StepError
from proxbench.solvers import Stop, create

DEPTH = 1e-6


def last_steps(system: RigidBodies, start: State, step: float, count: int, depth: float | None = DEPTH) -> list[Step]:
    rule = MidpointRule(system, create("Robust"), Stop(1e-12, 100_000), step, depth=depth)
    return list(rule.steps(start, count))


def energy(system: RigidBodies, state: State) -> float:
    assert system.potential_energy is not None
    return system.kinetic_energy(state.velocity) + system.potential_energy(state.position)


def joint_error(system: RigidBodies, state: State) -> float:
    assert system.joints is not None
    return float(np.abs(system.joints.errors_at(system.poses(state.position)).residual).max())


def test_a_pendulum_returns_after_its_period() -> None:
    """This tests the closed form itself: it conserves energy, and returns to its start after a period."""
    scene = Pendulum(angle=2.0)
    system, start = scene.system(), scene.start()
    for time in (0.1, 0.3, 0.7, scene.period):
        assert energy(system, scene.exact(time)) == pytest.approx(energy(system, start), abs=1e-12)
        assert joint_error(system, scene.exact(time)) <= 1e-14
    assert scene.exact(scene.period).position == pytest.approx(start.position, abs=1e-12)
    ahead, behind = (scene.angle_of(scene.exact(0.4 + shift)) for shift in (1e-5, -1e-5))
    assert scene.exact(0.4).velocity[4] == pytest.approx((ahead - behind) / 2e-5, abs=1e-8)


@pytest.mark.parametrize("depth", [None, DEPTH])
def test_the_angle_of_a_pendulum_converges_with_order_two(depth: float | None) -> None:
    scene, errors = Pendulum(), []
    for count in (25, 50, 100):
        end = last_steps(scene.system(), scene.start(), 0.5 / count, count, depth)[-1].state
        errors.append(abs(scene.angle_of(end) - scene.angle_of(scene.exact(0.5))))
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.15)


def test_projection_takes_the_drift_of_joints_out() -> None:
    scene = Chain(n_links=3)
    free, held = (
        joint_error(scene.system(), last_steps(scene.system(), scene.start(), 5e-3, 100, depth)[-1].state)
        for depth in (None, DEPTH)
    )
    assert free > 1e-6
    assert held <= 1e-11


@pytest.mark.slow
def test_friction_of_a_joint_turns_a_pendulum_where_its_work_has_taken_the_energy() -> None:
    """The pendulum turns back at θ₁ < 0 with m g (L/2) (cos θ₁ − cos θ₀) = τ (θ₀ − θ₁)."""
    scene, moment = Pendulum(), 0.3
    steps = last_steps(scene.system(moment), scene.start(), 2e-3, 500)
    turning = min(scene.angle_of(step.state) for step in steps)
    lost = 0.5 * 9.81 * (cos(turning) - cos(1.0))
    assert lost == pytest.approx(moment * (1.0 - turning), rel=1e-3)


def test_friction_of_a_joint_holds_a_pendulum_below_the_slip_angle() -> None:
    scene = Pendulum(angle=0.2)
    end = last_steps(scene.system(0.5 * 9.81 * np.sin(0.21)), scene.start(), 5e-3, 40)[-1].state
    assert scene.angle_of(end) == pytest.approx(0.2, abs=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 1e4])
def test_joints_of_a_hanging_chain_carry_the_weights_below(ratio: float) -> None:
    scene = BallOnChain(ratio=ratio, angle=0.0)
    system, step = scene.system(), 1e-3
    [first] = last_steps(system, scene.start(), step, 1)
    weights = 9.81 * np.cumsum(system.masses[::-1])[::-1]
    assert first.impulses.reshape(-1, 3)[:, 2] / step == pytest.approx(weights, rel=1e-6)
    assert np.abs(first.state.velocity).max() <= 1e-9


def test_two_rods_swing_with_the_known_frequencies() -> None:
    """Thin rods: ω² = 3 (1 ∓ 2/√7) g/L; these are 0.05 thick."""
    frequencies, _ = Chain(n_links=2, length=1.0).normal_modes()
    assert frequencies**2 == pytest.approx(3.0 * 9.81 * (1.0 + np.array([-2.0, 2.0]) / np.sqrt(7.0)), rel=5e-3)


@pytest.mark.parametrize("mode", [0, 1])
def test_a_chain_in_a_normal_mode_swings_with_its_frequency(mode: int) -> None:
    scene = Chain(n_links=2)
    frequencies, modes = scene.normal_modes()
    start = scene.state(1e-4 * modes[:, mode] / np.abs(modes[:, mode]).max())
    count = 100
    end = last_steps(scene.system(), start, np.pi / frequencies[mode] / count, count)[-1].state
    assert end.position.reshape(-1, 7)[:, 5] == pytest.approx(-start.position.reshape(-1, 7)[:, 5], abs=2e-7)


def test_the_energy_error_of_a_chain_falls_with_the_square_of_the_step() -> None:
    """Joints do no work in a step; the remaining error is that of gravity and of the projection."""
    scene, errors = Chain(n_links=3), []
    system, start = scene.system(), scene.start()
    for step in (1e-2, 5e-3):
        steps = last_steps(system, start, step, round(0.3 / step))
        errors.append(max(abs(energy(system, one.state) - energy(system, start)) for one in steps))
    assert errors[1] <= 0.3 * errors[0]


def test_a_four_bar_linkage_follows_its_kinematics_and_keeps_its_energy() -> None:
    scene = FourBar()
    system, start = scene.system(), scene.start()
    assert joint_error(system, start) <= 1e-15
    assert system.joints is not None
    directions = system.joints.errors_at(system.poses(start.position)).directions
    assert directions.T @ start.velocity == pytest.approx(0.0, abs=1e-14)
    end = last_steps(system, start, 2e-3, 200)[-1].state
    turned = -2.0 * np.arctan2(end.position[5], end.position[3])
    expected = scene.state(turned, -end.velocity[4])
    assert turned > scene.angle + 0.5
    assert end.position.reshape(-1, 7)[:, :3] == pytest.approx(expected.position.reshape(-1, 7)[:, :3], abs=1e-10)
    assert system.kinetic_energy(end.velocity) == pytest.approx(system.kinetic_energy(start.velocity), rel=1e-3)


def test_a_crank_that_cannot_turn_is_refused() -> None:
    with pytest.raises(ProblemError, match="cannot turn fully"):
        FourBar(crank=0.9)
    with pytest.raises(ProblemError, match="length of a pendulum"):
        replace(Pendulum(), length=0.0)


@pytest.mark.weekly
def test_a_heavy_ball_swings_on_a_light_chain_without_drift() -> None:
    scene = BallOnChain()
    system, start = scene.system(), scene.start()
    end = last_steps(system, start, scene.step_size, 20)[-1].state
    assert joint_error(system, end) <= 1e-10
    gained = energy(system, end) - energy(system, start)
    assert abs(gained) <= 1e-5 * system.kinetic_energy(end.velocity)


def test_a_step_too_long_for_the_rods_of_a_heavy_ball_ends_with_a_sentence() -> None:
    scene = BallOnChain()
    with pytest.raises(StepError, match=r"joints stay open by .* shorten the step"):
        last_steps(scene.system(), scene.start(), 1e-2, 20)


def test_velocities_do_not_open_the_joints_of_a_linkage_for_long() -> None:
    """The velocity across the joints is removed at each step; without projection it changes sign and grows."""
    scene, open_rates = FourBar(), []
    system, start = scene.system(), scene.start()
    assert system.joints is not None
    for depth in (None, DEPTH):
        end = last_steps(system, start, 1e-2, 100, depth)[-1].state
        open_rates.append(np.abs(system.joints.errors_at(system.poses(end.position)).directions.T @ end.velocity).max())
    assert open_rates[0] > 1e-4
    assert open_rates[1] <= 1e-13


@pytest.mark.parametrize("name", ["pendulum", "chain", "ball_on_chain", "four_bar"])
def test_scenes_of_linkages_close_their_joints(name: str) -> None:
    scene = make_scene(name)
    assert scene.depth == DEPTH
    [opening] = [one for one in scene.observables if one.name == "opening"]
    assert opening.compute(scene.start) <= 1e-12
