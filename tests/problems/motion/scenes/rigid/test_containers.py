"""Boxes in a rotating drum and in a hopper."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.containers import (
    BEVERLOO_COEFFICIENT,
    BEVERLOO_NARROWING,
    STAVES,
    DrivenRing,
    Hopper,
    RotatingDrum,
)
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create


def states_of(scene: RotatingDrum | Hopper, seconds: float) -> list[State]:
    rule = MidpointRule(scene.system(), create("Robust"), Stop(1e-4, 20_000), scene.step_size, depth=scene.depth)
    return [step.state for step in rule.steps(scene.start(), round(seconds / scene.step_size))]


@pytest.mark.parametrize(
    "scene", [RotatingDrum(), RotatingDrum(20, edge=0.02, layers=1), Hopper(), Hopper(7, layers=1)]
)
def test_boxes_start_apart_from_each_other_and_inside(scene: RotatingDrum | Hopper) -> None:
    system, start = scene.system(), scene.start()
    found = system.contacts_within(system.poses(start.position), 0.0)
    assert not (found.first < scene.n_boxes).any()


def test_staves_without_boxes_turn_as_a_ring() -> None:
    """Their speed is exact, and their distance from the axis has an error of second order in the step."""
    drum = RotatingDrum(1)
    last = states_of(drum, 1.0)[-1]
    poses, twists = last.position.reshape(-1, 7)[1:], last.velocity.reshape(-1, 6)[1:]
    distance = np.hypot(poses[:, 0], poses[:, 2])
    assert distance == pytest.approx(np.full(STAVES, drum.radius * 1.1), rel=1e-5)
    assert np.hypot(twists[:, 0], twists[:, 2]) == pytest.approx(drum.speed * distance, rel=1e-5)
    turned = np.unwrap(np.arctan2(poses[:, 0], poses[:, 2])) - 2.0 * np.pi * np.arange(STAVES) / STAVES
    assert np.mod(turned, 2.0 * np.pi) == pytest.approx(np.full(STAVES, 2.0), abs=1e-5)
    facing = 2.0 * np.arctan2(poses[:, 5], poses[:, 3])
    assert np.cos(facing - np.arctan2(poses[:, 0], poses[:, 2])) == pytest.approx(np.ones(STAVES), abs=1e-9)


def test_the_energy_of_a_drum_is_that_of_its_boxes_and_constant_while_they_fall() -> None:
    scene = make_scene("drum(n_boxes=6, layers=1)")
    assert list(scene.driven_bodies) == list(range(6, 6 + STAVES))
    assert scene.potential_energy is not None
    potential_energy = scene.potential_energy
    boxes = scene.start.position.reshape(-1, 7)[:6]
    mass = 1000.0 * 0.016**3
    assert scene.kinetic_energy(scene.start.velocity) == 0.0
    assert potential_energy(scene.start.position) == pytest.approx(mass * 9.81 * boxes[:, 2].sum(), rel=1e-12)
    rule = MidpointRule(scene.system, create("Robust"), Stop(1e-6, 1000), 1e-4)
    *_, last = (step.state for step in rule.steps(scene.start, 50))
    kinetic = scene.kinetic_energy(last.velocity)
    released = potential_energy(scene.start.position) - potential_energy(last.position)
    assert kinetic == pytest.approx(6 * 0.5 * mass * (9.81 * 5e-3) ** 2, rel=1e-9)
    assert kinetic == pytest.approx(released, rel=1e-6)


def test_the_ring_has_weight_on_boxes_and_centripetal_acceleration_on_the_others() -> None:
    centres = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, -0.6]])
    found = DrivenRing(1, 9.81, 2.0).accelerate(centres, np.zeros((2, 3)), np.ones(2))
    assert found == pytest.approx(np.array([[0.0, 0.0, -9.81], [-1.6, 0.0, 2.4]]))


@pytest.mark.weekly
def test_boxes_in_a_drum_climb_and_slump_at_angles_of_repose() -> None:
    drum = RotatingDrum(16, edge=0.02, layers=1)
    slopes = np.array([drum.slope(state) for state in states_of(drum, 0.8)])
    assert 25.0 < slopes[-200:].mean() < 45.0
    assert np.diff(slopes[200:]).min() < 0.0 < np.diff(slopes[200:]).max()


@pytest.mark.slow
def test_boxes_stick_together_and_turn_with_the_drum_until_they_slump() -> None:
    """At first the slope grows with the speed of the drum, once the boxes are at rest relative to it."""
    drum = RotatingDrum(6, edge=0.02, layers=1, friction=0.8)
    slopes = np.array([drum.slope(state) for state in states_of(drum, 0.4)])
    assert (slopes[-1] - slopes[-51]) / 0.1 == pytest.approx(np.degrees(drum.speed), rel=0.1)


@pytest.mark.slow
def test_beverloo_gives_the_order_of_the_flow_through_a_hopper() -> None:
    hopper = Hopper(60, layers=2)
    states = states_of(hopper, 0.35)
    through = np.array([hopper.boxes_through(state) for state in states])
    begin, end = np.searchsorted(through, [12, 48])
    rate = 36.0 / (states[end].time - states[begin].time)
    assert 0.5 * hopper.flow_rate < rate < 2.0 * hopper.flow_rate


def test_the_constant_of_a_slot_is_that_of_a_round_outlet_with_the_same_hydraulic_diameter() -> None:
    assert pytest.approx(0.58 * 4.0 / np.pi * np.sqrt(2.0), rel=0.02) == BEVERLOO_COEFFICIENT
    assert BEVERLOO_NARROWING == 1.4


def test_the_flow_by_beverloo_grows_with_the_slot_and_stops_below_it() -> None:
    assert Hopper(outlet=1.7).flow_rate == 0.0
    free = [outlet - 1.4 * (6.0 / np.pi) ** (1.0 / 3.0) for outlet in (5.0, 8.0)]
    assert Hopper(outlet=8.0).flow_rate / Hopper(outlet=5.0).flow_rate == pytest.approx((free[1] / free[0]) ** 1.5)


def _steps(times: list[float], through: list[int]) -> np.ndarray:
    return np.array(list(zip(times, through, strict=True)), dtype=[("time", "<f8"), ("boxes_through", "<i8")])


def test_a_hopper_ends_when_it_is_empty_or_jammed() -> None:
    find = Hopper(10).ending.find
    assert find(_steps([0.1, 0.2], [3, 9])) is None
    emptied = find(_steps([0.1, 0.2], [3, 10]))
    assert emptied is not None
    assert (emptied.name, emptied.is_success) == ("emptied", True)
    assert find(_steps([0.2, 0.6], [3, 3])) is None
    assert find(_steps([0.2, 0.7], [3, 4])) is None
    jammed = find(_steps([0.2, 0.701], [3, 3]))
    assert jammed is not None
    assert jammed.sentence == "jammed at 0.701 s: none of 7 boxes has passed the outlet for 0.5 s"
    assert not jammed.is_success


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("drum(n_boxes=500)", "500 boxes do not fit; at most"),
        ("drum(speed=20.0)", "boxes stick to a drum"),
        ("drum(layers=0)", "layers of a drum"),
        ("hopper(outlet=0.0)", "outlet of a hopper"),
    ],
)
def test_a_container_out_of_range_is_refused(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make_scene(text)
