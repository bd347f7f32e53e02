"""Boxes on an incline, thrown, tipping and in a stack, against their closed forms."""

from collections.abc import Iterator
from math import cos, sin, tan

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.boxes import BoxOnIncline, BoxStack, SlidingBox, ThrownBox, TippingBox
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Status, Stop, create


def steps(scene: SlidingBox | TippingBox | BoxStack, time_step: float, count: int) -> Iterator[Step]:
    moreau = MidpointRule(scene.system(), create("Robust"), Stop(1e-12, 100_000), time_step)
    for step in moreau.steps(scene.start(), count):
        assert step.status in (None, Status.SOLVED)
        yield step


def largest_errors(scene: SlidingBox, time_step: float, count: int) -> tuple[float, float]:
    """Return the largest errors of position and velocity."""
    position = velocity = 0.0
    for step in steps(scene, time_step, count):
        exact = scene.exact(step.state.time)
        position = max(position, float(np.abs(step.state.position - exact.position).max()))
        velocity = max(velocity, float(np.abs(step.state.velocity - exact.velocity).max()))
    return position, velocity


@pytest.mark.parametrize("turn", [0.0, 0.6])
@pytest.mark.parametrize(
    ("slope", "friction", "speed"), [(0.5, 0.4, 0.0), (0.5, 0.4, 1.0), (0.3, 0.31, 0.0), (0.0, 0.3, 0.0)]
)
def test_a_box_on_an_incline_follows_its_closed_form(slope: float, friction: float, speed: float, turn: float) -> None:
    """Accelerations are constant, so the only error of the midpoint rule is that of the solver."""
    scene = BoxOnIncline(slope=slope, friction=friction, speed=speed, turn=turn)
    position, velocity = largest_errors(scene, 1e-3, 200)
    assert position <= 1e-9
    assert velocity <= 1e-9


@pytest.mark.parametrize(("excess", "slides"), [(1e-4, True), (-1e-4, False)])
def test_a_box_slides_if_the_slope_exceeds_its_friction(excess: float, slides: bool) -> None:
    scene = BoxOnIncline(slope=0.4, friction=tan(0.4) - excess)
    *_, last = steps(scene, 1e-3, 100)
    expected = 9.81 * (sin(0.4) - scene.friction * cos(0.4)) * 0.1 if slides else 0.0
    assert np.linalg.norm(last.state.velocity[:3]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 4])
def test_a_thrown_box_slides_to_a_stop_and_does_not_lift(turn: float) -> None:
    scene = ThrownBox(turn=turn)
    stop = 6.0 / (0.5 * 9.81)
    lifts, time_step = [], 5e-3
    for step in steps(scene, time_step, 250):
        lifts.append(scene.lift(step.state))
        if step.state.time < stop - time_step:
            assert step.state.velocity[0] == pytest.approx(6.0 - 0.5 * 9.81 * step.state.time, abs=1e-8)
    assert step.state.time > stop
    assert np.abs(lifts).max() <= 1e-9
    assert np.abs(step.state.velocity).max() <= 1e-9
    assert step.state.position[0] == pytest.approx(6.0**2 / (2.0 * 0.5 * 9.81), abs=0.5 * 0.5 * 9.81 * time_step**2)


@pytest.mark.parametrize("name", ["box_on_incline", "box_on_incline(slope=0.3, speed=-1.0)", "thrown_box(turn=0.4)"])
def test_a_variable_step_follows_the_exact_motion_and_locates_the_stop(name: str) -> None:
    """Positions have more entries than velocities; extrapolated quaternions have unit length only up to their error."""
    scene = make_scene(name)
    taken = list(Extrapolated().steps(scene, create("SORprox"), Stop(1e-12, 100_000), scene.start, scene.duration))
    assert scene.exact is not None
    exact, last = scene.exact(taken[-1].end.time), taken[-1].end
    assert last.position == pytest.approx(exact.position, abs=1e-6)
    assert last.velocity == pytest.approx(exact.velocity, abs=1e-6)
    stops = [switch.end for step in taken for switch in step.switches if switch.after == "stick"]
    if name == "thrown_box(turn=0.4)":
        assert stops == pytest.approx([6.0 / (0.5 * 9.81)] * 4, abs=2e-9)


@pytest.mark.parametrize(("width", "tips"), [(0.99, True), (1.01, False)])
def test_a_box_tips_if_it_is_narrower_than_its_height_times_the_slope(width: float, tips: bool) -> None:
    height, slope = 0.25, 0.5
    scene = TippingBox(slope, size=(width * height * tan(slope), 0.1, height))
    assert scene.tips is tips
    *_, last = steps(scene, 1e-3, 100)
    if tips:  # the angle of an inverted pendulum grows slowly at first
        assert scene.tilt(last.state) > 0.9 * 0.5 * scene.angular_acceleration * 0.1**2 > 1e-4
    else:
        assert abs(scene.tilt(last.state)) <= 1e-9


def test_a_tipping_box_begins_with_the_angular_acceleration_of_its_closed_form_and_turns_about_its_edge() -> None:
    scene = TippingBox()
    assert scene.angular_acceleration == pytest.approx(
        1.5 * 9.81 * (0.25 * sin(0.5) - 0.1 * cos(0.5)) / (0.1**2 + 0.25**2), rel=1e-14
    )
    first = next(steps(scene, 1e-5, 1))
    assert first.state.velocity[4] == pytest.approx(scene.angular_acceleration * 1e-5, rel=1e-6)
    errors = []
    for time_step in (2e-3, 1e-3, 5e-4):
        *_, last = steps(scene, time_step, round(0.2 / time_step))
        errors.append(abs(last.state.velocity[4] - scene.angular_velocity(scene.tilt(last.state))))
    assert errors[0] < 0.02 * scene.angular_velocity(0.1)
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]


@pytest.mark.parametrize("friction", [None, 0.5])
@pytest.mark.parametrize("heavy_on_top", [False, True])
def test_a_stack_rests_and_its_lowest_contacts_carry_its_weight(friction: float | None, heavy_on_top: bool) -> None:
    scene = BoxStack(4, ratio=1000.0, heavy_on_top=heavy_on_top, friction=friction)
    for step in steps(scene, 1e-3, 20):
        assert scene.drift(step.state) <= 1e-9
    assert step.contacts is not None
    normal = step.contacts.normals(step.impulses)
    first, second, _ = scene.system()._keys.decode(step.contacts.keys)
    on_ground = normal[second >= 4].sum()
    assert on_ground == pytest.approx(scene.masses.sum() * 9.81 * 1e-3, rel=1e-9)
    heights: dict[int, float] = dict(enumerate(np.cumsum(scene.masses[::-1])[::-1] * 9.81 * 1e-3))
    for lower in range(3):
        carried = normal[(first == lower) & (second == lower + 1)].sum()
        assert carried == pytest.approx(heights[lower + 1], rel=1e-6)


@pytest.mark.parametrize(("solver", "tolerance"), [("Robust", 1e-6), ("NSGS", 1e-6)])
def test_a_stack_of_ten_equal_boxes_drifts_by_no_more_than_its_tolerance_allows(solver: str, tolerance: float) -> None:
    """A contact may open with the velocity τ max|c|, here τ g Δt; the top box drifts by the sum over ten contacts."""
    scene, time_step, count = BoxStack(10), 1e-2, 100
    rule = MidpointRule(scene.system(), create(solver), Stop(tolerance, 20_000), time_step)
    for step in rule.steps(scene.start(), count):
        assert step.contacts is not None
        assert step.contacts.n_contacts == 40
    assert scene.drift(step.state) <= scene.n_boxes * tolerance * 9.81 * time_step * count * time_step <= 1e-6


@pytest.mark.slow
def test_contacts_open_where_a_stack_overlaps_by_less_than_its_tolerance_allows() -> None:
    scene = BoxStack(10, overlap=1e-9)
    rule = MidpointRule(scene.system(), create("NSGS"), Stop(1e-6, 20_000), 1e-2)
    *_, last = rule.steps(scene.start(), 100)
    assert scene.drift(last.state) > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "heavy_on_top", "time_step"),
    [pytest.param(1e3, False, 1e-3, marks=pytest.mark.weekly), (1e6, True, 1e-2)],
)
def test_a_stack_of_ten_does_not_drift_in_ten_seconds(ratio: float, heavy_on_top: bool, time_step: float) -> None:
    """The uppermost box drifts by at most n τ g Δt T; solutions of ``Robust`` are ten times as accurate."""
    scene, tolerance, seconds = BoxStack(10, ratio, heavy_on_top), 1e-8, 10.0
    moreau = MidpointRule(scene.system(), create("Robust"), Stop(tolerance, 20_000, np.inf), time_step)
    for step in moreau.steps(scene.start(), round(seconds / time_step)):
        assert step.status is Status.SOLVED
        assert scene.drift(step.state) <= 0.1 * scene.n_boxes * tolerance * 9.81 * time_step * seconds


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("box_on_incline(slope=2.0)", "slope of an incline"),
        ("box_on_incline(size=(0.1, 0.2))", "size of a box must be three edge lengths"),
        ("box_on_incline(size=(0.1, 0.1, 0.5))", "simulate a tipping_box"),
        ("thrown_box(size=(0.1, 0.1, 0.3))", "tips if friction of 0.5"),
        ("thrown_box(mass=0.0)", "mass of a box must be positive"),
        ("tipping_box(friction=0.1)", "to hold its lower edge"),
        ("box_stack(n_boxes=0)", "n_boxes of a stack of boxes must be positive"),
        ("box_stack(ratio=0.5)", "ratio of a stack must be at least 1"),
        ("box_stack(overlap=0.2)", "overlap must be at least 0"),
        ("box_stack(n_boxes=3, overlap=0.02)", "penetrate by 0.02 m at the start; move them apart"),
        ("box_stack(n_boxes=1, overlap=0.02)", "body 0 and fixed body 0 penetrate by 0.02 m at the start"),
    ],
)
def test_error_names_the_invalid_parameter(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make_scene(text)


def test_the_scenes_are_in_the_registry_with_what_they_observe() -> None:
    observed = {"box_on_incline": "lift", "thrown_box": "lift", "tipping_box": "tilt", "box_stack": "drift"}
    for name, observable in observed.items():
        scene = make_scene(name)
        assert [one.name for one in scene.observables] == [observable, "farthest"]
        assert scene.observables[0].compute(scene.start) == pytest.approx(0.0, abs=1e-15)
        assert scene.potential_energy is not None
        assert isinstance(scene.start, State)
