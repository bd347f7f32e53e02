"""Scalar functions of the poses of two bodies that joints constrain, and their derivatives; one per row of a table.

Let x, R and x', R' be the positions and rotations of the two bodies, p and p' points in their axes, and
d = x + R p − x' − R' p' the vector between these points. The scalar functions are

    distance       |d|
    along an axis  (R' n)ᵀ d        for n fixed in the second body
    orientation    (R' n)ᵀ (R f)    for f fixed in the first body, and perpendicular to n if the joint is closed
    angle          θ about n of the first body relative to the second one; f points along s ⊥ n at θ = 0

The scalars do not change if both bodies move as one. Their derivatives, called rates, follow from
d(R p)/dt = R (ω × p), with ω in body axes.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit

from ....arrays import FloatArray, IntArray
from ....contact.matrices.user_matrices import compressed_columns
from ...detection.clipping import dot
from .orientation import rotation_matrices

DISTANCE, ALONG_AXIS, ORIENTATION, ANGLE = range(4)
"""Kinds of scalar functions, in the order above."""

_NOTHING = np.zeros(3)

_WORLD_POSE = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])


class JointRow(NamedTuple):
    """The value ± scalar + offset of a joint.

    Attributes:
        kind: kind of the scalar.
        bodies: indices of the two bodies, −1 for the world.
        points: p and p' in body axes [m], shape (2, 3).
        first_axis: f in axes of the first body, shape (3,).
        second_axis: n in axes of the second body, shape (3,).
        side: s, a unit vector in axes of the second body, perpendicular to n, shape (3,).
        sign: 1 or −1.
        offset: number to add [m or rad].
        middle: centre of the interval of length 2π to which an angle is reduced [rad].
    """

    kind: int
    bodies: tuple[int, int]
    points: FloatArray
    first_axis: FloatArray = _NOTHING
    second_axis: FloatArray = _NOTHING
    side: FloatArray = _NOTHING
    sign: float = 1.0
    offset: float = 0.0
    middle: float = 0.0

    def plus(self, offset: float) -> "JointRow":
        """Return the row of ± scalar + offset, with the sign of this row; the offset replaces that of this row."""
        return self._replace(offset=offset)

    def minus(self, offset: float) -> "JointRow":
        """Return the row of offset − scalar; the offset replaces that of this row."""
        return self._replace(sign=-1.0, offset=offset)


class JointTable(NamedTuple):
    """Rows as arrays: each attribute of ``JointRow`` for all rows."""

    kind: IntArray
    bodies: IntArray
    points: FloatArray
    first_axis: FloatArray
    second_axis: FloatArray
    side: FloatArray
    sign: FloatArray
    offset: FloatArray
    middle: FloatArray

    @classmethod
    def of(cls, rows: Sequence[JointRow]) -> "JointTable":
        """Return the table of rows."""
        n = len(rows)
        kind, bodies, *others = zip(*rows, strict=True) if rows else [()] * len(cls._fields)
        shapes = (n, 2, 3), (n, 3), (n, 3), (n, 3), (n,), (n,), (n,)
        columns = [
            np.array(given, dtype=np.float64).reshape(shape) for given, shape in zip(others, shapes, strict=True)
        ]
        return cls(np.array(kind, dtype=np.int64), np.array(bodies, dtype=np.int64).reshape(n, 2), *columns)

    def at(self, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return values, and their derivatives with respect to (v, ω) of each body.

        Args:
            poses: (x [m], quaternion) of each body, shape (n_bodies, 7).

        Returns:
            Values [m or rad], shape (n,), and derivatives, shape (n, 2, 6). The derivatives of a zero distance are 0.
        """
        all_poses = np.concatenate([poses, _WORLD_POSE])  # the index −1 selects the world
        values, rates = _evaluate(self, all_poses, rotation_matrices(all_poses[:, 3:]))
        return values, rates


def columns(bodies: IntArray, rates: FloatArray, n_bodies: int) -> sp.csc_array[Any]:
    """Return W, shape (6 n_bodies, n): one column for each row with derivatives ``rates``, shape (n, 2, 6)."""
    return compressed_columns(_columns(bodies, rates), (6 * n_bodies, len(rates)))


@njit(cache=True)
def _evaluate(table, poses, rotations):  # type: ignore[no-untyped-def]
    """Return values and derivatives as ``JointTable.at``; the last pose and rotation are those of the world."""
    n = len(table.kind)
    values, rates = np.empty(n), np.zeros((n, 2, 6))
    for row in range(n):
        (i, j), kind, side = table.bodies[row], table.kind[row], table.side[row]
        first, second = rotations[i], rotations[j]
        p, q = _vector(table.points[row, 0]), _vector(table.points[row, 1])
        f, n_axis = _vector(table.first_axis[row]), _vector(table.second_axis[row])
        first_arm, second_arm = _to_world(first, p), _to_world(second, q)
        d = (
            poses[i, 0] + first_arm[0] - poses[j, 0] - second_arm[0],
            poses[i, 1] + first_arm[1] - poses[j, 1] - second_arm[1],
            poses[i, 2] + first_arm[2] - poses[j, 2] - second_arm[2],
        )
        along, nothing = _to_world(second, n_axis), (0.0, 0.0, 0.0)
        if kind in (DISTANCE, ALONG_AXIS):
            value = dot(along, d)
            if kind == DISTANCE:
                value = np.sqrt(dot(d, d))
                along = nothing if value == 0.0 else (d[0] / value, d[1] / value, d[2] / value)
            _write(rates[row, 0], 1.0, along, _cross(p, _to_body(first, along)))
            turned = _cross(q, _to_body(second, along))
            if kind == ALONG_AXIS:
                lever = _cross(n_axis, _to_body(second, d))
                turned = (turned[0] - lever[0], turned[1] - lever[1], turned[2] - lever[2])
            _write(rates[row, 1], -1.0, along, turned)
        elif kind == ORIENTATION:
            f_world = _to_world(first, f)
            value = dot(f_world, along)
            _write(rates[row, 0], 1.0, nothing, _cross(f, _to_body(first, along)))
            _write(rates[row, 1], 1.0, nothing, _cross(n_axis, _to_body(second, f_world)))
        else:
            now, start = _to_body(second, _to_world(first, f)), _vector(side)
            value = np.arctan2(dot(now, _cross(n_axis, start)), dot(now, start))
            turns = np.rint((value - table.middle[row]) / (2.0 * np.pi))
            value -= 2.0 * np.pi * turns
            _write(rates[row, 0], 1.0, nothing, _to_body(first, along))
            _write(rates[row, 1], -1.0, nothing, n_axis)
        values[row] = table.sign[row] * value + table.offset[row]
        if table.sign[row] < 0.0:
            rates[row] *= -1.0
    return values, rates


@njit(cache=True)
def _columns(bodies, rates):  # type: ignore[no-untyped-def]
    """Return the nonzero entries, their ascending dofs, and the start of each column; the world has no dofs."""
    n = len(bodies)
    data, dofs = np.empty(12 * n), np.empty(12 * n, dtype=np.int32)
    starts, count = np.zeros(n + 1, dtype=np.int32), 0
    for row in range(n):
        lower = 0 if bodies[row, 0] < bodies[row, 1] else 1
        for side in (lower, 1 - lower):
            for k in range(6):
                if bodies[row, side] >= 0 and rates[row, side, k] != 0.0:
                    data[count], dofs[count] = rates[row, side, k], 6 * bodies[row, side] + k
                    count += 1
        starts[row + 1] = count
    return data[:count], dofs[:count], starts


@njit(cache=True)
def _write(rates, sign, linear, angular):  # type: ignore[no-untyped-def]
    for axis in range(3):
        rates[axis], rates[3 + axis] = sign * linear[axis], sign * angular[axis]


@njit(cache=True)
def _vector(array):  # type: ignore[no-untyped-def]
    return array[0], array[1], array[2]


@njit(cache=True)
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _to_world(rotation, vector):  # type: ignore[no-untyped-def]
    return dot(rotation[0], vector), dot(rotation[1], vector), dot(rotation[2], vector)


@njit(cache=True)
def _to_body(rotation, vector):  # type: ignore[no-untyped-def]
    return dot(rotation[:, 0], vector), dot(rotation[:, 1], vector), dot(rotation[:, 2], vector)


def perpendicular_axes(axis: FloatArray) -> FloatArray:
    """Return three perpendicular unit vectors, shape (3, 3), the first one along ``axis``."""
    unit = axis / np.linalg.norm(axis)
    side = np.cross(unit, np.eye(3)[np.abs(unit).argmin()])
    side /= np.linalg.norm(side)
    return np.array([unit, side, np.cross(unit, side)])
