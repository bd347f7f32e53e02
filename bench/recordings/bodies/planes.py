"""Fixed half-spaces in recordings: rectangles of their planes, with lines on the ground."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.motion.bodies.rigid.orientation import rotation_matrices
from ....problems.motion.bodies.rigid.rigid_bodies import FixedBody
from ....problems.motion.bodies.rigid.shapes import HalfSpace
from .meshes import Mesh

MIN_GROUND_NORMAL = 0.7
"""Vertical component of the unit normal above which a plane is ground, not a wall."""

MIN_LINES = 5
"""Smallest number of lines from the middle of the ground to its edge."""


@dataclass(frozen=True, eq=False)
class Rectangle:
    """A rectangle of a plane.

    Attributes:
        rotation: the axes of the plane as columns, its normal last, shape (3, 3).
        origin: a point of the plane [m], shape (3,).
        low: smallest coordinates along its first two axes [m], shape (2,).
        high: largest coordinates along these axes [m], shape (2,).
    """

    rotation: FloatArray
    origin: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, body: FixedBody, low: FloatArray, high: FloatArray, half_width: float | None) -> "Rectangle":
        """Return the bounding rectangle of an axis-aligned box, projected onto the plane of a half-space.

        Args:
            body: the half-space.
            low: lowest corner of the box [m], shape (3,).
            high: highest corner [m], shape (3,).
            half_width: if given, return a square of this half width [m] about the middle of the projection instead.
        """
        ends, origin = np.array([low, high]), np.array(body.centre)
        corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        rotation = rotation_matrices(np.array([body.orientation]))[0]
        projected = ((corners - origin) @ rotation)[:, :2]
        if half_width is None:
            return cls(rotation, origin, projected.min(axis=0), projected.max(axis=0))
        middle = projected.mean(axis=0)
        return cls(rotation, origin, middle - half_width, middle + half_width)

    def mesh(self) -> Mesh:
        """Return the rectangle as two triangles."""
        (left, below), (right, above) = self.low, self.high
        corners = np.array([[left, below], [right, below], [right, above], [left, above]])
        return Mesh(self._in_space(corners), np.array([[0, 1, 2], [0, 2, 3]]))

    def grid(self, spacing: float) -> list[FloatArray]:
        """Return lines along both axes, at multiples of ``spacing`` [m] from the origin, each of shape (2, 3)."""
        ends: list[list[float]] = []
        first, last = np.ceil(self.low / spacing), np.floor(self.high / spacing)
        for x in spacing * np.arange(first[0], last[0] + 1.0):
            ends += [[x, self.low[1]], [x, self.high[1]]]
        for y in spacing * np.arange(first[1], last[1] + 1.0):
            ends += [[self.low[0], y], [self.high[0], y]]
        return list(self._in_space(np.array(ends)).reshape(-1, 2, 3))

    def _in_space(self, points: FloatArray) -> FloatArray:
        """Return points of the plane, given by two coordinates [m], in space [m], shape (n, 3)."""
        in_space: FloatArray = points @ self.rotation[:, :2].T + self.origin
        return in_space


def grid_spacing(half_width: float) -> float:
    """Return the spacing of lines on the ground: 1, 2 or 5 times a power of ten [m]."""
    largest = half_width / MIN_LINES
    power = 10.0 ** np.floor(np.log10(largest))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= largest))


def is_ground(body: FixedBody) -> bool:
    """Return whether a fixed body is a half-space that is at most moderately inclined."""
    return isinstance(body.shape, HalfSpace) and bool(_normal(body)[2] > MIN_GROUND_NORMAL)


def faces(body: FixedBody, direction: Sequence[float]) -> bool:
    """Return whether a half-space shows its outside to a camera in a direction, shape (3,)."""
    return bool(_normal(body) @ np.array(direction) > 0.0)


def _normal(body: FixedBody) -> FloatArray:
    normal: FloatArray = rotation_matrices(np.array([body.orientation]))[0, :, 2]
    return normal
