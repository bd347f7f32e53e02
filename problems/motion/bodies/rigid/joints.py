"""Joints between rigid bodies: what they hold together, and the rows of W that belong to it.

With the points p and p' of the two bodies and their distance d = x + R p − x' − R' p', a joint holds scalars at zero:

    distance       |d| − length
    along an axis  (R' n)ᵀ d        for n fixed in the second body
    orientation    (R' n)ᵀ (R f)    for f fixed in the first body, and perpendicular to n where the joint closes

A ball joint is three of the second kind, a revolute joint a ball joint and two of the third, a prismatic one two of the
second and three of the third, a fixed one three of each. All of them stay as they are when both bodies move as one.
Rates follow from d(R p)/dt = R (ω × p), with ω in body axes. Joints hold on velocities; a stepper with a depth takes
the drift of positions out (``stepping.position_projection``).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from ....arrays import FloatArray, IntArray
from ....contact.laws import LawKind, Laws
from ....errors import ProblemError
from .orientation import IDENTITY, rotation_matrices
from .rigid_bodies import JointRows

WORLD = -1
"""The index that stands for the world in place of a body; its body axes are the world axes."""

MAX_CLOSING_ERROR = 1e-6
"""Largest residual of a joint at the start of a motion, in m or, for orientations, rad."""

Kind = Literal["ball", "revolute", "prismatic", "fixed", "distance"]
Vector = tuple[float, float, float]

_ROWS: dict[str, tuple[int, int]] = {"ball": (3, 0), "revolute": (3, 2), "prismatic": (2, 3), "fixed": (3, 3)}


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies, or between a body and the world.

    Attributes:
        kind: "ball", "revolute", "prismatic", "fixed" or "distance".
        first: index of a body.
        second: index of the other one, or ``WORLD``.
        first_point: the point of the first body [m], in its body axes.
        second_point: the point of the second one.
        axis: direction of a revolute or prismatic joint, of any length, in the body axes of the second one.
        first_axis: direction of a revolute joint in the body axes of the first one; ``axis`` if None.
        rotation: a unit quaternion that turns vectors from the first body's axes into the second's where a prismatic
            or fixed joint closes.
        length: length of a distance joint [m].
        friction: largest moment [N m] of friction about the axis of a revolute joint, largest force [N] along that of
            a prismatic one.

    Raises:
        ProblemError: for an unknown kind, an axis or a length that vanishes, or friction where there is no axis.
    """

    kind: Kind
    first: int
    second: int = WORLD
    first_point: Vector = (0.0, 0.0, 0.0)
    second_point: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    first_axis: Vector | None = None
    rotation: tuple[float, float, float, float] = IDENTITY
    length: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        if self.kind != "distance" and self.kind not in _ROWS:
            raise ProblemError(f"there is no joint {self.kind!r}; choose one of {', '.join((*_ROWS, 'distance'))}.")
        for name in ("axis", "first_axis"):
            given = getattr(self, name)
            if given is not None and not 0.0 < np.linalg.norm(given) < np.inf:
                raise ProblemError(f"the {name} of a joint must be finite and not vanish, got {given}.")
        if self.kind == "distance" and not 0.0 < self.length < np.inf:
            raise ProblemError(f"the length of a distance joint must be positive, got {self.length}.")
        if not 0.0 <= self.friction < np.inf:
            raise ProblemError(f"friction of a joint must be finite and not negative, got {self.friction}.")
        if self.friction and self.kind not in ("revolute", "prismatic"):
            raise ProblemError(f"a {self.kind} joint has no axis for friction; use a revolute or prismatic joint.")

    @property
    def n_rows(self) -> int:
        """Number of scalars that the joint holds at zero."""
        return 1 if self.kind == "distance" else sum(_ROWS[self.kind])


@dataclass(frozen=True)
class RigidJoints:
    """Joints of a system of rigid bodies.

    Attributes:
        joints: the joints, in the order of their rows.
        n_bodies: number of bodies that move.
        restitution: ε of what joints hold at zero, Wᵀ (u_E + ε u_B) = 0. With 1 the midpoint rule has order 2 and
            joints do no work, but an error of Wᵀ u is never damped and can grow where the step is long for the fastest
            oscillation. With 0 the order is 1, and energy is lost.

    Raises:
        ProblemError: if a joint names a body that does not exist, or joins a body to itself, or restitution is outside
            [0, 1].
    """

    joints: Sequence[Joint]
    n_bodies: int
    restitution: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.restitution <= 1.0:
            raise ProblemError(f"restitution of joints must be between 0 and 1, got {self.restitution}.")
        for number, joint in enumerate(self.joints):
            for name, body, lowest in (("first", joint.first, 0), ("second", joint.second, WORLD)):
                if not lowest <= body < self.n_bodies:
                    raise ProblemError(
                        f"joint {number} names body {body} as its {name} one, but bodies are 0 to {self.n_bodies - 1}."
                    )
            if joint.first == joint.second:
                raise ProblemError(f"joint {number} joins body {joint.first} to itself; name another body.")

    @property
    def pairs(self) -> IntArray:
        """The bodies that are joined to each other, first < second, shape (n, 2)."""
        joined = [sorted((joint.first, joint.second)) for joint in self.joints if joint.second != WORLD]
        return np.array(joined, dtype=np.int64).reshape(-1, 2)

    def residual(self, poses: FloatArray) -> FloatArray:
        """Return what the joints hold at zero [m or rad], shape (n_rows,), at poses of shape (n, 7)."""
        return np.array([row.value for joint in self.joints for row in _rows(joint, poses)])

    def jacobian(self, poses: FloatArray) -> sp.csc_array[Any]:
        """Return W, shape (6 n, n_rows): the rate of ``residual`` is Wᵀ u."""
        rows = [(joint, row) for joint in self.joints for row in _rows(joint, poses)]
        return self._columns(rows)

    def rows_at(self, poses: FloatArray, seconds: float) -> JointRows:
        """Return rows, laws and W at poses of shape (n, 7), for a step of ``seconds``.

        Friction of a joint is one row of its own after those that it holds, bounded by a force times the step.
        """
        rows: list[tuple[Joint, _Row]] = []
        counts, kinds, bounds = [], [], []
        for joint in self.joints:
            own = _rows(joint, poses)
            rows += [(joint, row) for row in own]
            counts.append(len(own))
            kinds += [LawKind.BILATERAL] * len(own)
            bounds += [0.0] * len(own)
            if joint.friction:
                rows.append((joint, _friction_row(joint, poses)))
                counts[-1] += 1
                kinds.append(LawKind.PLANAR_FRICTION)
                bounds.append(joint.friction * seconds)
        n_rows = len(rows)
        laws = Laws(
            np.array(kinds, dtype=np.int8),
            np.arange(n_rows),
            np.zeros(n_rows),
            np.array(bounds),
            np.full(n_rows, -1),
        )
        return JointRows(np.array(counts, dtype=np.int64), laws, self._columns(rows), self.restitution)

    def check_start(self, poses: FloatArray) -> None:
        """Check that all joints close.

        Raises:
            ProblemError: for the joint that misses by most, if that is more than ``MAX_CLOSING_ERROR``.
        """
        errors = [max(abs(row.value) for row in _rows(joint, poses)) for joint in self.joints]
        if max(errors, default=0.0) > MAX_CLOSING_ERROR:
            worst = int(np.argmax(errors))
            raise ProblemError(
                f"joint {worst} does not close at the start: it misses by {errors[worst]:.3g} m or rad; correct its "
                "points and axes, or the poses of its bodies."
            )

    def _columns(self, rows: "list[tuple[Joint, _Row]]") -> sp.csc_array[Any]:
        columns = np.zeros((6 * self.n_bodies, len(rows)))
        for column, (joint, row) in enumerate(rows):
            columns[6 * joint.first : 6 * joint.first + 6, column] = row.first
            if joint.second != WORLD:
                columns[6 * joint.second : 6 * joint.second + 6, column] = row.second
        return sp.csc_array(columns)


@dataclass(frozen=True, eq=False)
class _Row:
    """A scalar that is held at zero, and its derivatives by (v, ω) of both bodies, shape (6,)."""

    value: float
    first: FloatArray
    second: FloatArray


@dataclass(frozen=True, eq=False)
class _Pair:
    """Both bodies of a joint at one position: their rotations R, points p in body axes, and the distance d."""

    first_rotation: FloatArray
    second_rotation: FloatArray
    first_point: FloatArray
    second_point: FloatArray
    distance: FloatArray

    @classmethod
    def create(cls, joint: Joint, poses: FloatArray) -> "_Pair":
        """Return the bodies of a joint at poses of shape (n, 7)."""
        first = poses[joint.first]
        second = np.array([0.0, 0.0, 0.0, *IDENTITY]) if joint.second == WORLD else poses[joint.second]
        rotations = rotation_matrices(np.array([first[3:], second[3:]]))
        p, q = np.array(joint.first_point), np.array(joint.second_point)
        distance = first[:3] + rotations[0] @ p - second[:3] - rotations[1] @ q
        return cls(rotations[0], rotations[1], p, q, distance)

    def along(self, direction: FloatArray, value: float) -> _Row:
        """Return the row of the distance along a unit vector that is fixed in the world, with ``value``."""
        first = np.cross(self.first_point, direction @ self.first_rotation)
        second = np.cross(self.second_point, direction @ self.second_rotation)
        return _Row(value, np.append(direction, first), -np.append(direction, second))

    def along_axis(self, axis: FloatArray) -> _Row:
        """Return the row of the distance along an axis that is fixed in the second body."""
        direction = self.second_rotation @ axis
        row = self.along(direction, float(direction @ self.distance))
        turned = np.append(np.zeros(3), np.cross(axis, self.distance @ self.second_rotation))
        return _Row(row.value, row.first, row.second + turned)

    def angle(self, first_axis: FloatArray, second_axis: FloatArray) -> _Row:
        """Return the row of the cosine between an axis of each body."""
        one, other = self.first_rotation @ first_axis, self.second_rotation @ second_axis
        nothing = np.zeros(3)
        first = np.append(nothing, np.cross(first_axis, other @ self.first_rotation))
        second = np.append(nothing, np.cross(second_axis, one @ self.second_rotation))
        return _Row(float(one @ other), first, second)


def _rows(joint: Joint, poses: FloatArray) -> list[_Row]:
    """Return the rows that a joint holds at zero."""
    pair = _Pair.create(joint, poses)
    if joint.kind == "distance":
        length = float(np.linalg.norm(pair.distance))
        if length == 0.0:
            raise ProblemError("the points of a distance joint coincide; move them apart.")
        return [pair.along(pair.distance / length, length - joint.length)]
    axes = _axes(joint.axis)
    held = axes[1:] if joint.kind == "prismatic" else np.eye(3)
    rows = [pair.along_axis(axis) for axis in held]
    if joint.kind == "revolute":
        first_axis = np.array(joint.axis if joint.first_axis is None else joint.first_axis)
        first_axis = first_axis / np.linalg.norm(first_axis)
        rows += [pair.angle(first_axis, axis) for axis in axes[1:]]
    elif joint.kind in ("prismatic", "fixed"):
        in_first = rotation_matrices(np.array([joint.rotation]))[0].T
        rows += [pair.angle(in_first[:, i], np.eye(3)[(i + 1) % 3]) for i in range(3)]
    return rows


def _friction_row(joint: Joint, poses: FloatArray) -> _Row:
    """Return the row of the relative velocity about or along the axis of a joint."""
    pair, axis = _Pair.create(joint, poses), _axes(joint.axis)[0]
    if joint.kind == "prismatic":
        return pair.along_axis(axis)
    nothing, direction = np.zeros(3), pair.second_rotation @ axis
    return _Row(0.0, np.append(nothing, direction @ pair.first_rotation), -np.append(nothing, axis))


def _axes(axis: Vector) -> FloatArray:
    """Return three perpendicular unit vectors, shape (3, 3), the first one along ``axis``."""
    unit = np.array(axis) / np.linalg.norm(axis)
    side = np.cross(unit, np.eye(3)[np.abs(unit).argmin()])
    side /= np.linalg.norm(side)
    return np.array([unit, side, np.cross(unit, side)])
