"""Triangle meshes of the shapes of rigid bodies, in body axes."""

import numpy as np
from scipy.spatial import ConvexHull

from ....problems.arrays import FloatArray
from ....problems.motion.bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from ....problems.motion.bodies.rigid.shapes import HalfSpace, Shape
from .meshes import WHITE, Mesh

AROUND, ALONG = 32, 8
"""Numbers of corners around the axis of a round shape, and from a pole to the equator."""


def shape_mesh(shape: Shape, colour: tuple[int, int, int]) -> Mesh:
    """Return the surface of a bounded shape; quarters of round ones alternate in shade, to show their rotation.

    Each triangle has corners of its own, three in a row, so that edges stay sharp.

    Args:
        shape: any shape but a half-space.
        colour: its colour.
    """
    assert not isinstance(shape, HalfSpace)
    points = _round_points(shape) if isinstance(shape, Sphere | Capsule | Cylinder) else shape.vertices
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    is_inward = np.einsum("ti,ti->t", across, hull.equations[:, :3]) < 0.0
    corners[is_inward] = corners[is_inward][:, ::-1]
    colours = np.tile(np.array(colour, dtype=np.uint8), (len(corners), 1))
    if isinstance(shape, Sphere | Capsule | Cylinder):
        middle = corners.mean(axis=1)
        colours[middle[:, 0] * middle[:, 1] > 0.0] = WHITE
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    return Mesh(corners.reshape(-1, 3), triangles, colours.repeat(3, axis=0))


def _round_points(shape: Sphere | Capsule | Cylinder) -> FloatArray:
    """Return points on the surface of a round shape, shape (n, 3)."""
    half = 0.0 if isinstance(shape, Sphere) else 0.5 * shape.length
    if isinstance(shape, Cylinder):
        radii, heights = np.array([1.0]) * shape.radius, np.array([half])
    else:
        polar = np.linspace(0.0, 0.5 * np.pi, ALONG + 1)[1:]
        radii, heights = shape.radius * np.sin(polar), half + shape.radius * np.cos(polar)
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    rings = [
        np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(AROUND, sign * height)])
        for radius, height in zip(radii, heights, strict=True)
        for sign in (1.0, -1.0)
    ]
    if not isinstance(shape, Cylinder):
        rings.append(np.array([[0.0, 0.0, half + shape.radius], [0.0, 0.0, -half - shape.radius]]))
    return np.unique(np.concatenate(rings), axis=0)
