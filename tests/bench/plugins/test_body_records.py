"""Rigid bodies that another process describes are the same bodies, or are refused."""

from typing import Any

import msgspec
import numpy as np
import pytest
from proxbench.bench.plugins.body_records import BodiesRecord, body_arrays, describe_bodies, read_bodies
from proxbench.problems.motion.bodies.rigid.joints import Joint, RigidJoints
from proxbench.problems.motion.bodies.rigid.polyhedron import Polyhedron, convex_polyhedron
from proxbench.problems.motion.bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from proxbench.problems.motion.bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from proxbench.problems.motion.bodies.rigid.shapes import Box, HalfSpace
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.scene import Scene

SCENES = ("box_stack", "arch", "dominoes", "drum", "hopper", "chain", "four_bar", "rolling_cylinder", "spinning_top")


def sent(scene: Scene, **changes: Any) -> RigidBodies:
    """Return the bodies of a scene after a transfer in which fields of the record are replaced."""
    assert scene.bodies is not None
    content = msgspec.json.decode(msgspec.json.encode(describe_bodies(scene.bodies))) | changes
    sizes = len(scene.start.position), len(scene.start.velocity)
    return read_bodies(msgspec.convert(content, BodiesRecord), body_arrays(scene), *sizes)


@pytest.mark.parametrize("name", SCENES)
def test_bodies_of_a_scene_have_the_same_contacts_and_joints(name: str) -> None:
    scene = make_scene(name)
    found, bodies = sent(scene), scene.bodies
    assert bodies is not None
    poses = bodies.poses(scene.start.position)
    expected, contacts = (one.contacts_within(poses, 0.01) for one in (bodies, found))
    for quantity in ("first", "second", "point", "normal", "gap"):
        np.testing.assert_array_equal(getattr(contacts, quantity), getattr(expected, quantity))
    np.testing.assert_array_equal(found.moments, bodies.moments)
    assert (found.linear_rows, found.rolling_axes) == (bodies.linear_rows, bodies.rolling_axes)
    joints = [() if one.joints is None else tuple(one.joints.joints) for one in (found, bodies)]  # type: ignore[attr-defined]
    assert joints[0] == joints[1]


def test_every_kind_of_shape_is_transferred() -> None:
    wedge, _ = convex_polyhedron(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    shapes = [Box((1.0, 2.0, 3.0)), Sphere(0.5), Capsule(0.1, 0.4), Cylinder(0.2, 0.3), wedge]
    joint = Joint(
        "revolute", 1, 0, (0.1, 0.0, 0.0), (0.0, 0.2, 0.0), limits=(-1.0, 2.0), motor_speed=3.0, motor_bound=4.0
    )
    bodies = RigidBodies(shapes, np.ones(5), [FixedBody(HalfSpace()), FixedBody(wedge)], joints=RigidJoints([joint], 5))
    record = msgspec.convert(msgspec.json.decode(msgspec.json.encode(describe_bodies(bodies))), BodiesRecord)
    found = read_bodies(record, {"body_masses": bodies.masses, "body_moments": bodies.moments}, 35, 30)
    assert found.shapes[:4] == shapes[:4]
    for one in (found.shapes[4], found.fixed[1].shape):
        assert isinstance(one, Polyhedron)
        np.testing.assert_array_equal(one.vertices, wedge.vertices)
        assert one.faces == wedge.faces
    assert found.fixed[0] == bodies.fixed[0]
    assert isinstance(found.joints, RigidJoints)
    assert found.joints.joints == [joint]


@pytest.mark.parametrize(
    "changes",
    [
        {"shapes": []},
        {"shapes": [{"kind": "sphere", "numbers": [1.0, 2.0]}]},
        {"shapes": [{"kind": "sphere", "numbers": [-1.0]}]},
        {"shapes": [{"kind": "half-space"}]},
        {"shapes": [{"kind": "polyhedron", "numbers": [1.0, 1.0, 1.0, 1.0], "faces": [[0, 1, 2]]}]},
        {"fixed": [{"shape": {"kind": "half-space"}, "centre": [0, 0, 0], "orientation": [2, 0, 0, 0]}]},
        {"joints": [{"kind": "ball", "first": 0, "second": 5}]},
        {"joints": [{"kind": "glue", "first": 0}]},
        {"rolling_axes": 4},
    ],
)
def test_bodies_that_do_not_fit_are_refused(changes: dict[str, Any]) -> None:
    scene = make_scene("thrown_box")
    sent(scene)
    with pytest.raises((ValueError, TypeError, IndexError)):
        sent(scene, **changes)
