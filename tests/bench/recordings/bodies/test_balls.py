"""A recording of balls shows their positions, rotations and the impulses on them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.recordings.bodies.balls import BallRecorder
from proxbench.bench.simulation.step_row import step_columns
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.scenes.effects import Friction, Gravity, Planar, ball_system
from proxbench.problems.motion.scenes.funnel import TIME_STEP
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.scene import Observable, Scene, bare_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create
from scipy.spatial.transform import Rotation

RADIUS, SPEED, MASS, DT = 0.05, 0.3, 0.2, 1e-3


def scene_of(system: BallSystem, start: State, **fields: Any) -> Scene:
    """Return the scene of a system, with some fields replaced."""
    return replace(bare_scene("balls", {"gravity": 9.81}, system, start), **fields)


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
@pytest.mark.parametrize("dimension", [pytest.param(2, marks=pytest.mark.weekly), 3])
def test_a_rolling_ball_turns_by_its_path_over_its_radius(
    dimension: int, tmp_path: Path, read_back: Callable[[Path], Any], record: Callable[..., None]
) -> None:
    system, state = rolling_ball(dimension)
    stepper = MidpointRule(system, create("SORprox"), Stop(1e-12, 1000), DT)
    record(BallRecorder(scene_of(system, state), tmp_path / "a.rrd"), list(stepper.steps(state, 200)))
    content = read_back(tmp_path / "a.rrd")
    places = content.over_time("/scene/bodies/0", "InstancePoses3D:translations")
    turns = content.over_time("/scene/bodies/0", "InstancePoses3D:quaternions")
    assert list(places) == list(range(201))
    np.testing.assert_allclose(places[200][0], [SPEED * 0.2, 0.0, RADIUS], atol=1e-6)
    turned = Rotation.from_quat(turns[200][0]).as_rotvec()
    np.testing.assert_allclose(turned, [0.0, SPEED * 0.2 / RADIUS, 0.0], atol=1e-5)


def test_a_ball_at_rest_is_carried_by_an_upward_impulse_below_it(
    tmp_path: Path, read_back: Callable[[Path], Any], record: Callable[..., None]
) -> None:
    system, state = rolling_ball(3)
    state = State(0.0, state.position, 0.0 * state.velocity)
    stepper = MidpointRule(system, create("SORprox"), Stop(1e-12, 1000), DT)
    record(BallRecorder(scene_of(system, state), tmp_path / "a.rrd"), list(stepper.steps(state, 5)))
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


def test_curves_contain_every_step_and_poses_every_fifth_step(
    tmp_path: Path, read_back: Callable[[Path], Any], record: Callable[..., None]
) -> None:
    scene = make_scene("funnel(balls=30)")
    steps = list(MidpointRule(scene.system, create("SORprox"), Stop(1e-3, 50), TIME_STEP).steps(scene.start, 22))
    record(BallRecorder(scene, tmp_path / "a.rrd", every=5), steps, every=5)
    content = read_back(tmp_path / "a.rrd")
    assert list(content.over_time("/scene/bodies/0", "InstancePoses3D:translations")) == [0, 5, 10, 15, 20]
    assert [content.curve("/curves/iterations")[k + 1] for k in range(22)] == [step.iterations for step in steps]
    moments = content.logged["/curves/iterations", "Scalars:scalars"]
    assert [at[1].total_seconds() for at in moments if at != "static"] == pytest.approx(TIME_STEP * np.arange(23))
    balls = sum(len(content.over_time(f"/scene/bodies/{k}", "InstancePoses3D:translations")[20]) for k in range(4))
    assert balls == 30
    assert {f"/scene/surfaces/{k}" for k in range(2)} <= {entity for entity, _ in content.logged}
    assert "'3D'" in str(content.blueprint)


def test_balls_of_two_sizes_that_cannot_rotate_are_drawn(
    tmp_path: Path, read_back: Callable[[Path], Any], record: Callable[..., None]
) -> None:
    system = BallSystem(np.array([0.01, 0.02]), np.ones(2), [], 3)
    start = State(0.0, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]), np.ones(6))
    stepper = MidpointRule(system, create("SORprox"), Stop(), DT)
    record(BallRecorder(scene_of(system, start), tmp_path / "a.rrd"), [stepper.step(start)])
    content = read_back(tmp_path / "a.rrd")
    sizes = [content.over_time(f"/scene/bodies/{k}", "InstancePoses3D:scales")[1][0][0] for k in range(2)]
    assert sorted(sizes) == [0.5, 1.0]
    assert content.over_time("/scene/bodies/0", "InstancePoses3D:quaternions")[1] == [[0.0, 0.0, 0.0, 1.0]]


def test_a_recording_that_fails_leaves_what_was_there(tmp_path: Path, record: Callable[..., None]) -> None:
    scene, file = make_scene("funnel(balls=30)"), tmp_path / "a.rrd"
    file.write_text("before")
    step = MidpointRule(scene.system, create("SORprox"), Stop(), TIME_STEP).step(scene.start)
    rows = np.ones(1, dtype=step_columns(scene))
    with pytest.raises(AttributeError):
        BallRecorder(scene, file, force=True).record(rows, [(1, replace(step, state=None))])  # type: ignore[arg-type]
    assert file.read_text() == "before"
    assert [one.name for one in tmp_path.iterdir()] == ["a.rrd"]
    with pytest.raises(BenchError, match="exists"):
        record(BallRecorder(scene, file), [step])


def test_balls_through_the_outlet_have_a_curve_where_there_is_one(
    tmp_path: Path, read_back: Callable[[Path], Any], record: Callable[..., None]
) -> None:
    system, state = rolling_ball(3)
    stepper = MidpointRule(system, create("SORprox"), Stop(1e-12, 1000), DT)
    through = Observable("through", lambda state: 3, label="balls through the outlet")
    for name, observables in (("open", [through]), ("closed", [replace(through, label="")])):
        scene = scene_of(system, state, observables=observables)
        record(BallRecorder(scene, tmp_path / f"{name}.rrd"), [stepper.step(state)])
    assert set(read_back(tmp_path / "open.rrd").curve("/curves/through").values()) == {3.0}
    assert not any(entity == "/curves/through" for entity, _ in read_back(tmp_path / "closed.rrd").logged)
