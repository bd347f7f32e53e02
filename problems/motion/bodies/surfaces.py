"""Rigid surfaces for balls, with the gap and the normal at each contact."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray
from ...errors import ProblemError

SurfaceContacts = tuple[IntArray, FloatArray, FloatArray]
"""Indices of the balls that overlap a surface and their gaps [m], shapes (k,), and unit normals out of the surface,
shape (k, d)."""


CLEARLY = 1.0 - 1e-9
"""Ratio below which a square is less than another one despite rounding."""


class Surface(Protocol):
    """A fixed surface."""

    def find_contacts(self, centres: FloatArray, radii: FloatArray) -> SurfaceContacts:
        """Return the balls that overlap the surface, with gaps and normals.

        Args:
            centres: x of all balls [m], shape (n, d).
            radii: r of all balls [m], shape (n,).
        """
        ...


@dataclass(frozen=True)
class Plane:
    """The half-space below a plane; balls are above it.

    Attributes:
        point: a point of the plane [m], d numbers.
        normal: direction out of the half-space, d numbers of any length but 0.

    Raises:
        ProblemError: if the normal is zero or not finite.
    """

    point: tuple[float, ...]
    normal: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 0.0 < np.linalg.norm(self.normal) < np.inf:
            raise ProblemError(f"the normal of a plane must be finite and not zero, got {self.normal}.")

    def find_contacts(self, centres: FloatArray, radii: FloatArray) -> SurfaceContacts:
        """Return the balls with n·(x − p) < r."""
        unit = np.array(self.normal) / np.linalg.norm(self.normal)
        gap = (centres - np.array(self.point)) @ unit - radii
        balls = np.flatnonzero(gap < 0.0)
        return balls, gap[balls], np.tile(unit, (len(balls), 1))


@dataclass(frozen=True)
class Segment:
    """A cone, a cylinder or a flat wall, whose cross-section is a segment in the half-plane (ρ, z).

    The coordinate ρ is the distance from the axis.

    Attributes:
        lower: lower end (ρ, z) [m].
        upper: upper end (ρ, z) [m].
        side: 0 for a surface of revolution about the vertical axis, ±1 for the right or left wall of a planar scene.

    Raises:
        ProblemError: if the length is zero or not finite.
    """

    lower: tuple[float, float]
    upper: tuple[float, float]
    side: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < math.dist(self.lower, self.upper) < math.inf:
            raise ProblemError(f"a segment needs two different, finite ends, got {self.lower} and {self.upper}.")

    def find_contacts(self, centres: FloatArray, radii: FloatArray) -> SurfaceContacts:
        """Return the balls whose centres lie beside the segment, on either side, at a distance less than r.

        Normals point towards the axis, even if a centre is behind the wall.
        """
        span = (self.upper[0] - self.lower[0], self.upper[1] - self.lower[1])
        length = math.hypot(*span)
        along = (span[0] / length, span[1] / length)
        contacts: SurfaceContacts = _find_segment_contacts(centres, radii, self.lower, along, length, self.side)
        return contacts


@dataclass(frozen=True)
class Rim:
    """The circle, or the corner in a planar scene, where a ``Segment`` begins; balls overlap it below the wall.

    Attributes:
        point: (ρ, z) of the rim [m].
        along: direction (ρ, z) of the wall that begins there. Only balls whose centres lie behind the rim, with respect
            to this direction, overlap it.
        side: as ``Segment.side``.
    """

    point: tuple[float, float]
    along: tuple[float, float]
    side: int = 0

    def find_contacts(self, centres: FloatArray, radii: FloatArray) -> SurfaceContacts:
        """Return the balls closer to the rim than r; normals point from the rim to the centre."""
        contacts: SurfaceContacts = _find_rim_contacts(centres, radii, self.point, self.along, self.side)
        return contacts


@njit(cache=True)
def _axis_distance(centres, i, side):  # type: ignore[no-untyped-def]
    """Return ρ of a centre: from the vertical (last) axis for side 0, to the right (+1) or left (−1) in the plane."""
    if side != 0:
        return side * centres[i, 0]
    return np.sqrt(centres[i, 0] ** 2 + centres[i, 1] ** 2)


@njit(cache=True)
def _write_normal(centres, i, side, rho, across, up, normal):  # type: ignore[no-untyped-def]
    """Write the normal whose components in the (ρ, z) half-plane are ``across`` and ``up``.

    For a centre on the axis, the first direction counts as outward.
    """
    dim = len(normal)
    normal[1] = 0.0
    if side != 0:
        normal[0] = across * side
    elif rho == 0.0:
        normal[0] = across
    else:
        normal[0], normal[1] = across * (centres[i, 0] / rho), across * (centres[i, 1] / rho)
    normal[dim - 1] = up


@njit(cache=True)
def _is_far_inside(centres, i, limit, slope):  # type: ignore[no-untyped-def]
    """Return whether ``slope`` · ρ is clearly less than ``limit``, without the root that ρ requires."""
    squared = centres[i, 0] * centres[i, 0] + centres[i, 1] * centres[i, 1]
    return slope > 0.0 and limit > 0.0 and slope * slope * squared < CLEARLY * limit * limit


@njit(cache=True)
def _find_segment_contacts(centres, radii, lower, along, length, side):  # type: ignore[no-untyped-def]
    """Return what ``Segment.find_contacts`` returns; ``along`` is the unit direction of the segment."""
    n, dim = centres.shape
    balls, gaps, normals = np.empty(n, dtype=np.int64), np.empty(n), np.empty((n, dim))
    count = 0
    for i in range(n):
        up = centres[i, dim - 1] - lower[1]
        if side == 0 and _is_far_inside(centres, i, along[0] * up + along[1] * lower[0] - radii[i], along[1]):
            continue
        rho = _axis_distance(centres, i, side)
        across = rho - lower[0]
        position = along[0] * across + along[1] * up
        distance = along[0] * up - along[1] * across
        if 0.0 <= position <= length and abs(distance) < radii[i]:
            balls[count], gaps[count] = i, distance - radii[i]
            _write_normal(centres, i, side, rho, -along[1], along[0], normals[count])
            count += 1
    return balls[:count], gaps[:count], normals[:count]


@njit(cache=True)
def _find_rim_contacts(centres, radii, point, along, side):  # type: ignore[no-untyped-def]
    """Return what ``Rim.find_contacts`` returns."""
    n, dim = centres.shape
    balls, gaps, normals = np.empty(n, dtype=np.int64), np.empty(n), np.empty((n, dim))
    count = 0
    for i in range(n):
        up = centres[i, dim - 1] - point[1]
        if not abs(up) < radii[i]:
            continue
        rho = _axis_distance(centres, i, side)
        across = rho - point[0]
        squared = across**2 + up**2
        if along[0] * across + along[1] * up < 0.0 and 0.0 < squared < radii[i] ** 2:
            distance = np.sqrt(squared)
            balls[count], gaps[count] = i, distance - radii[i]
            _write_normal(centres, i, side, rho, across / distance, up / distance, normals[count])
            count += 1
    return balls[:count], gaps[:count], normals[:count]
