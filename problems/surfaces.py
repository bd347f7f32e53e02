"""Rigid surfaces that balls touch, with the gap and the normal at each contact."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .laws import FloatArray, IntArray

Touching = tuple[IntArray, FloatArray, FloatArray]
"""Balls that touch, shape (m,), their gaps [m], shape (m,), and unit normals from surface to centre, shape (m, d)."""


class Surface(Protocol):
    """A fixed surface."""

    def touching(self, centres: FloatArray, radii: FloatArray) -> Touching:
        """Return the balls at ``centres``, shape (n, d), that overlap the surface, with gaps and normals."""
        ...


@dataclass(frozen=True)
class Plane:
    """The half-space below a plane; balls are above it.

    Attributes:
        point: a point of the plane [m], d numbers.
        normal: direction out of the half-space, d numbers of any length.
    """

    point: tuple[float, ...]
    normal: tuple[float, ...]

    def touching(self, centres: FloatArray, radii: FloatArray) -> Touching:
        """Return where n·(x − p) < r."""
        unit = np.array(self.normal) / np.linalg.norm(self.normal)
        gap = (centres - np.array(self.point)) @ unit - radii
        balls = np.flatnonzero(gap < 0.0)
        return balls, gap[balls], np.tile(unit, (len(balls), 1))


def _distance_from_axis(centres: FloatArray, side: int) -> FloatArray:
    """ρ of points: around the vertical (last) axis for side 0, to the right (+1) or left (−1) in a planar scene."""
    if side:
        return side * centres[:, 0]
    distance: FloatArray = np.sqrt(centres[:, 0] ** 2 + centres[:, 1] ** 2)
    return distance


def _outward(centres: FloatArray, distance: FloatArray, side: int) -> FloatArray:
    """Horizontal direction in which ρ grows, shape (n, d − 1); the first axis for points on the vertical one."""
    if side:
        return np.full((len(centres), 1), float(side))
    outward = centres[:, :2] / np.where(distance > 0.0, distance, 1.0)[:, None]
    outward[distance == 0.0, 0] = 1.0
    return outward


@dataclass(frozen=True)
class Segment:
    """A wall whose cross-section is a segment in the (ρ, z) half-plane: a cone, a cylinder, or a flat wall.

    Attributes:
        lower: lower end (ρ, z) [m].
        upper: upper end (ρ, z) [m]; beyond it, as before ``lower``, the wall does not exist.
        side: 0 for a surface of revolution about the vertical axis, ±1 for the right or left wall of a planar scene.
    """

    lower: tuple[float, float]
    upper: tuple[float, float]
    side: int = 0

    def touching(self, centres: FloatArray, radii: FloatArray) -> Touching:
        """Return where the distance to the segment, on the side of the axis, is below r; normals point to the axis."""
        span = np.array(self.upper) - np.array(self.lower)
        length = float(np.hypot(*span))
        along = span / length
        inward = (-along[1], along[0])
        radius = _distance_from_axis(centres, self.side)
        across, up = radius - self.lower[0], centres[:, -1] - self.lower[1]
        position = along[0] * across + along[1] * up
        distance = inward[0] * across + inward[1] * up
        balls = np.flatnonzero((position >= 0.0) & (position <= length) & (np.abs(distance) < radii))
        outward = _outward(centres[balls], radius[balls], self.side)
        normal = np.column_stack([inward[0] * outward, np.full(len(balls), inward[1])])
        return balls, distance[balls] - radii[balls], normal


@dataclass(frozen=True)
class Rim:
    """The circle (or, in a planar scene, the corner) where a ``Segment`` begins; it is what balls touch below the wall.

    Attributes:
        point: (ρ, z) of the rim [m].
        along: direction (ρ, z) of the wall that begins there; the rim is touched only behind its beginning.
        side: as ``Segment.side``.
    """

    point: tuple[float, float]
    along: tuple[float, float]
    side: int = 0

    def touching(self, centres: FloatArray, radii: FloatArray) -> Touching:
        """Return where the distance to the rim is below r; normals point from the rim to the centre."""
        radius = _distance_from_axis(centres, self.side)
        across, up = radius - self.point[0], centres[:, -1] - self.point[1]
        squared = across**2 + up**2
        behind = self.along[0] * across + self.along[1] * up < 0.0
        balls = np.flatnonzero(behind & (squared < radii**2) & (squared > 0.0))
        distance = np.sqrt(squared[balls])
        outward = _outward(centres[balls], radius[balls], self.side)
        normal = np.column_stack([(across[balls] / distance)[:, None] * outward, up[balls] / distance])
        return balls, distance - radii[balls], normal
