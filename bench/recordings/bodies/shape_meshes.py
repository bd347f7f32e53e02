"""Triangle meshes of the shapes of rigid bodies, in body axes."""

import numpy as np
from scipy.spatial import ConvexHull

from ....problems.arrays import FloatArray
from ....problems.motion.bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from ....problems.motion.bodies.rigid.shapes import HalfSpace, Shape
from .meshes import WHITE, Mesh

RoundShape = Sphere | Capsule | Cylinder
"""Shapes with round surfaces."""

N_AROUND, N_MERIDIAN = 32, 8
"""Numbers of segments around the axis of a round shape, and from a pole to the equator."""


def shape_mesh(shape: Shape, colour: tuple[int, int, int]) -> Mesh:
    """Return the surface of a bounded shape; quadrants of round shapes alternate in colour, to show their rotation.

    Each triangle has its own three consecutive corners, so that edges stay sharp.

    Args:
        shape: any shape except a half-space.
        colour: red, green and blue, 0 to 255.
    """
    normals = None
    corners = _revolved(_profile(shape)) if isinstance(shape, RoundShape) else _hull(shape_points(shape))
    colours = np.tile(np.array(colour, dtype=np.uint8), (len(corners), 1))
    if isinstance(shape, RoundShape):
        middle = corners.mean(axis=1)
        colours[middle[:, 0] * middle[:, 1] > 0.0] = WHITE
    if isinstance(shape, Sphere | Capsule):
        half = 0.0 if isinstance(shape, Sphere) else 0.5 * shape.length
        normals = corners.reshape(-1, 3).copy()
        normals[:, 2] -= np.clip(normals[:, 2], -half, half)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    return Mesh(corners.reshape(-1, 3), triangles, colours.repeat(3, axis=0), normals)


def shape_points(shape: Shape) -> FloatArray:
    """Return the corners of a bounded shape, or points on its surface if it is round [m], shape (n, 3)."""
    assert not isinstance(shape, HalfSpace)
    if isinstance(shape, RoundShape):
        return _rings(_profile(shape)).reshape(-1, 3)
    return shape.vertices


def lightened(colour: tuple[int, int, int]) -> tuple[int, int, int]:
    """Return a lighter shade of a colour."""
    red, green, blue = (round(value + 0.35 * (white - value)) for value, white in zip(colour, WHITE, strict=True))
    return red, green, blue


def _hull(points: FloatArray) -> FloatArray:
    """Return the triangles of a convex hull, shape (n, 3, 3), counter-clockwise seen from outside."""
    hull = ConvexHull(points)
    corners: FloatArray = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    is_inward = np.einsum("ti,ti->t", normals, hull.equations[:, :3]) < 0.0
    corners[is_inward] = corners[is_inward][:, ::-1]
    return corners


def _profile(shape: RoundShape) -> FloatArray:
    """Return distances from the axis and heights of the surface [m], from the bottom up, shape (n, 2)."""
    if isinstance(shape, Cylinder):
        half, radius = 0.5 * shape.length, shape.radius
        return np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]])
    half = 0.0 if isinstance(shape, Sphere) else 0.5 * shape.length
    latitude = np.linspace(0.0, 0.5 * np.pi, N_MERIDIAN + 1)
    upper = np.column_stack([shape.radius * np.cos(latitude), half + shape.radius * np.sin(latitude)])
    lower = upper[::-1] * [1.0, -1.0]
    return np.concatenate([lower, upper[1:] if half == 0.0 else upper])


def _rings(profile: FloatArray) -> FloatArray:
    """Return the points of a surface of revolution, shape (n, N_AROUND, 3)."""
    angle = 2.0 * np.pi * np.arange(N_AROUND) / N_AROUND
    radii, heights = profile.T
    rings = [np.outer(radii, np.cos(angle)), np.outer(radii, np.sin(angle)), np.outer(heights, np.ones(N_AROUND))]
    return np.stack(rings, axis=-1)


def _revolved(profile: FloatArray) -> FloatArray:
    """Return the triangles of a surface of revolution, without the degenerate ones at its poles, shape (n, 3, 3)."""
    rings = _rings(profile)
    lower, upper = rings[:-1], rings[1:]
    lower_next, upper_next = np.roll(lower, -1, axis=1), np.roll(upper, -1, axis=1)
    triangles = np.concatenate(
        [np.stack([lower, lower_next, upper_next], axis=2), np.stack([lower, upper_next, upper], axis=2)]
    )
    triangles = triangles.reshape(-1, 3, 3)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normals, axis=1)
    nondegenerate: FloatArray = triangles[size > 1e-9 * size.max()]
    return nondegenerate
