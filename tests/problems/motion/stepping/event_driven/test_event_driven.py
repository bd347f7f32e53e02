"""Event-driven motion against the woodpecker's published limit cycle and against closed forms."""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, sin, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.motion.bodies.balls import SPHERE_INERTIA
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.bouncing import BouncingBall
from proxbench.problems.motion.scenes.inclines import BlockOnIncline, SlidingSphere
from proxbench.problems.motion.scenes.scene import bare_scene
from proxbench.problems.motion.scenes.woodpecker import DESCENT, PERIOD, published_start, section_start, woodpecker
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.event_driven.event_driven import EventDriven
from proxbench.problems.motion.stepping.event_driven.integration import Integration
from proxbench.problems.motion.stepping.event_driven.motion import AccumulationError, Motion, MotionError
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Solution, Status, Stop, create

from ...general_ball import general_start, general_system
from ..published_cycle import SWITCH_EVENTS, TIMES

NORMAL_IMPULSES = (4.7907580039e-05, 0.0012845029298, 0.00018723394475, 8.0323966803e-05, 1.1379247394e-05)
"""Λ_N [N s] of the five impacts of a period; published limit cycle computed with 45 digits."""


def simulate(system: MechanicalSystem, start: State, until: float, solver: Any = None, **options: Any) -> Motion:
    scene = bare_scene("own", {}, system, start)
    return EventDriven(**options).simulate(scene, solver or create("Enumeration"), Stop(1e-12), start, until)


def cycle(periods: float) -> Motion:
    """Return the motion that starts at the section, without the event at its start."""
    motion = simulate(woodpecker(), section_start(), periods * PERIOD)
    return Motion([event for event in motion.events if event.time > 1e-6], motion.phases, motion.end)


def test_one_period_of_the_woodpecker_has_the_published_events() -> None:
    motion = cycle(1.001)
    found = [(event.law, event.contact + 1, event.before, event.after) for event in motion.events]
    assert found == [incident[1:] for incident in SWITCH_EVENTS]
    assert [event.time for event in motion.events] == pytest.approx(TIMES, abs=1e-12)
    struck = [event.impulses for event in motion.events if event.after == "closed"]
    assert [impulses[0] for impulses in struck] == pytest.approx(NORMAL_IMPULSES, rel=1e-9)
    assert [impulses[1] / impulses[0] for impulses in struck] == pytest.approx([0.3, -0.3, -0.3, 0.3, 0.3], rel=1e-9)


@pytest.mark.weekly
def test_woodpecker_returns_to_the_section_lower_by_its_descent() -> None:
    motion = cycle(3.001)
    begins = [event for event in motion.events if event.law == "friction" and event.after == "slip"]
    assert len(begins) == 3
    section = section_start()
    for count, event in enumerate(begins, start=1):
        assert event.time == pytest.approx(count * PERIOD, abs=1e-11)
        assert event.state.position[0] == pytest.approx(-count * DESCENT, abs=1e-12)
        assert event.state.position[1:] == pytest.approx(section.position[1:], abs=1e-11)
        assert event.state.velocity == pytest.approx(section.velocity, abs=1e-9)


@pytest.mark.slow
def test_time_stepping_converges_to_the_event_driven_motion() -> None:
    """No other reference is known away from the cycle, over twelve events; single errors are erratic."""
    until, errors = 0.13, []
    motion = simulate(woodpecker(), published_start(), until)
    for steps in (250, 2250):
        state = motion.at(0.0)  # the reference removes the penetration of 9e-7 m by rounding of the published numbers
        for step in MidpointRule(woodpecker(), create("SORprox"), Stop(1e-12), until / steps).steps(state, steps):
            state = step.state
        errors.append(float(np.abs(state.position - motion.end.position).max()))
    assert errors[0] <= 0.3
    assert errors[1] <= errors[0] / 5.0


def test_bouncing_ball_raises_at_the_accumulation_point() -> None:
    ball = BouncingBall()
    with pytest.raises(AccumulationError, match=r"accumulate at t = 1\.3545709.*time-stepping method") as raised:
        simulate(general_system(ball), general_start(ball), 2.0)
    error = raised.value
    assert error.accumulation_time == pytest.approx(ball.rest_time, abs=1e-9)
    assert error.impacts == len(error.motion.events) / 2 == 25
    for impact, event in enumerate(error.motion.events[::2]):
        assert event.time == pytest.approx(ball.impact_time(impact), abs=1e-10)
        assert event.impulses[0] == pytest.approx(1.5 * 0.5**impact * sqrt(2.0 * 9.81), abs=1e-10)
    for time in np.linspace(0.0, 0.99 * ball.rest_time, 50):
        assert error.motion.at(time).position[0] == pytest.approx(ball.exact(time).position[2], abs=1e-11)


def test_impacts_of_one_contact_accumulate_although_a_contact_before_it_hits_for_the_first_time() -> None:
    """Contact 1 has hit at 0 and 1 s, and hits again at 1.25 s together with contact 0."""
    motion = SimpleNamespace(_impact_times={1: [0.0, 1.0]}, time=1.25, flight=0.5, motion=lambda: None)
    with pytest.raises(AccumulationError) as raised:
        Integration._check_accumulation(motion, np.array([True, True]))  # type: ignore[arg-type]
    assert raised.value.impacts == 3
    assert raised.value.accumulation_time == pytest.approx(1.25 + 0.25 / 3.0)


def test_steps_of_a_motion_join_and_none_takes_longer_than_the_longest_step() -> None:
    """A fall of 0.45 s and the following rest are divided into steps."""
    ball = BouncingBall(restitution=0.0)
    start = general_start(ball)
    scene = bare_scene("own", {}, general_system(ball), start)
    stepper = EventDriven(max_step=0.1)
    steps = list(stepper.steps(scene, create("Enumeration"), Stop(1e-12), start, 1.0))
    assert steps[0].begin is start
    assert all(after.begin is before.end for before, after in pairwise(steps))
    assert max(step.end.time - step.begin.time for step in steps) <= 0.1 + 1e-12
    assert steps[-1].end.time == 1.0
    assert [switch.after for step in steps for switch in step.switches] == ["closed"]


def test_ball_without_restitution_stays_on_the_ground_after_impact() -> None:
    ball = BouncingBall(restitution=0.0)
    motion = simulate(general_system(ball), general_start(ball), 2.0)
    assert [(event.before, event.after) for event in motion.events] == [("open", "closed")]
    assert motion.events[0].time == pytest.approx(ball.fall_time, abs=1e-13)
    assert motion.end.position[0] == pytest.approx(ball.radius, abs=1e-14)


@pytest.mark.parametrize(
    ("block", "events"),
    [
        (BlockOnIncline(0.3, 0.5, 0.0), []),
        (BlockOnIncline(0.5, 0.2, 0.0), []),
        (BlockOnIncline(0.4, np.tan(0.4) - 1e-9, 0.0), []),
        (BlockOnIncline(0.3, 0.5, -1.0), ["stick"]),
        (BlockOnIncline(0.3, 0.5, 1.0), ["stick"]),
        (BlockOnIncline(0.5, 0.2, -1.0), []),
        (BlockOnIncline(0.0, 0.0, 1.0), []),
    ],
)
def test_a_block_slides_stops_turns_or_stays_as_in_closed_form(block: BlockOnIncline, events: list[str]) -> None:
    """A reversal of slip does not change the state of the contact, and is not listed as an event."""
    motion = simulate(block.system(), block.start(), 1.0)
    assert [event.after for event in motion.events] == events
    if events:
        assert motion.events[0].time == pytest.approx(block.stop_time, abs=1e-12)
    for time in (0.1, 0.3, 1.0):
        state, exact = motion.at(time), block.exact(time)
        assert state.position[0] == pytest.approx(exact.position[0], abs=1e-12)
        assert state.velocity[0] == pytest.approx(exact.velocity[0], abs=1e-12)


def test_a_sliding_sphere_begins_to_roll_at_the_known_time() -> None:
    """q = (x, z, φ) with φ positive if it rolls forwards, γ_T = ẋ − r φ̇."""
    scene = SlidingSphere()
    radius = scene.radius
    system = constant_system(
        [1.0, 1.0, SPHERE_INERTIA * radius**2],
        [0.0, -9.81, 0.0],
        [[0.0, 1.0], [1.0, 0.0], [0.0, -radius]],
        [0.3],
        lambda q: q[1:2] - radius,
    )
    start = State(0.0, np.array([0.0, radius, 0.0]), np.array([scene.speed, 0.0, 0.0]))
    motion = simulate(system, start, 1.0)
    assert [(event.before, event.after) for event in motion.events] == [("slip", "stick")]
    assert motion.events[0].time == pytest.approx(scene.rolling_time, abs=1e-13)
    exact = scene.exact(1.0)
    assert motion.end.position[0] == pytest.approx(exact.position[0], abs=1e-12)
    assert motion.end.velocity[[0, 2]] == pytest.approx(exact.velocity[[0, 4]], abs=1e-11)


def constant_system(
    mass: list[float], force: list[float], directions: list[list[float]], friction: list[float], gap: Any
) -> MechanicalSystem:
    matrix, applied, columns = np.diag(mass), np.array(force), np.array(directions)
    return MechanicalSystem(
        mass=lambda q: matrix,
        force=lambda q, u: applied,
        gap=gap,
        directions=lambda q: columns,
        friction=friction,
        restitution_normal=np.zeros(len(friction)),
        restitution_tangential=np.zeros(len(friction)),
        rows_per_contact=columns.shape[1] // len(friction),
    )


def test_a_bar_lands_on_three_supports_at_once_and_stays() -> None:
    """q = (z, φ); three supports over-determine it, and the impact hits all of them in one problem."""
    arms = np.array([-0.5, 0.0, 0.5])
    bar = constant_system(
        [1.0, 1.0 / 12.0], [-9.81, 0.0], [[1.0] * 3, arms.tolist()], [0.0] * 3, lambda q: q[0] + arms * q[1]
    )
    motion = simulate(bar, State(0.0, np.array([0.2, 0.0]), np.zeros(2)), 1.0)
    assert [(event.contact, event.after) for event in motion.events] == [(0, "closed"), (1, "closed"), (2, "closed")]
    assert {event.time for event in motion.events} == {motion.events[0].time}
    assert motion.events[0].time == pytest.approx(sqrt(0.4 / 9.81), abs=1e-13)
    assert sum(event.impulses[0] for event in motion.events) == pytest.approx(sqrt(2.0 * 9.81 * 0.2), rel=1e-12)
    assert np.abs(motion.end.position).max() <= 1e-12


RADIUS = 0.7


def bowl() -> MechanicalSystem:
    """A point mass inside a circular bowl without friction: g = R − |q|."""
    mass = np.eye(2)
    return MechanicalSystem(
        mass=lambda q: mass,
        force=lambda q, u: np.array([0.0, -9.81]),
        gap=lambda q: np.array([RADIUS - np.hypot(*q)]),
        directions=lambda q: -q[:, None] / np.hypot(*q),
        friction=[0.0],
        restitution_normal=[0.0],
        restitution_tangential=[0.0],
        rows_per_contact=1,
    )


def bowl_rates(position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    distance = np.hypot(*position)
    return np.array([(position @ velocity) ** 2 / distance**3 - velocity @ velocity / distance])


def test_directions_that_turn_with_the_motion_keep_constraint_and_energy() -> None:
    start = State(0.0, np.array([RADIUS * sin(1.2), -RADIUS * cos(1.2)]), np.zeros(2))
    motion = simulate(replace(bowl(), direction_rates=bowl_rates), start, 1.5)
    assert not motion.events
    for time in np.linspace(0.0, 1.5, 20):
        state = motion.at(time)
        assert np.hypot(*state.position) == pytest.approx(RADIUS, abs=1e-11)
        energy = 0.5 * state.velocity @ state.velocity + 9.81 * state.position[1]
        assert energy == pytest.approx(-9.81 * RADIUS * cos(1.2), abs=1e-10)


def test_point_on_a_circle_detaches_at_the_height_of_the_closed_form() -> None:
    """From the bottom with v² = 4 g R, the cosine of the angle from the top is (v²/gR − 2)/3 when contact is lost."""
    start = State(0.0, np.array([0.0, -RADIUS]), np.array([sqrt(4.0 * 9.81 * RADIUS), 0.0]))
    motion = simulate(replace(bowl(), direction_rates=bowl_rates), start, 0.6)
    first = motion.events[0]
    assert (first.before, first.after) == ("closed", "open")
    assert first.state.position[1] == pytest.approx(RADIUS * 2.0 / 3.0, abs=1e-11)


def test_rotating_directions_require_direction_rates() -> None:
    start = State(0.0, np.array([RADIUS * sin(1.2), -RADIUS * cos(1.2)]), np.zeros(2))
    with pytest.raises(ProblemError, match="direction_rates"):
        simulate(bowl(), start, 0.5)


def test_painleve_slip_ends_with_an_error() -> None:
    """The rod of the theory page, with μ = 2 and slip against its asymmetry: G_NN − μ |G_NT| < 0 (Painlevé)."""
    root = np.linalg.cholesky(np.array([[1.87577975, -1.36394614], [-1.36394614, 3.12422025]])).T
    rod = constant_system([1.0, 1.0], (-9.81 * root[:, 0]).tolist(), root.tolist(), [2.0], lambda q: root[:, :1].T @ q)
    sliding = np.linalg.solve(root.T, [0.0, -1.0])
    with pytest.raises(MotionError, match="Painlevé"):
        simulate(rod, State(0.0, np.zeros(2), sliding), 1.0)


@pytest.mark.parametrize("gap", [5e-7, -5e-7])
def test_a_start_that_touches_up_to_rounding_is_put_onto_its_contact_and_stays_there(gap: float) -> None:
    block = BlockOnIncline(slope=0.3, friction=0.5, speed=1.0)
    motion = simulate(block.system(), State(0.0, np.array([0.0, gap]), np.array([1.0, 0.0])), 0.1)
    for time in (0.0, 0.05, 0.1):
        assert motion.at(time).position[1] == pytest.approx(0.0, abs=1e-15)
    assert motion.at(0.0).position[0] == 0.0


def test_penetrating_start_is_refused() -> None:
    ball = BouncingBall()
    with pytest.raises(MotionError, match=r"contact 0 penetrates by 1\.00e-03 m"):
        simulate(general_system(ball), State(0.0, np.array([ball.radius - 1e-3]), np.zeros(1)), 1.0)


@pytest.mark.parametrize(
    ("broken", "what"),
    [
        ({"mass": lambda q: np.zeros((1, 1))}, "t = 0 s: the mass matrix .* is not positive definite"),
        ({"directions": lambda q: np.ones((1, 2))}, r"t = 0 s: the shape of the directions W\(q\) is \(1, 2\)"),
        ({"gap": lambda q: np.ones(2)}, r"t = 0 s: the shape of the gaps g\(q\) is \(2,\)"),
        ({"gap": lambda q: np.full(1, np.nan)}, r"t = 0 s: the gaps g\(q\) contain NaN"),
        ({"force": lambda q, u: np.ones(2)}, r"t = 0 s: the shape of the forces h\(q, u\) is \(2,\)"),
        ({"force": lambda q, u: [1.0 / 0.0]}, "t = 0 s .* ZeroDivisionError"),
    ],
)
def test_invalid_system_is_an_error_with_the_time(broken: dict[str, Any], what: str) -> None:
    ball = BouncingBall()
    with pytest.raises(MotionError, match=what) as raised:
        simulate(replace(general_system(ball), **broken), general_start(ball), 1.0)
    assert raised.value.motion.end.time == 0.0


@pytest.mark.parametrize(
    ("failing", "what"),
    [
        ({"force": lambda q, u: np.full(1, np.nan if q[0] < 0.5 else -9.81)}, "no longer finite at t = 0"),
        ({"mass": lambda q: np.eye(1) * (q[0] > 0.5)}, "after t = 0 s .* Singular matrix"),
    ],
)
def test_a_system_that_fails_on_the_way_ends_the_motion(failing: dict[str, Any], what: str) -> None:
    ball = BouncingBall()
    assert general_start(ball).position[0] > 0.5
    with pytest.raises(MotionError, match=what):
        simulate(replace(general_system(ball), **failing), general_start(ball), 1.0)


@dataclass(frozen=True)
class Refusing:
    """Returns zeros for any problem."""

    problem: ContactProblem | None = None

    def prepare(self, problem: ContactProblem) -> "Refusing":
        return Refusing(problem)

    def solve(self, stop: Stop, start: np.ndarray | None = None) -> Solution:
        assert self.problem is not None
        return Solution(np.zeros(self.problem.n_rows), Status.SOLVED, 0)


def test_wrong_solution_raises_and_the_motion_so_far_is_kept() -> None:
    ball = BouncingBall()
    with pytest.raises(MotionError, match=r"residual .* for the impact law") as raised:
        simulate(general_system(ball), general_start(ball), 1.0, Refusing())
    assert raised.value.motion.end.time == pytest.approx(ball.fall_time, abs=1e-13)
    assert raised.value.motion.end.velocity[0] == pytest.approx(-9.81 * ball.fall_time, rel=1e-12)


def test_time_outside_the_motion_is_refused() -> None:
    ball = BouncingBall()
    motion = simulate(general_system(ball), general_start(ball), 0.3)
    assert motion.at(0.3).position[0] == motion.end.position[0]
    for time in (-0.1, 0.31):
        with pytest.raises(MotionError, match="no state"):
            motion.at(time)


def test_error_names_the_invalid_argument() -> None:
    spatial = constant_system([1.0] * 3, [0.0] * 3, np.eye(3).tolist(), [0.3], lambda q: q[:1])
    with pytest.raises(ProblemError, match="planar"):
        simulate(spatial, State(0.0, np.zeros(3), np.zeros(3)), 1.0)
    ball = BouncingBall()
    with pytest.raises(ProblemError, match="flight"):
        simulate(general_system(ball), general_start(ball), 1.0, flight=0.0)
    with pytest.raises(ProblemError, match="until"):
        simulate(general_system(ball), general_start(ball), -1.0)
