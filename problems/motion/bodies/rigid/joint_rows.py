"""Scalar constraints of joints and their derivatives with respect to the velocities of two bodies.

Let p and p' be points of the two bodies, and d = x + R p − x' − R' p' the vector between them. The scalars are

    distance       |d|
    along an axis  (R' n)ᵀ d        for n fixed in the second body
    orientation    (R' n)ᵀ (R f)    for f fixed in the first body, and perpendicular to n where the joint closes
    angle          θ about n, by which the first body is rotated in the second one

They do not change if both bodies move as one. Rates follow from d(R p)/dt = R (ω × p), with ω in body axes.
"""

from dataclasses import dataclass
from math import atan2

import numpy as np

from ....arrays import FloatArray
from .orientation import IDENTITY, rotation_matrices


@dataclass(frozen=True, eq=False)
class JointRow:
    """A scalar of a joint, and its derivatives with respect to (v, ω) of each body, shape (6,)."""

    value: float
    first: FloatArray
    second: FloatArray

    def reversed_to(self, value: float) -> "JointRow":
        """Return a scalar with the given value and the negative derivatives of this one."""
        return JointRow(value, -self.first, -self.second)


@dataclass(frozen=True, eq=False)
class JointPair:
    """The two bodies of a joint at given poses.

    Attributes:
        first_rotation: R, shape (3, 3).
        second_rotation: R'.
        first_point: p in body axes [m].
        second_point: p'.
        distance: the vector d in world axes [m].
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
        """Return the pair at the poses of both bodies, shape (7,); the second body is the world if None."""
        second = np.array([0.0, 0.0, 0.0, *IDENTITY]) if second is None else second
        one, other = rotation_matrices(np.array([first[3:], second[3:]]))
        distance = first[:3] + one @ first_point - second[:3] - other @ second_point
        return cls(one, other, first_point, second_point, distance)

    def length(self) -> JointRow:
        """Return the length |d|."""
        length = float(np.linalg.norm(self.distance))
        return self._along(self.distance / length, length)

    def along_axis(self, axis: FloatArray) -> JointRow:
        """Return the component of d along an axis that is fixed in the second body."""
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
        """Return the row with ``value`` of the component of d along a unit vector that is fixed in the world."""
        first = _cross(self.first_point, direction @ self.first_rotation)
        second = _cross(self.second_point, direction @ self.second_rotation)
        return JointRow(value, np.append(direction, first), -np.append(direction, second))


_NOTHING = np.zeros(3)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a × b of two vectors; ``numpy.cross`` takes ten times as long."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def perpendicular_axes(axis: FloatArray) -> FloatArray:
    """Return three perpendicular unit vectors, shape (3, 3), the first one along ``axis``."""
    unit = axis / np.linalg.norm(axis)
    side = np.cross(unit, np.eye(3)[np.abs(unit).argmin()])
    side /= np.linalg.norm(side)
    return np.array([unit, side, np.cross(unit, side)])
