"""Rigid bodies of a plugin's scene as plain data, so that recordings can draw them without code of the plugin."""

from typing import Literal

import numpy as np

from ...problems.motion.bodies.rigid.joints import Joint, RigidJoints
from ...problems.motion.bodies.rigid.polyhedron import Polyhedron
from ...problems.motion.bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from ...problems.motion.bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from ...problems.motion.bodies.rigid.shapes import Box, HalfSpace, Shape
from ...problems.motion.scenes.scene import Scene
from ..store.fields import Count, Number, Positive, Record
from .scene_arrays import Arrays, plain_copy

Vector = tuple[Number, Number, Number]
"""Three coordinates."""

Kind = Literal["box", "sphere", "capsule", "cylinder", "half-space", "polyhedron"]
"""Names of the kinds of shapes."""


class ShapeRecord(Record, frozen=True, kw_only=True):
    """A shape.

    Attributes:
        kind: the kind of the shape.
        numbers: edge lengths of a box, radius of a sphere, radius and length of a capsule or a cylinder [m], volume
            [m³] and principal moments of inertia for a density of 1 [m⁵] of a polyhedron; empty for a half-space.
        vertices: corners of a polyhedron [m].
        faces: indices of the corners of each face of a polyhedron.
    """

    kind: Kind
    numbers: tuple[Positive, ...] = ()
    vertices: tuple[Vector, ...] = ()
    faces: tuple[tuple[Count, ...], ...] = ()

    def shape(self) -> Shape:
        """Return the shape."""
        match self.kind:
            case "box":
                x, y, z = self.numbers
                return Box((x, y, z))
            case "sphere":
                return Sphere(*self.numbers)
            case "capsule":
                return Capsule(*self.numbers)
            case "cylinder":
                return Cylinder(*self.numbers)
            case "half-space":
                return HalfSpace()
            case "polyhedron":
                volume, *inertia = self.numbers
                return Polyhedron(np.array(self.vertices).reshape(-1, 3), self.faces, volume, np.array(inertia))


class FixedRecord(Record, frozen=True, kw_only=True):
    """A fixed body; see ``FixedBody``."""

    shape: ShapeRecord
    centre: Vector
    orientation: tuple[Number, Number, Number, Number]


class BodiesRecord(Record, frozen=True, kw_only=True):
    """The rigid bodies of a scene, without the arrays of masses and inertias.

    Attributes:
        shapes: shapes of the moving bodies.
        fixed: the fixed bodies.
        joints: the joints.
        has_friction: whether contacts have friction.
        rolling_axes: number of rows of rolling friction; see ``RigidBodies``.
    """

    shapes: list[ShapeRecord]
    fixed: list[FixedRecord]
    joints: list[Joint]
    has_friction: bool
    rolling_axes: Literal[0, 1, 2, 3]


def describe_bodies(bodies: RigidBodies) -> BodiesRecord:
    """Return the record of ``bodies``."""
    joints = bodies.joints.joints if isinstance(bodies.joints, RigidJoints) else ()
    return BodiesRecord(
        shapes=[_shape_record(shape) for shape in bodies.shapes],
        fixed=[
            FixedRecord(
                shape=_shape_record(body.shape),
                centre=tuple(np.asarray(body.centre).tolist()),
                orientation=tuple(np.asarray(body.orientation).tolist()),
            )
            for body in bodies.fixed
        ],
        joints=[plain_copy(joint, Joint) for joint in joints],
        has_friction=bodies.friction is not None,
        rolling_axes=bodies.rolling_axes,  # type: ignore[arg-type]
    )


def _shape_record(shape: Shape) -> ShapeRecord:
    match shape:
        case Box():
            return ShapeRecord(kind="box", numbers=tuple(map(float, shape.size)))
        case Sphere():
            return ShapeRecord(kind="sphere", numbers=(float(shape.radius),))
        case Capsule():
            return ShapeRecord(kind="capsule", numbers=(float(shape.radius), float(shape.length)))
        case Cylinder():
            return ShapeRecord(kind="cylinder", numbers=(float(shape.radius), float(shape.length)))
        case HalfSpace():
            return ShapeRecord(kind="half-space")
        case Polyhedron():
            return ShapeRecord(
                kind="polyhedron",
                numbers=(float(shape.volume), *np.asarray(shape.inertia).tolist()),
                vertices=tuple(map(tuple, np.asarray(shape.vertices).tolist())),
                faces=tuple(tuple(map(int, face)) for face in shape.faces),
            )


def body_arrays(scene: Scene) -> Arrays:
    """Return masses [kg] and moments of inertia [kg m²] of the rigid bodies of ``scene``; empty without any."""
    bodies = scene.bodies
    return {} if bodies is None else {"body_masses": bodies.masses, "body_moments": bodies.moments}


def read_bodies(record: BodiesRecord, arrays: Arrays, n_coordinates: int, n_dofs: int) -> RigidBodies:
    """Return the bodies of a record, without the forces that act on them.

    Raises:
        KeyError, ValueError, ProblemError: if the bodies do not fit a scene with ``n_coordinates`` and ``n_dofs``.
    """
    n_bodies = len(record.shapes)
    if (7 * n_bodies, 6 * n_bodies) != (n_coordinates, n_dofs):
        raise ValueError("the bodies do not fit the scene")
    return RigidBodies(
        [shape.shape() for shape in record.shapes],
        arrays["body_masses"],
        [FixedBody(body.shape.shape(), body.centre, body.orientation) for body in record.fixed],
        inertias=arrays["body_moments"],
        friction=0.0 if record.has_friction else None,
        rolling_axes=record.rolling_axes,
        joints=RigidJoints(record.joints, n_bodies) if record.joints else None,
    )
