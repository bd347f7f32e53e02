"""A spinning top precesses steadily, on a joint and on its tip."""

from dataclasses import dataclass, replace
from math import cos

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.contact.solver import Prepared
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.spinning_top import SpinningTop
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create


def last_state(scene: SpinningTop, seconds: float, count: int) -> State:
    rule = MidpointRule(scene.system(), create("Robust"), Stop(1e-12, 100_000), seconds / count)
    for step in rule.steps(scene.start(), count):
        assert step.status is Status.SOLVED
    return step.state


def energy(system: RigidBodies, state: State) -> float:
    assert system.potential_energy is not None
    return system.kinetic_energy(state.velocity) + system.potential_energy(state.position)


@pytest.mark.parametrize("fast", [False, True])
def test_the_closed_form_keeps_its_tip_its_energy_and_its_vertical_momentum(fast: bool) -> None:
    scene = SpinningTop(fast=fast)
    system, start = scene.system(), scene.start()
    assert system.joints is not None
    for time in (0.0, 0.17, 0.9):
        state = scene.exact(time)
        assert np.abs(system.joints.errors_at(system.poses(state.position)).residual).max() <= 1e-14
        assert scene.tilt_of(state) == pytest.approx(scene.tilt, abs=1e-14)
        assert energy(system, state) == pytest.approx(energy(system, start), rel=1e-13)
        assert scene.momentum(state) == pytest.approx(scene.momentum(start), rel=1e-13)
        moved = system.move(state.position, state.velocity, 1e-6)
        assert moved == pytest.approx(scene.exact(time + 1e-6).position, abs=2e-9)


@pytest.mark.parametrize("fast", [False, True])
def test_the_closed_form_has_the_angular_acceleration_of_its_weight(fast: bool) -> None:
    """The angular momentum about the tip turns about the vertical, and its rate is the moment m g l sin θ."""
    scene = SpinningTop(fast=fast)
    across, along = scene._moments
    own = along * scene.spin
    level = own * np.sin(scene.tilt) - across * scene.precession * np.sin(scene.tilt) * cos(scene.tilt)
    moment = scene.mass * scene.gravity * scene.lever * np.sin(scene.tilt)
    assert scene.precession * level == pytest.approx(moment, rel=1e-12)


def test_a_cone_has_its_centre_of_mass_at_three_quarters_and_both_roots_meet_at_the_smallest_spin() -> None:
    scene = SpinningTop()
    assert scene.lever == pytest.approx(0.75 * scene.height, rel=1e-12)
    slow, fast = (SpinningTop(spin=scene.min_spin * (1.0 + 1e-12), fast=fast).precession for fast in (False, True))
    assert slow == pytest.approx(fast, rel=1e-5)
    quick = SpinningTop(spin=1e4)
    across, along = quick._moments
    assert quick.precession == pytest.approx(quick.mass * 9.81 * quick.lever / (along * 1e4), rel=1e-3)
    assert SpinningTop(spin=1e4, fast=True).precession == pytest.approx(along * 1e4 / (across * cos(0.4)), rel=1e-3)


def test_gyroscopic_moments_do_no_work_on_a_joint() -> None:
    """The remaining error of the energy is that of gravity, which falls eightfold if the step is halved."""
    scene = SpinningTop()
    system, start = scene.system(), scene.start()
    errors = [abs(energy(system, last_state(scene, 0.2, n)) / energy(system, start) - 1.0) for n in (50, 100)]
    assert errors[0] <= 1e-5
    assert errors[1] <= errors[0] / 7.0


@dataclass
class Counting:
    """A solver that counts its solves."""

    solves: int = 0

    def prepare(self, problem: ContactProblem) -> Prepared:
        self.solves += 1
        return create("Robust").prepare(problem)


@pytest.mark.parametrize(("is_gyroscopic", "solves"), [(True, 2), (False, 1)])
def test_a_step_is_solved_twice_only_if_it_has_gyroscopic_moments(is_gyroscopic: bool, solves: int) -> None:
    scene, solver = SpinningTop(), Counting()
    system = replace(scene.system(), is_gyroscopic=is_gyroscopic)
    [step] = MidpointRule(system, solver, Stop(1e-10, 1000), 1e-3).steps(scene.start(), 1)
    assert solver.solves == solves
    assert step.status is Status.SOLVED


def test_the_tip_slides_if_its_friction_is_below_that_of_its_circle() -> None:
    scene = SpinningTop(fast=True, friction=10.0)
    least = scene.holding_friction
    assert least == pytest.approx(scene.lever * np.sin(0.4) * scene.precession**2 / 9.81)
    with pytest.raises(ProblemError, match="to hold its tip"):
        SpinningTop(fast=True, friction=0.99 * least)


@pytest.mark.parametrize(
    ("options", "words"),
    [("spin=10.0", "raise it"), ("tilt=1.0", "reaches the ground"), ("height=-1.0", "height of a spinning top")],
)
def test_a_top_that_cannot_precess_steadily_is_refused(options: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make_scene(f"spinning_top({options})")


def test_the_scene_observes_tilt_and_momentum() -> None:
    scene = make_scene("spinning_top")
    assert [one.name for one in scene.observables][:2] == ["tilt", "momentum"]
    assert scene.observables[0].compute(scene.start) == pytest.approx(0.4)
