"""A recording of joints shows their positions and forces."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from proxbench.bench.recordings.bodies.force_arrows import MAX_RATIO, REFERENCE_LENGTH
from proxbench.bench.recordings.bodies.joints import FRICTION_COLOUR, MOTOR_COLOUR, PLAIN_COLOUR, joint_shapes
from proxbench.bench.recordings.replay import scene_recorder
from proxbench.problems.motion.bodies.rigid.joints import WORLD, Joint, RigidJoints
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

DT = 1e-3
UPRIGHT = np.array([[0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], [2.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]])


def shapes(*joints: Joint) -> dict[str, Any]:
    return dict(joint_shapes(RigidJoints(joints, 2), UPRIGHT, 1.0))


def colours(shape: Any) -> list[tuple[int, ...]]:
    values = shape.colors.as_arrow_array().to_pylist()
    return [((value >> 24) & 255, (value >> 16) & 255, (value >> 8) & 255) for value in values]


def test_a_hanging_pendulum_is_pulled_at_its_hinge_against_its_weight(
    tmp_path: Path, record: Callable[..., None], read_back: Callable[[Path], Any]
) -> None:
    scene = make_scene("pendulum(angle=1e-3)")
    steps = list(MidpointRule(scene.system, create("Robust"), Stop(1e-10, 1000), DT).steps(scene.start, 5))
    recorder = scene_recorder(scene, tmp_path / "a.rrd", len(steps))
    record(recorder, steps)
    content = read_back(tmp_path / "a.rrd")
    (vector,) = content.over_time("/scene/joint_forces", "Arrows3D:vectors")[5]
    (origin,) = content.over_time("/scene/joint_forces", "Arrows3D:origins")[5]
    np.testing.assert_allclose(origin, 0.0, atol=1e-5)
    radius = scene.system.shapes[0].bounding_radius  # type: ignore[attr-defined]
    np.testing.assert_allclose(vector, [0.0, 0.0, REFERENCE_LENGTH * radius], atol=1e-2 * radius)
    assert MAX_RATIO > 1.0  # all forces are nearly equal, so no arrow is shortened
    assert "blue" in content.static("/about", "TextDocument:text")[0]
    assert " 9.8 N" in content.static("/about", "TextDocument:text")[0]
    assert str(content.blueprint).count("'active contacts'") == 1  # in the first layout only


def test_joints_with_friction_and_motors_have_distinct_colours() -> None:
    drawn = shapes(
        Joint("revolute", 0),
        Joint("revolute", 0, friction=1.0),
        Joint("prismatic", 0, motor_speed=1.0, motor_bound=2.0),
    )
    assert colours(drawn["scene/joints/points"]) == [PLAIN_COLOUR, FRICTION_COLOUR, MOTOR_COLOUR]


def test_a_rope_is_a_line_between_its_points() -> None:
    drawn = shapes(Joint("rope", 0, 1, first_point=(0.0, 0.0, 0.5), second_point=(0.0, 0.0, 0.25), length=3.0))
    ends = drawn["scene/joints/lines"].strips.as_arrow_array().to_pylist()
    assert ends == [[[0.0, 0.0, 1.5], [2.0, 0.0, 1.25]]]


def test_a_slider_is_as_long_as_its_limits() -> None:
    joint = Joint("prismatic", 0, WORLD, second_point=(0.0, 0.0, 1.0), axis=(0.0, 0.0, 2.0), limits=(-1.0, 3.0))
    ends = shapes(joint)["scene/joints/lines"].strips.as_arrow_array().to_pylist()
    assert ends == [[[0.0, 0.0, 0.0], [0.0, 0.0, 4.0]]]
