"""Scalars of joints and their derivatives by the velocities of two bodies.

With the points p and p' of the two bodies and their distance d = x + R p − x' − R' p', they are

    distance       |d|
    along an axis  (R' n)ᵀ d        for n fixed in the second body
    orientation    (R' n)ᵀ (R f)    for f fixed in the first body, and perpendicular to n where the joint closes
    angle          θ about n, by which the first body has turned in the second one

All of them stay as they are when both bodies move as one. Rates follow from d(R p)/dt = R (ω × p), with ω in body axes.
"""

from dataclasses import dataclass
from math import atan2

import numpy as np

from ....arrays import FloatArray
from .orientation import IDENTITY, rotation_matrices


@dataclass(frozen=True, eq=False)
class JointRow:
    """A scalar of a joint, and its derivatives by (v, ω) of both bodies, shape (6,)."""

    value: float
    first: FloatArray
    second: FloatArray

    def reversed_to(self, value: float) -> "JointRow":
        """Return a scalar of this ``value`` that falls as fast as this one rises."""
        return JointRow(value, -self.first, -self.second)


@dataclass(frozen=True, eq=False)
class JointPair:
    """Both bodies of a joint at one position.

    Attributes:
        first_rotation: R, shape (3, 3).
        second_rotation: R'.
        first_point: p in body axes [m].
        second_point: p'.
        distance: d in world axes [m].
    """

    first_rotation: FloatArray
    second_rotation: FloatArray
    first_point: FloatArray
    second_point: FloatArray
    distance: FloatArray

    @classmethod
    def create(
        cls, first: FloatArray, second: FloatArray | None, first_point: FloatArray, second_point: FloatArray
    ) -> "JointPair":
        """Return the bodies at their poses, shape (7,); the second one is the world if None."""
        second = np.array([0.0, 0.0, 0.0, *IDENTITY]) if second is None else second
        one, other = rotation_matrices(np.array([first[3:], second[3:]]))
        distance = first[:3] + one @ first_point - second[:3] - other @ second_point
        return cls(one, other, first_point, second_point, distance)

    def length(self) -> JointRow:
        """Return |d|."""
        length = float(np.linalg.norm(self.distance))
        return self._along(self.distance / length, length)

    def along_axis(self, axis: FloatArray) -> JointRow:
        """Return the distance along an axis that is fixed in the second body."""
        direction = self.second_rotation @ axis
        row = self._along(direction, float(direction @ self.distance))
        turned = np.append(_NOTHING, _cross(axis, self.distance @ self.second_rotation))
        return JointRow(row.value, row.first, row.second + turned)

    def cosine(self, first_axis: FloatArray, second_axis: FloatArray) -> JointRow:
        """Return the cosine between an axis of each body."""
        one, other = self.first_rotation @ first_axis, self.second_rotation @ second_axis
        first = np.append(_NOTHING, _cross(first_axis, other @ self.first_rotation))
        second = np.append(_NOTHING, _cross(second_axis, one @ self.second_rotation))
        return JointRow(float(one @ other), first, second)

    def angle(self, axes: FloatArray, rotation: FloatArray) -> JointRow:
        """Return θ in (−π, π] about ``axes[0]`` of the second body; ``rotation`` turns first axes there at θ = 0."""
        side = self.second_rotation.T @ self.first_rotation @ rotation.T @ axes[1]
        direction = self.second_rotation @ axes[0]
        first, second = np.append(_NOTHING, direction @ self.first_rotation), -np.append(_NOTHING, axes[0])
        return JointRow(atan2(side @ axes[2], side @ axes[1]), first, second)

    def _along(self, direction: FloatArray, value: float) -> JointRow:
        """Return the row of the distance along a unit vector that is fixed in the world, with ``value``."""
        first = _cross(self.first_point, direction @ self.first_rotation)
        second = _cross(self.second_point, direction @ self.second_rotation)
        return JointRow(value, np.append(direction, first), -np.append(direction, second))


_NOTHING = np.zeros(3)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a × b of two vectors, which takes NumPy ten times as long."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def perpendicular_axes(axis: FloatArray) -> FloatArray:
    """Return three perpendicular unit vectors, shape (3, 3), the first one along ``axis``."""
    unit = axis / np.linalg.norm(axis)
    side = np.cross(unit, np.eye(3)[np.abs(unit).argmin()])
    side /= np.linalg.norm(side)
    return np.array([unit, side, np.cross(unit, side)])
