"""Shapes in space: triangle meshes of balls and surfaces, orientations as quaternions (x, y, z, w), planar scenes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray, IntArray
from ...problems.mechanics.surfaces import Plane, Segment, Surface

LATITUDES, LONGITUDES = 6, 12
"""Faces of a ball from pole to pole and around; a thousand balls must stay light."""

AROUND = 64
"""Faces around a surface of revolution."""

Colours = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: corners [m], shape (n, 3).
        triangles: corners of each triangle, shape (m, 3).
        colours: red, green, blue of each corner, shape (n, 3), or None for one colour.
    """

    vertices: FloatArray
    triangles: IntArray
    colours: Colours | None = None


def ball_mesh(radius: float, colour: tuple[int, int, int], flatness: float = 1.0) -> Mesh:
    """Return a ball in two shades, an octant each, so that one sees it turn.

    Args:
        radius: [m].
        colour: of every other octant; the others are nearly white.
        flatness: extent along y relative to that along x and z, below 1 for discs.
    """
    polar = np.linspace(0.0, np.pi, LATITUDES + 1)
    around = np.linspace(0.0, 2.0 * np.pi, LONGITUDES + 1)
    vertices: list[tuple[float, float, float]] = []
    colours, triangles = [], []
    for i in range(LATITUDES):
        for j in range(LONGITUDES):
            corners = [(polar[i], around[j]), (polar[i + 1], around[j])]
            corners += [(polar[i + 1], around[j + 1]), (polar[i], around[j + 1])]
            start = len(vertices)
            vertices += [(np.sin(p) * np.cos(a), flatness * np.sin(p) * np.sin(a), np.cos(p)) for p, a in corners]
            octant = (2 * i // LATITUDES + 4 * j // LONGITUDES) % 2
            colours += [colour if octant else (236, 240, 245)] * 4
            triangles += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return Mesh(radius * np.array(vertices), np.array(triangles), np.array(colours, dtype=np.uint8))


def surface_meshes(surfaces: Sequence[Surface], top: float, width: float, dimension: int) -> list[Mesh]:
    """Return meshes of the surfaces that have an area, cut at the height ``top`` [m].

    Args:
        surfaces: of a scene; rims, which end other surfaces, and kinds unknown here are left out.
        top: height above which nothing is drawn [m].
        width: half the extent of planes, and of planar walls across the plane [m].
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
    (low, bottom), (high, end) = segment.lower, segment.upper
    share = min(1.0, (top - bottom) / (end - bottom)) if end > bottom else 1.0
    ends = np.array([[low, bottom], [low + share * (high - low), bottom + share * (end - bottom)]])
    if segment.side:
        corners = [(segment.side * across, depth, height) for across, height in ends for depth in (-width, width)]
        return Mesh(np.array(corners), np.array([[0, 1, 2], [1, 3, 2]]))
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
    rings = [
        np.column_stack([across * np.cos(angle), across * np.sin(angle), np.full(len(angle), height)])
        for across, height in ends
    ]
    k = np.arange(AROUND)
    above = k + AROUND + 1
    triangles = np.concatenate([np.column_stack([k, k + 1, above]), np.column_stack([k + 1, above + 1, above])])
    return Mesh(np.concatenate(rings), triangles)


def _plane_mesh(plane: Plane, width: float, dimension: int) -> Mesh:
    point, normal = np.array(plane.point), np.array(plane.normal) / np.linalg.norm(plane.normal)
    if dimension == 2:
        point, normal = point[[0, 0, 1]] * (1.0, 0.0, 1.0), normal[[0, 0, 1]] * (1.0, 0.0, 1.0)
    helper = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    corners = [point + width * (a * first + b * second) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def upright(count: int) -> FloatArray:
    """Return ``count`` unturned orientations, shape (count, 4)."""
    return np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))


def turned(orientations: FloatArray, spins: FloatArray, seconds: float) -> FloatArray:
    """Return orientations turned by constant angular velocities for some time, exactly.

    q⁺ = exp(ω Δt / 2) q with ω in the axes of space.

    Args:
        orientations: unit quaternions (x, y, z, w), shape (n, 4).
        spins: ω [rad/s], shape (n, 3).
        seconds: Δt [s].
    """
    half = 0.5 * seconds * spins
    angle = np.linalg.norm(half, axis=1)
    axis = half * np.sinc(angle / np.pi)[:, None]
    scalar = np.cos(angle)
    x, w = orientations[:, :3], orientations[:, 3]
    vector = scalar[:, None] * x + w[:, None] * axis + np.cross(axis, x)
    product = np.column_stack([vector, scalar * w - (axis * x).sum(axis=1)])
    unit: FloatArray = product / np.linalg.norm(product, axis=1)[:, None]
    return unit


def about_depth(angle: float) -> tuple[float, float, float, float]:
    """Return the orientation of a body of the plane (x, z) that is turned by ``angle`` [rad] from x to z."""
    return 0.0, -float(np.sin(angle / 2.0)), 0.0, float(np.cos(angle / 2.0))


def in_space(vectors: FloatArray) -> FloatArray:
    """Return vectors over (x, z), shape (…, 2), as vectors over (x, 0, z), shape (…, 3); spatial ones as they are.

    Planar scenes stand in space on the plane y = 0.
    """
    if vectors.shape[-1] == 3:
        return vectors
    return np.stack([vectors[..., 0], np.zeros(vectors.shape[:-1]), vectors[..., 1]], axis=-1)
