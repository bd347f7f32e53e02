"""Errors of motions are 0 for the exact motion of a scene, and match a closed form for a wrong one."""

from collections.abc import Callable

import numpy as np
import pytest
from proxbench.bench.measure.trajectories.engines.description import BodyStates, Description, Motion
from proxbench.bench.measure.trajectories.engines.measurement import measure, motion_of
from proxbench.bench.measure.trajectories.engines.scenes import FACETS, SCENES, describe
from proxbench.problems.motion.scenes.funnel import CONE_HEIGHT, RADIUS
from proxbench.problems.motion.scenes.registry import make_scene

GRAVITY = 9.81


class ExactEngine:
    """An engine whose bodies all have one constant acceleration."""

    def __init__(self, description: Description, acceleration: tuple[float, float, float], time_step: float) -> None:
        self.start, self.acceleration = description.start(), np.array(acceleration)
        self.time_step, self.steps = time_step, 0
        self.remembered, self.asked = list[int](), list[int]()

    def step(self) -> None:
        self.steps += 1

    def states(self) -> BodyStates:
        time, start = self.steps * self.time_step, self.start
        positions = start.positions + time * start.velocities + 0.5 * time**2 * self.acceleration
        return BodyStates(positions, start.velocities + time * self.acceleration, start.spins)

    def store_state(self) -> None:
        self.remembered.append(self.steps)

    def solved_problem(self) -> None:
        self.asked.append(self.steps)


def errors_of(name: str, acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, ...]:
    description = describe(name)
    engine = ExactEngine(description, acceleration, description.step)
    motion, _, _, solved = measure(description, engine, description.step)
    assert engine.steps == round(description.duration / description.step)
    per_frame = round(description.frame / description.step)
    assert solved == []
    assert len(engine.remembered) == 10
    assert all(step % per_frame == 0 for step in engine.remembered)
    assert engine.asked == [step + 1 for step in engine.remembered]  # the step from the remembered state
    return description.measure(description, motion)


def moved(name: str, change: Callable[[np.ndarray], None]) -> tuple[float, ...]:
    """Return the errors of bodies that stay at the start until the last frame, which ``change`` changes."""
    description = describe(name)
    start = description.start()
    last = BodyStates(start.positions.copy(), np.zeros_like(start.positions), start.spins)
    change(last.positions)
    frames = [BodyStates(start.positions, 0.0 * start.velocities, start.spins), last]
    return description.measure(description, motion_of([0.0, description.duration], frames))


def test_a_thrown_cube_slows_down_by_mu_g() -> None:
    assert errors_of("thrown-cube", (-0.5 * GRAVITY, 0.0, 0.0)) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert errors_of("thrown-cube", (-0.4 * GRAVITY, 0.0, 0.0))[1] == pytest.approx(100 * 0.1 * GRAVITY / 6.0)


def test_a_cube_slides_down_an_incline_with_the_difference_of_weight_and_friction() -> None:
    angle = np.arctan(0.6)
    exact = GRAVITY * (np.sin(angle) - 0.5 * np.cos(angle))
    assert errors_of("incline-slide", (exact, 0.0, 0.0)) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert errors_of("incline-slide", (1.02 * exact, 0.0, 0.0))[0] == pytest.approx(2.0)


def test_a_cube_rests_on_a_flat_incline() -> None:
    assert errors_of("incline-rest") == (0.0, 0.0)
    assert errors_of("incline-rest", (2e-3, 0.0, 0.0))[0] == pytest.approx(1.0)
    gravity = describe("incline-rest").gravity
    assert np.linalg.norm(gravity) == pytest.approx(GRAVITY)
    assert -gravity[0] / gravity[2] == pytest.approx(0.4)


def test_a_stack_rests_on_the_floor_and_does_not_sink() -> None:
    assert errors_of("stack") == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)
    assert [body.mass for body in describe("stack").bodies] == [1.0, 10.0, 100.0]

    def sink(positions: np.ndarray) -> None:
        positions[1:, 2] -= 0.003

    def sink_into_the_floor(positions: np.ndarray) -> None:
        positions[:, 2] -= 0.002

    assert moved("stack", sink)[0] == pytest.approx(3.0)
    assert moved("stack", sink_into_the_floor)[0] == pytest.approx(2.0)

    def rise(positions: np.ndarray) -> None:
        positions[2, 2] += 0.1

    assert moved("stack", rise)[3] == pytest.approx(100.0 * 0.1 / (111.0 * 0.5))


def at_speeds(name: str, speeds: list[tuple[float, float, float]]) -> tuple[float, ...]:
    """Return the errors of bodies that stay at the start and have these velocities in the last frame [m/s]."""
    description = describe(name)
    start = description.start()
    frames = [BodyStates(start.positions, np.array(values), start.spins) for values in (0.0 * np.array(speeds), speeds)]
    return description.measure(description, motion_of([0.0, description.duration], frames))


def test_the_last_speed_of_a_stack_is_that_of_its_fastest_cube() -> None:
    assert at_speeds("stack", [(0.003, 0.0, 0.0), (0.0, 0.003, -0.004), (0.004, 0.0, 0.0)])[2] == pytest.approx(5.0)


def test_the_last_energy_of_a_pile_is_the_mean_of_its_balls() -> None:
    """Half of the balls move at 3 m/s along x and 4 m/s along z, which gives (m/2) 25/2 per ball."""
    speeds = [(3.0, 0.0, 4.0) if ball % 2 else (0.0, 0.0, 0.0) for ball in range(100)]
    assert at_speeds("pile", speeds)[1] == pytest.approx(0.5 * 12.5 / (GRAVITY * RADIUS))


@pytest.mark.parametrize("name", ["pile", "funnel"])
def test_overlap_is_that_of_the_nearest_balls_in_radii(name: str) -> None:
    assert moved(name, lambda positions: None)[0] == 0.0

    def push(positions: np.ndarray) -> None:
        positions[1] = positions[0] + (0.0, 0.0, 1.9 * RADIUS)
        positions[2:] += (0.0, 0.0, 1.0)

    assert moved(name, push)[0] == pytest.approx(0.1)


def test_balls_below_the_outlet_are_counted_as_discharged() -> None:
    def drop(positions: np.ndarray) -> None:
        positions[:7, 2] -= 1.0

    assert moved("funnel", drop)[2] == 7.0


def test_free_fall_gains_no_energy_and_a_lift_gains_its_height() -> None:
    scene = describe("funnel")
    engine = ExactEngine(scene, scene.gravity, scene.step)
    motion = measure(scene, engine, scene.step)[0]
    assert scene.energy_gained(motion) == pytest.approx(0.0, abs=1e-9)

    start = scene.start()
    higher = BodyStates(start.positions + np.array([0.0, 0.0, 3.0 * RADIUS]), start.velocities, start.spins)
    assert scene.energy_gained(motion_of([0.0, 1.0], [start, higher])) == pytest.approx(3.0)
    spinning = BodyStates(start.positions, start.velocities, start.spins + np.array([10.0, 0.0, 0.0]))
    spin = 0.5 * 0.4 * RADIUS**2 * 100.0 / (GRAVITY * RADIUS)
    assert scene.energy_gained(motion_of([0.0, 1.0], [start, spinning])) == pytest.approx(spin)


def test_a_spinning_cube_has_the_energy_of_its_inertia() -> None:
    """The moment of inertia is m a²/6 for a cube with edges of length a, and 2/5 m r² for a ball."""
    scene = describe("stack")
    assert [body.inertia for body in scene.bodies] == pytest.approx([body.mass * 0.5**2 / 6.0 for body in scene.bodies])
    start = scene.start()
    spins = start.spins.copy()
    spins[2] = (0.0, 3.0, 4.0)
    gained = scene.energy_gained(motion_of([0.0, 1.0], [start, BodyStates(start.positions, start.velocities, spins)]))
    assert gained == pytest.approx(0.5 * 100.0 * 0.5**2 / 6.0 * 25.0 / (111.0 * GRAVITY * 0.5))


@pytest.mark.parametrize("name", ["pile", "funnel"])
def test_balls_start_as_those_of_the_scene_of_proxbench(name: str) -> None:
    description = describe(name)
    start = make_scene(description.own_scene, description.own_options).start
    assert np.array_equal(description.start().positions, start.position.reshape(-1, 3))
    assert np.array_equal(description.start().velocities, start.velocity.reshape(-1, 6)[:, :3])


@pytest.mark.parametrize("angle", np.linspace(0.0, np.pi / FACETS, 4))
@pytest.mark.parametrize("height", [1e-6, 0.5 * CONE_HEIGHT, CONE_HEIGHT - 1e-3, CONE_HEIGHT + 0.1])
def test_panels_touch_the_round_funnel_from_outside(angle: float, height: float) -> None:
    radius = 4.5 * RADIUS + min(height, CONE_HEIGHT)
    behind = radius / np.cos(angle)  # for the facet whose middle is at angle 0
    assert not is_solid(radius * 0.999 * np.array([np.cos(angle), np.sin(angle), 0.0]), height)
    assert is_solid((behind + 1e-5) * np.array([np.cos(angle), np.sin(angle), 0.0]), height)
    assert not is_solid((behind - 1e-5) * np.array([np.cos(angle), np.sin(angle), 0.0]), height)


def is_solid(place: np.ndarray, height: float) -> bool:
    point = place + np.array([0.0, 0.0, height])
    inside = (
        np.abs(panel.rotation.T @ (point - panel.centre)) <= panel.half_sizes for panel in describe("funnel").panels
    )
    return any(bool(axes.all()) for axes in inside)


@pytest.mark.parametrize("name", SCENES)
def test_every_step_of_a_setting_divides_a_frame(name: str) -> None:
    scene = describe(name)
    for factor in (0.5, 1.0, 2.5):
        assert scene.frame / (factor * scene.step) == pytest.approx(round(scene.frame / (factor * scene.step)))
    assert isinstance(motion_of([0.0], [scene.start()]), Motion)
