"""Shapes in space: triangle meshes of balls and surfaces, and orientations as quaternions (x, y, z, w)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ....problems.arrays import FloatArray, IntArray
from ....problems.motion.bodies.surfaces import Plane, Segment, Surface

LATITUDES, LONGITUDES = 6, 12
"""Numbers of faces of a ball from pole to pole and around the axis, small enough for scenes of a thousand balls."""

N_AROUND = 64
"""Number of faces around a surface of revolution."""

WHITE = (236, 240, 245)
"""Colour of the lighter octants of balls (red, green, blue)."""

Colours = NDArray[np.uint8]
"""Red, green, blue of each corner, shape (n, 3)."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: corners [m], shape (n, 3).
        triangles: corners of each triangle, shape (m, 3).
        colours: red, green, blue of each corner, shape (n, 3), or None for one colour.
        normals: outward normals of a smooth surface at each corner, shape (n, 3), or None for flat triangles.
    """

    vertices: FloatArray
    triangles: IntArray
    colours: Colours | None = None
    normals: FloatArray | None = None


def ball_mesh(radius: float, colour: tuple[int, int, int], flatness: float = 1.0) -> Mesh:
    """Return a ball with octants in two alternating shades, to show its rotation.

    Args:
        radius: radius [m].
        colour: colour of every other octant; the others are nearly white.
        flatness: extent along y relative to that along x and z, below 1 for discs.
    """
    row, column = np.divmod(np.arange(LATITUDES * LONGITUDES), LONGITUDES)
    polar = np.pi / LATITUDES * (row[:, None] + (0, 1, 1, 0))
    around = 2.0 * np.pi / LONGITUDES * (column[:, None] + (0, 0, 1, 1))
    x, y, z = np.sin(polar) * np.cos(around), flatness * np.sin(polar) * np.sin(around), np.cos(polar)
    triangles = (4 * np.arange(len(row))[:, None] + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    octant = (2 * row // LATITUDES + 4 * column // LONGITUDES) % 2
    colours = np.where(octant[:, None], colour, WHITE).astype(np.uint8).repeat(4, axis=0)
    return Mesh(radius * np.stack([x, y, z], axis=-1).reshape(-1, 3), triangles, colours)


def surface_meshes(surfaces: Sequence[Surface], top: float, width: float, dimension: int) -> list[Mesh]:
    """Return meshes of the surfaces; walls are cut at the height ``top`` [m].

    Args:
        surfaces: surfaces of a scene; rims, which end other surfaces, and unknown kinds are omitted.
        top: height above which walls are not drawn [m].
        width: half the extent of planes, and of planar walls perpendicular to the plane [m].
        dimension: 2 for a scene in the plane (x, z), 3 for one in space.
    """
    meshes = []
    for surface in surfaces:
        if isinstance(surface, Segment) and surface.lower[1] < top:
            meshes.append(_segment_mesh(surface, top, width))
        elif isinstance(surface, Plane):
            meshes.append(_plane_mesh(surface, width, dimension))
    return meshes


def _segment_mesh(segment: Segment, top: float, width: float) -> Mesh:
    """Return the mesh of a cone, or of a planar wall if ``segment.side`` is not 0, up to the height ``top`` [m]."""
    lower, upper = np.array(segment.lower), np.array(segment.upper)
    share = min(1.0, (top - lower[1]) / (upper[1] - lower[1])) if upper[1] > lower[1] else 1.0
    ends = np.array([lower, lower + share * (upper - lower)])
    angle = np.linspace(0.0, 2.0 * np.pi, N_AROUND + 1)
    lines = []
    for radius, height in ends:
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        if segment.side:  # a planar wall, at the distance ``radius`` from the middle
            x, y = np.full(2, segment.side * radius), np.array([-width, width])
        lines.append(np.column_stack([x, y, np.full(len(x), height)]))
    n = len(lines[0])
    k = np.arange(n - 1)
    triangles = np.concatenate([np.column_stack([k, k + 1, k + n]), np.column_stack([k + 1, k + n + 1, k + n])])
    return Mesh(np.concatenate(lines), triangles)


def _plane_mesh(plane: Plane, width: float, dimension: int) -> Mesh:
    """Return a square of half width ``width`` [m] about the point of a plane."""
    point, normal = np.array(plane.point), np.array(plane.normal) / np.linalg.norm(plane.normal)
    if dimension == 2:
        point, normal = in_space(point), in_space(normal)
    helper = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    corners = [point + width * (a * first + b * second) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def identity_orientations(count: int) -> FloatArray:
    """Return ``count`` identity orientations, shape (count, 4)."""
    return np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))


def turned(orientations: FloatArray, spins: FloatArray, seconds: float) -> FloatArray:
    """Rotate orientations exactly with constant angular velocities for a time.

    q⁺ = exp(ω Δt / 2) q with ω in spatial axes.

    Args:
        orientations: unit quaternions (x, y, z, w), shape (n, 4).
        spins: ω [rad/s], shape (n, 3).
        seconds: Δt [s].
    """
    product: FloatArray = (Rotation.from_rotvec(seconds * spins) * Rotation.from_quat(orientations)).as_quat()
    return product


def planar_orientation(angle: float) -> tuple[float, float, float, float]:
    """Return the orientation of a body in the plane (x, z), rotated by ``angle`` [rad] from x to z."""
    return 0.0, -float(np.sin(angle / 2.0)), 0.0, float(np.cos(angle / 2.0))


def in_space(vectors: FloatArray) -> FloatArray:
    """Return planar vectors (x, z), shape (…, 2), as vectors (x, 0, z), shape (…, 3); spatial vectors are unchanged.

    Planar scenes are drawn in the plane y = 0.
    """
    return vectors if vectors.shape[-1] == 3 else np.insert(vectors, 1, 0.0, axis=-1)
