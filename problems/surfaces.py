"""Rigid surfaces that balls touch: for each ball the gap and the unit normal from the surface to the ball's centre."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .laws import FloatArray

NO_CONTACT = np.inf
"""Gap of a ball that a surface does not face."""


class Surface(Protocol):
    """A fixed surface."""

    def gap_and_normal(self, centres: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return gaps [m], shape (n,), and unit normals, shape (n, d), for balls at ``centres``, shape (n, d)."""
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

    def gap_and_normal(self, centres: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return n·(x − p) − r and n."""
        unit = np.array(self.normal) / np.linalg.norm(self.normal)
        gap = (centres - np.array(self.point)) @ unit - radii
        return gap, np.broadcast_to(unit, centres.shape)


def distance_to_axis(centres: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ρ and the outward horizontal direction of points around the vertical (last) axis, spatial only."""
    horizontal = centres[:, :-1]
    radius = np.sqrt((horizontal**2).sum(axis=1))
    outward = np.zeros_like(horizontal)
    outward[:, 0] = 1.0
    off_axis = radius > 0.0
    outward[off_axis] = horizontal[off_axis] / radius[off_axis, None]
    return radius, outward


def side_of_axis(centres: FloatArray, side: float) -> tuple[FloatArray, FloatArray]:
    """Return ρ and outward direction for one half of a planar profile: ``side`` is +1 (right) or −1 (left)."""
    return side * centres[:, 0], np.full((len(centres), 1), side)


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

    def gap_and_normal(self, centres: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the distance to the segment less r, on the side of the axis, and the normal towards the axis."""
        radius, outward = distance_to_axis(centres) if self.side == 0 else side_of_axis(centres, self.side)
        along = np.array(self.upper) - np.array(self.lower)
        length = float(np.hypot(*along))
        along = along / length
        inward = np.array([-along[1], along[0]])
        relative_radius, relative_height = radius - self.lower[0], centres[:, -1] - self.lower[1]
        position = along[0] * relative_radius + along[1] * relative_height
        distance = inward[0] * relative_radius + inward[1] * relative_height
        faces = (position >= 0.0) & (position <= length) & (distance > -radii)
        normal = np.column_stack([inward[0] * outward, np.full(len(centres), inward[1])])
        return np.where(faces, distance - radii, NO_CONTACT), normal


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

    def gap_and_normal(self, centres: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the distance to the rim less r, and the direction from the rim to the centre."""
        radius, outward = distance_to_axis(centres) if self.side == 0 else side_of_axis(centres, self.side)
        across, up = radius - self.point[0], centres[:, -1] - self.point[1]
        distance = np.hypot(across, up)
        faces = (self.along[0] * across + self.along[1] * up < 0.0) & (distance > 0.0)
        safe = np.where(distance > 0.0, distance, 1.0)
        normal = np.column_stack([(across / safe)[:, None] * outward, up / safe])
        return np.where(faces, distance - radii, NO_CONTACT), normal
