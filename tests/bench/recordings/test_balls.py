"""A recording of balls shows where they are, how they turn, and what pushes them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.recordings.balls import BallRecorder
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.scenes.effects import Friction, Gravity, Planar, ball_system
from proxbench.problems.motion.scenes.funnel import STANDARD_EFFECTS, TIME_STEP, Funnel
from proxbench.problems.motion.scenes.scene import Observable
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Stop, create
from scipy.spatial.transform import Rotation

RADIUS, SPEED, MASS, DT = 0.05, 0.3, 0.2, 1e-3


def rolling_ball(dimension: int) -> tuple[BallSystem, State]:
    """A ball that rolls to the right on a plane without slipping."""
    extra = [Planar()] if dimension == 2 else []
    ground = Plane((0.0,) * dimension, (*[0.0] * (dimension - 1), 1.0))
    system = ball_system(np.array([RADIUS]), np.array([MASS]), [ground], [Gravity(), Friction(0.5), *extra])
    centre = np.zeros(dimension)
    centre[-1] = RADIUS - 1e-9
    velocity = np.zeros(system.dofs_per_ball)
    velocity[0] = SPEED
    velocity[-1 if dimension == 2 else 4] = -SPEED / RADIUS if dimension == 2 else SPEED / RADIUS
    return system, State(0.0, centre, velocity)


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rolling_ball_turns_by_its_path_over_its_radius(
    dimension: int, tmp_path: Path, read_back: Callable[[Path], Any]
) -> None:
    system, state = rolling_ball(dimension)
    stepper = MidpointRule(system, create("SORprox"), Stop(1e-12, 1000), DT)
    with BallRecorder(system, tmp_path / "a.rrd", gravity=9.81) as recorder:
        recorder.start(state)
        for step in stepper.steps(state, 200):
            recorder(step)
    content = read_back(tmp_path / "a.rrd")
    places = content.over_time("/scene/bodies/0", "InstancePoses3D:translations")
    turns = content.over_time("/scene/bodies/0", "InstancePoses3D:quaternions")
    assert list(places) == list(range(201))
    np.testing.assert_allclose(places[200][0], [SPEED * 0.2, 0.0, RADIUS], atol=1e-6)
    turned = Rotation.from_quat(turns[200][0]).as_rotvec()
    np.testing.assert_allclose(turned, [0.0, SPEED * 0.2 / RADIUS, 0.0], atol=1e-5)


def test_a_ball_at_rest_is_carried_by_an_upward_impulse_below_it(
    tmp_path: Path, read_back: Callable[[Path], Any]
) -> None:
    system, state = rolling_ball(3)
    state = State(0.0, state.position, 0.0 * state.velocity)
    stepper = MidpointRule(system, create("SORprox"), Stop(1e-12, 1000), DT)
    with BallRecorder(system, tmp_path / "a.rrd", gravity=9.81) as recorder:
        recorder.start(state)
        for step in stepper.steps(state, 5):
            recorder(step)
    content = read_back(tmp_path / "a.rrd")
    (arrow,) = content.over_time("/scene/impulses", "Arrows3D:vectors")[5]
    (origin,) = content.over_time("/scene/impulses", "Arrows3D:origins")[5]
    assert arrow[2] > 0.1 * RADIUS
    np.testing.assert_allclose(arrow[:2], 0.0, atol=1e-9)
    np.testing.assert_allclose(origin, 0.0, atol=1e-7)
    assert content.curve("/curves/contacts/stick")[5] == 1
    assert content.curve("/curves/energy/potential")[5] == pytest.approx(MASS * 9.81 * RADIUS, rel=1e-6)
    assert content.curve("/curves/energy/kinetic")[5] == pytest.approx(0.0, abs=1e-12)
    assert content.curve("/curves/residual")[5] < -11


def test_curves_hold_every_step_and_shapes_every_so_many(tmp_path: Path, read_back: Callable[[Path], Any]) -> None:
    scene = Funnel(30)
    stepper = MidpointRule(scene.system(), create("SORprox"), Stop(1e-3, 50), TIME_STEP)
    with BallRecorder(scene.system(), tmp_path / "a.rrd", every=5) as recorder:
        recorder.start(scene.start())
        steps = list(stepper.steps(scene.start(), 22))
        for step in steps:
            recorder(step)
    content = read_back(tmp_path / "a.rrd")
    assert list(content.over_time("/scene/bodies/0", "InstancePoses3D:translations")) == [0, 5, 10, 15, 20]
    assert [content.curve("/curves/iterations")[k + 1] for k in range(22)] == [step.iterations for step in steps]
    moments = content.logged["/curves/iterations", "Scalars:scalars"]
    assert [at[1].total_seconds() for at in moments if at != "static"] == pytest.approx(TIME_STEP * np.arange(23))
    balls = sum(len(content.over_time(f"/scene/bodies/{k}", "InstancePoses3D:translations")[20]) for k in range(4))
    assert balls == 30
    assert {f"/scene/surfaces/{k}" for k in range(2)} <= {entity for entity, _ in content.logged}
    assert "'3D'" in str(content.blueprint)


def test_a_system_that_cannot_turn_and_one_of_two_sizes_are_drawn(
    tmp_path: Path, read_back: Callable[[Path], Any]
) -> None:
    system = BallSystem(np.array([0.01, 0.02]), np.ones(2), [], 3)
    start = State(0.0, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]), np.ones(6))
    stepper = MidpointRule(system, create("SORprox"), Stop(), DT)
    with BallRecorder(system, tmp_path / "a.rrd") as recorder:
        recorder.start(start)
        recorder(stepper.step(start))
    content = read_back(tmp_path / "a.rrd")
    sizes = [content.over_time(f"/scene/bodies/{k}", "InstancePoses3D:scales")[1][0][0] for k in range(2)]
    assert sorted(sizes) == [0.5, 1.0]
    assert content.over_time("/scene/bodies/0", "InstancePoses3D:quaternions")[1] == [[0.0, 0.0, 0.0, 1.0]]


def simulate_without_state(recorder: BallRecorder, scene: Funnel, step: Step) -> None:
    recorder.start(scene.start())
    recorder(step)
    recorder(replace(step, state=None))  # type: ignore[arg-type]


def test_a_simulation_that_fails_keeps_what_was_recorded(tmp_path: Path, read_back: Callable[[Path], Any]) -> None:
    scene = Funnel(30, STANDARD_EFFECTS)
    broken = MidpointRule(scene.system(), create("SORprox"), Stop(), TIME_STEP).step(scene.start())
    recorder = BallRecorder(scene.system(), tmp_path / "a.rrd")
    with pytest.raises(AttributeError), recorder:
        simulate_without_state(recorder, scene, broken)
    assert [file.name for file in tmp_path.iterdir()] == ["a.rrd"]
    assert list(read_back(tmp_path / "a.rrd").curve("/curves/energy/total")) == [0, 1]


def test_a_recorder_is_started_before_it_is_called(tmp_path: Path) -> None:
    scene = Funnel(30)
    step = MidpointRule(scene.system(), create("SORprox"), Stop(), TIME_STEP).step(scene.start())
    with pytest.raises(BenchError, match="not started"), BallRecorder(scene.system(), tmp_path / "a.rrd") as recorder:
        recorder(step)
    with pytest.raises(BenchError, match="every"):
        BallRecorder(scene.system(), tmp_path / "a.rrd", every=0)
    assert list(tmp_path.iterdir()) == []


def test_balls_through_the_outlet_have_a_curve_where_there_is_one(
    tmp_path: Path, read_back: Callable[[Path], Any]
) -> None:
    system, state = rolling_ball(3)
    stepper = MidpointRule(system, create("SORprox"), Stop(1e-12, 1000), DT)
    through = Observable("through", lambda state: 3, label="balls through the outlet")
    for name, observables in (("open", [through]), ("closed", [replace(through, label="")])):
        with BallRecorder(system, tmp_path / f"{name}.rrd", observables=observables) as recorder:
            recorder.start(state)
            recorder(stepper.step(state))
    assert set(read_back(tmp_path / "open.rrd").curve("/curves/through").values()) == {3.0}
    assert not any(entity == "/curves/through" for entity, _ in read_back(tmp_path / "closed.rrd").logged)
