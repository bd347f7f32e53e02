"""Joints between rigid bodies: constraints, limits, friction and motors, and their rows of W.

Each constraint of a joint holds a scalar at zero; see ``joint_rows``. A ball joint holds three distances along axes. A
revolute joint also holds two orientations. A prismatic joint holds two distances and three orientations, and a fixed
joint three of each. A distance joint holds the distance |d| of its points at its length. Joints constrain velocities;
positions drift unless the stepper projects them (``stepping.position_projection``). Further laws act on the coordinate
s of a joint, which is the angle of a revolute joint or the displacement of a prismatic joint, and on |d| of a rope:

    limits      s ≥ s_min and s ≤ s_max: gaps of unilateral laws, active if g(q_M) < 0 like contacts
    rope        |d| ≤ length, a gap like that of a limit
    friction    −ξ ∈ N_[−aΔt, aΔt](Λ) with ξ = ṡ: a force of at most ``a`` opposes ṡ
    motor       the same with ξ = ṡ − w: a force of at most ``a`` until ṡ reaches the target speed w
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, pi
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy.sparse as sp

from ....arrays import FloatArray, IntArray
from ....contact.laws import LawKind, Laws
from ....errors import ProblemError
from ..system import JointErrors
from .joint_rows import ALONG_AXIS, ANGLE, DISTANCE, ORIENTATION, JointRow, JointTable, columns, perpendicular_axes
from .orientation import IDENTITY, check_orientation, rotation_matrices
from .rigid_bodies import JointRows

WORLD = -1
"""The index of the world, which a joint may connect to a body; its body axes are the world axes."""

MAX_CLOSING_ERROR = 1e-6
"""Largest residual of a joint at the start of a motion, in m or, for orientations, rad."""

Kind = Literal["ball", "revolute", "prismatic", "fixed", "distance", "rope"]
"""Kinds of joints."""

Vector = tuple[float, float, float]
"""x, y and z."""

NO_AXIS: Vector = (0.0, 0.0, 0.0)
"""Placeholder for an axis that a scalar does not have."""

_ROWS: dict[str, tuple[int, int]] = {
    "ball": (3, 0),
    "revolute": (3, 2),
    "prismatic": (2, 3),
    "fixed": (3, 3),
    "distance": (1, 0),
    "rope": (0, 0),
}
"""Numbers of distances and of orientations that each kind of joint holds at zero."""


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies, or between a body and the world.

    Attributes:
        kind: "ball", "revolute", "prismatic", "fixed", "distance" or "rope".
        first: index of a body.
        second: index of the other body, or ``WORLD``.
        first_point: the point of the first body [m], in its body axes.
        second_point: the point of the second body [m], in its body axes.
        axis: direction of a revolute or prismatic joint, of any length, in the body axes of the second body.
        rotation: a unit quaternion that maps vectors from the first body's axes to the second's when a prismatic or
            fixed joint is closed, and when the angle of a revolute joint is 0.
        length: length of a distance joint or of a rope [m].
        friction: largest moment [N m] of friction about the axis of a revolute joint, largest force [N] along that of
            a prismatic one.
        limits: smallest and largest angle of a revolute joint [rad], or displacement of a prismatic one [m], of the
            first body relative to the second; None for no limits.
        restitution: ε at the limits, or of a rope that tightens.
        motor_speed: target speed of the motor of a revolute [rad/s] or prismatic joint [m/s].
        motor_bound: largest moment [N m] or force [N] of the motor; 0 for no motor.

    Raises:
        ProblemError: for an unknown kind, a point that is not finite, an axis or a length that is zero, a rotation
            that is not a unit quaternion, a number out of range, friction, limits or a motor without an axis, a length
            for a joint that has none, or a motor without a bound.
    """

    kind: Kind
    first: int
    second: int = WORLD
    first_point: Vector = (0.0, 0.0, 0.0)
    second_point: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    rotation: tuple[float, float, float, float] = IDENTITY
    length: float = 0.0
    friction: float = 0.0
    limits: tuple[float, float] | None = None
    restitution: float = 0.0
    motor_speed: float = 0.0
    motor_bound: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in _ROWS:
            raise ProblemError(f"there is no joint {self.kind!r}; choose one of {', '.join(_ROWS)}.")
        self._check_geometry()
        self._check_forces()
        self._check_limits()

    def _check_geometry(self) -> None:
        for name in ("first_point", "second_point"):
            point = getattr(self, name)
            if len(point) != 3 or not np.isfinite(point).all():
                raise ProblemError(f"{name} of a joint must be three finite numbers, got {point}.")
        for name in ("first", "second"):
            if not isinstance(getattr(self, name), int | np.integer):
                raise ProblemError(f"{name} of a joint must be the index of a body, got {getattr(self, name)!r}.")
        check_orientation("rotation of a joint", self.rotation)
        if len(self.axis) != 3 or not 0.0 < np.linalg.norm(self.axis) < inf:
            raise ProblemError(f"axis of a joint must be three finite numbers that are not all 0, got {self.axis}.")
        if self.kind in ("distance", "rope") and not 0.0 < self.length < inf:
            raise ProblemError(f"the length of a {self.kind} joint must be positive, got {self.length}.")
        if self.length and self.kind not in ("distance", "rope"):
            raise ProblemError(f"a {self.kind} joint has no length; use a distance joint or a rope.")

    def _check_forces(self) -> None:
        for name in ("friction", "motor_bound"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ProblemError(f"{name} of a joint must be finite and not negative, got {getattr(self, name)}.")
        if not isfinite(self.motor_speed):
            raise ProblemError(f"motor_speed of a joint must be finite, got {self.motor_speed}.")
        if self.motor_speed and not self.motor_bound:
            raise ProblemError("a motor needs motor_bound, its largest moment or force, beside motor_speed.")
        if not 0.0 <= self.restitution <= 1.0:
            raise ProblemError(f"restitution of a joint must be between 0 and 1, got {self.restitution}.")
        for name in ("friction", "limits", "motor_bound"):
            if getattr(self, name) and self.kind not in ("revolute", "prismatic"):
                raise ProblemError(f"a {self.kind} joint has no axis for {name}; use a revolute or prismatic joint.")

    def _check_limits(self) -> None:
        if self.limits is None:
            return
        if np.shape(self.limits) != (2,):
            raise ProblemError(f"limits of a joint must be two numbers, got {self.limits}.")
        low, high = self.limits
        if not low < high or not (isfinite(low) and isfinite(high)):
            raise ProblemError(f"limits of a joint must be finite and ascend, got {self.limits}.")
        if self.kind == "revolute" and high - low >= 2.0 * pi:
            raise ProblemError(f"limits of a revolute joint must be less than 2π apart, got {self.limits}.")

    @property
    def n_rows(self) -> int:
        """Number of scalars that the joint holds at zero."""
        return sum(_ROWS[self.kind])

    @cached_property
    def axes(self) -> FloatArray:
        """Three perpendicular unit vectors in the second body, shape (3, 3), the first one along ``axis``."""
        return perpendicular_axes(np.array(self.axis))

    @cached_property
    def closing_rotation(self) -> FloatArray:
        """The matrix of ``rotation``, shape (3, 3)."""
        matrix: FloatArray = rotation_matrices(np.array([self.rotation]))[0]
        return matrix


@dataclass(frozen=True)
class RigidJoints:
    """Joints of a system of rigid bodies.

    Attributes:
        joints: the joints, in the order of their rows.
        n_bodies: number of moving bodies.
        restitution: ε of the constraints, Wᵀ (u_E + ε u_B) = 0. With 1 the midpoint rule has order 2 and
            joints do no work; the error of Wᵀ u at the end of a step grows unless the stepper projects positions. With
            0 the order is 1, and energy is lost.

    Raises:
        ProblemError: if a joint names a body that does not exist, joins a body to itself, or restitution is outside
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
                        f"joint {number} names body {body} as its {name} body, but bodies are 0 to {self.n_bodies - 1}."
                    )
            if joint.first == joint.second:
                raise ProblemError(f"joint {number} joins body {joint.first} to itself; name another body.")

    @property
    def pairs(self) -> IntArray:
        """Pairs of bodies connected by a joint other than a rope, first < second, shape (n, 2)."""
        joined = [
            sorted((joint.first, joint.second))
            for joint in self.joints
            if joint.second != WORLD and joint.kind != "rope"
        ]
        return np.array(joined, dtype=np.int64).reshape(-1, 2)

    def errors_at(self, poses: FloatArray) -> JointErrors:
        """Return the residual of the constraints [m or rad], and W with the rate Wᵀ u, at poses of shape (n, 7).

        Raises:
            ProblemError: if the points of a distance joint coincide, so that it has no direction.
        """
        values, rates = self._constraints.at(poses)
        if ((self._constraints.kind == DISTANCE) & ~rates.any(axis=(1, 2))).any():
            raise ProblemError("the points of a distance joint coincide; move them apart.")
        return JointErrors(values, columns(self._constraints.bodies, rates, self.n_bodies))

    def limits_below(self, poses: FloatArray, margin: float) -> tuple[IntArray, FloatArray, sp.csc_array[Any]]:
        """Return keys, gaps [m or rad] and W of the limits and ropes with a gap below ``margin``."""
        reached, gap, rates = self._reached_limits(poses, margin)
        return self._gap_keys[reached], gap, columns(self._gaps.bodies[reached], rates, self.n_bodies)

    def rows_at(self, poses: FloatArray, seconds: float, margin: float = 0.0) -> JointRows:
        """Return rows, laws and W at poses of shape (n, 7), for a step of ``seconds``.

        The rows of friction and motor of a joint, bounded by a force times the step, follow its constraints. Limits and
        ropes with a gap below ``margin`` follow all joints.
        """
        table, active = self._active
        _, rates = table.at(poses)
        keys, counts, laws = active.keys, active.counts, self._laws(seconds)
        reached, gap, limit_rates = self._reached_limits(poses, margin)
        n_reached = len(reached)
        if not n_reached:
            directions = columns(table.bodies, rates, self.n_bodies)
            return JointRows(keys, np.zeros(len(keys)), counts, laws, directions, active.restitution, active.drive)
        bodies = np.concatenate([table.bodies, self._gaps.bodies[reached]])
        return JointRows(
            np.concatenate([keys, self._gap_keys[reached]]),
            np.concatenate([np.zeros(len(keys)), gap]),
            np.concatenate([counts, np.ones(n_reached, dtype=np.int64)]),
            Laws.concatenate([laws, Laws.contacts(0.0, 1, n_reached)]),
            columns(bodies, np.concatenate([rates, limit_rates]), self.n_bodies),
            np.concatenate([active.restitution, self._gap_restitution[reached]]),
            np.concatenate([active.drive, np.zeros(n_reached)]),
        )

    def check_start(self, poses: FloatArray) -> None:
        """Check that all joints close, and that none is beyond a limit.

        Raises:
            ProblemError: if an error exceeds ``MAX_CLOSING_ERROR``; the message names the joint with the largest error.
        """
        values = np.abs(self._constraints.at(poses)[0])
        ends = np.cumsum([joint.n_rows for joint in self.joints], dtype=np.int64)
        errors = [residual.max(initial=0.0) for residual in np.split(values, ends)[:-1]]
        if max(errors, default=0.0) > MAX_CLOSING_ERROR:
            worst = int(np.argmax(errors))
            raise ProblemError(
                f"joint {worst} does not close at the start: its error is {errors[worst]:.3g} m or rad; correct its "
                "points and axes, or the poses of its bodies."
            )
        reached, gap, _ = self._reached_limits(poses, -MAX_CLOSING_ERROR)
        if len(gap):
            worst = (int(self._gap_keys[reached[gap.argmin()]]) - len(self.joints)) // 2
            raise ProblemError(
                f"joint {worst} is {-gap.min():.3g} m or rad beyond its limit at the start; widen the limit, or "
                "correct the poses of its bodies."
            )

    def _reached_limits(self, poses: FloatArray, margin: float) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return indices, gaps and derivatives of limits with a gap below ``margin``, without ropes with |d| = 0."""
        if not len(self._gaps.kind):
            return self._gap_keys, np.zeros(0), np.zeros((0, 2, 6))
        values, rates = self._gaps.at(poses)
        reached = np.flatnonzero((values < margin) & rates.any(axis=(1, 2)))
        return reached, values[reached], rates[reached]

    def _laws(self, seconds: float) -> Laws:
        """Return the laws of the rows that are active at all times, cached for steps of equal length."""
        if seconds not in self._last_laws:
            _, active = self._active
            n = len(active.kind)
            self._last_laws.clear()
            self._last_laws[seconds] = Laws.in_order(active.kind, np.zeros(n), active.bound * seconds, np.full(n, -1))
        return self._last_laws[seconds]

    @cached_property
    def _last_laws(self) -> dict[float, Laws]:
        """The laws of the last step, by its length [s]."""
        return {}

    @cached_property
    def _constraints(self) -> JointTable:
        """The scalars that all joints hold at zero."""
        return JointTable.of([row for joint in self.joints for row in _constraint_rows(joint)])

    @cached_property
    def _gaps(self) -> JointTable:
        """The gaps of all limits and ropes."""
        return JointTable.of([row for joint in self.joints for row in _gap_rows(joint)])

    @cached_property
    def _gap_keys(self) -> IntArray:
        """Keys of ``_gaps``, which follow those of the joints: two for each joint."""
        keys = [
            len(self.joints) + 2 * number + side
            for number, joint in enumerate(self.joints)
            for side in range(len(_gap_rows(joint)))
        ]
        return np.array(keys, dtype=np.int64)

    @cached_property
    def _gap_restitution(self) -> FloatArray:
        """ε of ``_gaps``."""
        return np.array([joint.restitution for joint in self.joints for _ in _gap_rows(joint)], dtype=np.float64)

    @cached_property
    def _active(self) -> "tuple[JointTable, _ActiveRows]":
        """The rows that are active at all times, and their laws."""
        rows = [self._active_rows(joint) for joint in self.joints]
        keys = np.array([key for key, joint_rows in enumerate(rows) if joint_rows], dtype=np.int64)
        counts = np.array([len(joint_rows) for joint_rows in rows if joint_rows], dtype=np.int64)
        law_rows = [row for joint_rows in rows for row in joint_rows]
        bounds = np.array([row[2:] for row in law_rows], dtype=np.float64).reshape(-1, 3).T.copy()
        kinds = np.array([row.kind for row in law_rows], dtype=np.int64)
        return JointTable.of([row.row for row in law_rows]), _ActiveRows(keys, counts, kinds, *bounds)

    def _active_rows(self, joint: Joint) -> "list[_LawRow]":
        """Return the rows of a joint that are active at all times."""
        rows = [_LawRow(row, LawKind.BILATERAL, restitution=self.restitution) for row in _constraint_rows(joint)]
        if joint.friction:
            rows.append(_LawRow(_coordinate_row(joint), LawKind.PLANAR_FRICTION, joint.friction))
        if joint.motor_bound:
            motor = _LawRow(_coordinate_row(joint), LawKind.PLANAR_FRICTION, joint.motor_bound, drive=joint.motor_speed)
            rows.append(motor)
        return rows


class _LawRow(NamedTuple):
    """A row with its law: its fixed bound [N or N m], its ε, and the target speed of a motor."""

    row: JointRow
    kind: LawKind
    bound: float = 0.0
    restitution: float = 0.0
    drive: float = 0.0


class _ActiveRows(NamedTuple):
    """Keys of joints, their numbers of rows, and the laws of all rows; see ``_LawRow``."""

    keys: IntArray
    counts: IntArray
    kind: IntArray
    bound: FloatArray
    restitution: FloatArray
    drive: FloatArray


def _row(joint: Joint, kind: int, first_axis: Vector | FloatArray, second_axis: Vector | FloatArray) -> JointRow:
    """Return the row of a scalar between the points of a joint; axes are in the body axes of either body."""
    points = np.array([joint.first_point, joint.second_point])
    return JointRow(kind, (joint.first, joint.second), points, np.array(first_axis), np.array(second_axis))


def _constraint_rows(joint: Joint) -> list[JointRow]:
    """Return the scalars that a joint holds at zero."""
    if joint.kind == "rope":
        return []
    if joint.kind == "distance":
        return [_row(joint, DISTANCE, NO_AXIS, NO_AXIS).plus(-joint.length)]
    axes = joint.axes[1:] if joint.kind == "prismatic" else np.eye(3)
    rows = [_row(joint, ALONG_AXIS, NO_AXIS, axis) for axis in axes]
    second_to_first = joint.closing_rotation.T
    if joint.kind == "revolute":
        rows += [_row(joint, ORIENTATION, second_to_first @ joint.axes[0], axis) for axis in joint.axes[1:]]
    elif joint.kind in ("prismatic", "fixed"):
        rows += [_row(joint, ORIENTATION, second_to_first[:, i], np.eye(3)[(i + 1) % 3]) for i in range(3)]
    return rows


def _coordinate_row(joint: Joint) -> JointRow:
    """Return the angle of a revolute joint or the displacement of a prismatic one."""
    along, side, _ = joint.axes
    if joint.kind == "prismatic":
        return _row(joint, ALONG_AXIS, NO_AXIS, along)
    return _row(joint, ANGLE, joint.closing_rotation.T @ side, along)._replace(side=side)


def _gap_rows(joint: Joint) -> list[JointRow]:
    """Return the gaps of the limits of a joint, or of a rope."""
    if joint.kind == "rope":
        return [_row(joint, DISTANCE, NO_AXIS, NO_AXIS).minus(joint.length)]
    if joint.limits is None:
        return []
    low, high = joint.limits
    row = _coordinate_row(joint)._replace(middle=0.5 * (low + high))
    return [row.plus(-low), row.minus(high)]
