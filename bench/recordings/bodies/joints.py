"""Joints in recordings: their points, axes and rods, and the impulses that they exert."""

import numpy as np
import rerun as rr
import scipy.sparse as sp

from ....problems.arrays import FloatArray
from ....problems.motion.bodies.rigid.joints import WORLD, Joint, RigidJoints
from ....problems.motion.bodies.rigid.orientation import IDENTITY, rotation_matrices
from ....problems.motion.stepping.step import Step
from ...report.charts.palette import PALETTE, rgb
from ..scene_recorder import Entities

JOINTS = "scene/joints"
"""Entity of the joints."""

PLAIN_COLOUR, FRICTION_COLOUR, MOTOR_COLOUR = (236, 240, 245), rgb(PALETTE[1]), rgb(PALETTE[6])
"""Colours of joints: without friction, with friction, and with a motor."""

AXIS_HALF_LENGTH, POINT_RADIUS, LINE_RADIUS = 0.3, 0.1, 0.03
"""Half-length of an axis, radius of a point, and radius of a line, relative to the smallest bounding radius."""


def joint_shapes(joints: RigidJoints, poses: FloatArray, radius: float) -> Entities:
    """Yield the points, axes, rods and ropes of joints as entities of a recording.

    Args:
        joints: the joints.
        poses: (x [m], quaternion) of each body, shape (n, 7).
        radius: smallest bounding radius of a body [m].
    """
    points, point_colours, lines, line_colours = [], [], [], []
    for joint in joints.joints:
        (first, _), (second, rotation) = joint_points(joint, poses)
        colour = MOTOR_COLOUR if joint.motor_bound else FRICTION_COLOUR if joint.friction else PLAIN_COLOUR
        points.append(first)
        point_colours.append(colour)
        if joint.kind in ("distance", "rope"):
            points.append(second)
            point_colours.append(colour)
            lines.append([first, second])
            line_colours.append(colour)
        if joint.kind in ("revolute", "prismatic"):
            axis = rotation @ (np.array(joint.axis) / np.linalg.norm(joint.axis))
            low, high = -AXIS_HALF_LENGTH * radius, AXIS_HALF_LENGTH * radius
            if joint.kind == "prismatic" and joint.limits is not None:
                low, high = joint.limits
            lines.append([second + low * axis, second + high * axis])
            line_colours.append(colour)
    yield f"{JOINTS}/points", rr.Points3D(points, colors=point_colours, radii=[POINT_RADIUS * radius])
    yield f"{JOINTS}/lines", rr.LineStrips3D(lines, colors=line_colours, radii=[LINE_RADIUS * radius])


def joint_points(joint: Joint, poses: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Return the point of a joint on each of its two bodies [m], shape (3,), and the body's rotation matrix."""
    points = []
    for body, point in ((joint.first, joint.first_point), (joint.second, joint.second_point)):
        pose = np.array([0.0, 0.0, 0.0, *IDENTITY]) if body == WORLD else poses[body]
        rotation = rotation_matrices(pose[None, 3:])[0]
        points.append((pose[:3] + rotation @ point, rotation))
    return points


def joint_impulses(joints: RigidJoints, first_key: int, step: Step) -> FloatArray:
    """Return the impulse that each joint, with its limits, exerts on its first body [N s], shape (n_joints, 3).

    Args:
        joints: the joints.
        first_key: key of the first joint among all contacts, see ``RigidJoints.rows_at``.
        step: a step with active contacts.
    """
    contacts, n_joints = step.contacts, len(joints.joints)
    assert contacts is not None
    directions = contacts.directions
    assert isinstance(directions, sp.csc_array)  # true for all systems with joints
    row_numbers = contacts.keys - first_key
    owners = np.where(row_numbers < n_joints, row_numbers, (row_numbers - n_joints) // 2)
    columns = np.repeat(np.arange(directions.shape[1]), np.diff(directions.indptr))
    joint_numbers = contacts.for_rows(owners)[columns]
    body_numbers, axes = np.divmod(directions.indices, 6)
    first_bodies = np.array([joint.first for joint in joints.joints])
    is_force_entry = (joint_numbers >= 0) & (axes < 3)
    is_force_entry[is_force_entry] = body_numbers[is_force_entry] == first_bodies[joint_numbers[is_force_entry]]
    impulses = np.zeros((n_joints, 3))
    values = (directions.data * step.impulses[columns])[is_force_entry]
    np.add.at(impulses, (joint_numbers[is_force_entry], axes[is_force_entry]), values)
    return impulses
