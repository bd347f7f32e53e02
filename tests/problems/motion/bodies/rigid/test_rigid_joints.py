"""Joints of rigid bodies: their constraints, the derivatives of these, and refused arguments."""

from typing import Any

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.joint_rows import DISTANCE, JointRow, JointTable
from proxbench.problems.motion.bodies.rigid.joints import WORLD, Joint, RigidJoints
from proxbench.problems.motion.bodies.rigid.orientation import about, moved, product, rotation_matrices

KINDS = ("ball", "revolute", "prismatic", "fixed", "distance", "rope")


def some_joint(kind: Any, second: int = 1) -> Joint:
    return Joint(
        kind,
        0,
        second,
        (0.1, -0.2, 0.3),
        (-0.3, 0.1, 0.2),
        axis=(1.0, 2.0, -1.0),
        rotation=tuple(about((1.0, 1.0, 0.0), 0.4)),
        length=1.0 if kind in ("distance", "rope") else 0.0,
    )


def some_poses(seed: int) -> np.ndarray[Any, Any]:
    random = np.random.default_rng(seed)
    poses = random.normal(size=(2, 7))
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1)[:, None]
    return poses


@pytest.mark.parametrize("second", [1, WORLD])
@pytest.mark.parametrize("kind", KINDS)
def test_the_jacobian_is_the_rate_of_the_residual(kind: str, second: int) -> None:
    """For any velocity, by a central difference over the exponential of quaternions, with an error of second order."""
    joints, poses, step = RigidJoints([some_joint(kind, second)], 2), some_poses(1), 1e-5
    for velocity in np.random.default_rng(2).normal(size=(5, 12)):
        after, before = (
            joints.errors_at(moved(poses.ravel(), velocity, sign * step).reshape(2, 7)).residual for sign in (1.0, -1.0)
        )
        rates = joints.errors_at(poses).directions.T @ velocity
        assert rates == pytest.approx((after - before) / (2.0 * step), abs=1e-8)


def test_a_new_offset_of_a_row_replaces_its_offset_and_keeps_its_sign_unless_the_scalar_is_subtracted() -> None:
    poses = some_poses(1)
    row = JointRow(DISTANCE, (0, 1), np.zeros((2, 3)))
    distance = np.linalg.norm(poses[0, :3] - poses[1, :3])
    for changed, value in (
        (row.plus(2.0), distance + 2.0),
        (row.minus(2.0), 2.0 - distance),
        (row.plus(2.0).minus(3.0), 3.0 - distance),
        (row.minus(2.0).plus(3.0), 3.0 - distance),
    ):
        assert JointTable.of([changed]).at(poses)[0] == pytest.approx([value], rel=1e-14)


@pytest.mark.parametrize("friction", [0.0, 1.0])
@pytest.mark.parametrize("kind", KINDS)
def test_joint_forces_do_no_work_in_a_rigid_motion(kind: str, friction: float) -> None:
    joint = some_joint(kind)
    if friction and kind in ("revolute", "prismatic"):
        joint = Joint(kind, 0, 1, joint.first_point, joint.second_point, joint.axis, friction=friction)
    poses, (shift, turn) = some_poses(3), np.random.default_rng(4).normal(size=(2, 3))
    velocity = [
        [*(shift + np.cross(turn, pose[:3])), *(turn @ rotation)]
        for pose, rotation in zip(poses, rotation_matrices(poses[:, 3:]), strict=True)
    ]
    rows = RigidJoints([joint], 2).rows_at(poses, 1.0)
    assert rows.directions.T @ np.ravel(velocity) == pytest.approx(np.zeros(rows.laws.n_rows), abs=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_the_residual_is_the_same_after_a_rigid_motion(kind: str) -> None:
    joints, poses = RigidJoints([some_joint(kind)], 2), some_poses(5)
    turn = about((0.3, -1.0, 0.5), 1.1)
    turned = product(np.array([turn, turn]), poses[:, 3:])
    shifted = poses[:, :3] @ rotation_matrices(turn[None])[0].T + [1.0, -2.0, 0.5]
    after, before = (joints.errors_at(some).residual for some in (np.hstack([shifted, turned]), poses))
    assert after == pytest.approx(before, abs=1e-13)


@pytest.mark.parametrize(("kind", "n_rows"), [("ball", 3), ("revolute", 5), ("prismatic", 5), ("fixed", 6)])
def test_a_joint_takes_as_many_degrees_of_freedom_as_it_has_rows(kind: Any, n_rows: int) -> None:
    joint = Joint(kind, 0, 1, (0.0, 0.0, 0.5), (0.0, 0.0, -0.5), axis=(0.0, 1.0, 0.0))
    poses = np.array([[0.0, 0.0, -0.5, 1, 0, 0, 0], [0.0, 0.0, 0.5, 1, 0, 0, 0]])
    joints = RigidJoints([joint], 2)
    joints.check_start(poses)
    assert np.linalg.matrix_rank(joints.errors_at(poses).directions.toarray()) == joint.n_rows == n_rows


def test_friction_of_a_joint_is_bounded_by_its_moment_times_the_step() -> None:
    joint = Joint("revolute", 0, friction=3.0)
    rows = RigidJoints([joint], 1).rows_at(np.array([[0.0, 0, 0, 1, 0, 0, 0]]), 0.01)
    assert rows.row_counts.tolist() == [6]
    assert rows.laws.fixed_bound.tolist() == pytest.approx([0, 0, 0, 0, 0, 0.03])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "hinge"}, "no joint 'hinge'"),
        ({"axis": (0.0, 0.0, 0.0)}, "axis of a joint must be three finite numbers that are not all 0"),
        ({"axis": (np.nan, 0.0, 0.0)}, "axis of a joint must be three finite"),
        ({"axis": (1.0, 0.0)}, "axis of a joint must be three finite"),
        ({"first_point": (0.0, np.nan, 0.0)}, "first_point of a joint must be three finite numbers"),
        ({"second_point": (0.0, 0.0, np.inf)}, "second_point of a joint must be three finite numbers"),
        ({"second_point": (0.0, 0.0)}, "second_point of a joint must be three finite numbers"),
        ({"rotation": (1.0, 1.0, 0.0, 0.0)}, r"rotation of a joint must be a unit quaternion \(w, x, y, z\), got"),
        ({"rotation": (np.nan, 0.0, 0.0, 0.0)}, "rotation of a joint must be a unit quaternion"),
        ({"rotation": (1.0, 0.0, 0.0)}, "rotation of a joint must be a unit quaternion"),
        ({"kind": "distance", "length": 0.0}, "must be positive"),
        ({"kind": "ball", "length": 1.0}, "a ball joint has no length; use a distance joint or a rope"),
        ({"first": 0.5}, "first of a joint must be the index of a body, got 0.5"),
        ({"kind": "revolute", "motor_speed": 2.0}, "a motor needs motor_bound"),
        ({"kind": "revolute", "limits": (0.0, 1.0, 2.0)}, "limits of a joint must be two numbers"),
        ({"friction": -1.0}, "not negative"),
        ({"kind": "ball", "friction": 1.0}, "no axis for friction"),
    ],
)
def test_inconsistent_joint_parameters_are_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        Joint(**{"kind": "revolute", "first": 0, **change})


@pytest.mark.parametrize(
    ("first", "second", "words"), [(2, 0, "body 2"), (-1, 0, "body -1"), (0, 5, "body 5"), (1, 1, "itself")]
)
def test_a_joint_to_no_body_is_refused(first: int, second: int, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        RigidJoints([Joint("ball", first, second)], 2)


def test_a_joint_that_does_not_close_is_refused() -> None:
    with pytest.raises(ProblemError, match=r"joint 0 does not close at the start: its error is 0\.1 m"):
        RigidJoints([Joint("ball", 0)], 1).check_start(np.array([[0.1, 0.0, 0, 1, 0, 0, 0]]))
