"""Joints between rigid bodies: constraints, limits, friction and motors, and their rows of W.

Each constraint of a joint holds a scalar at zero; see ``joint_rows``. A ball joint holds three distances along axes. A
revolute joint also holds two orientations. A prismatic joint holds two distances and three orientations, and a fixed
joint three of each. A distance joint holds |d| at its length. Joints constrain velocities; a stepper with a depth
removes the drift of positions (``stepping.position_projection``). Further laws act on the coordinate s of a joint,
which is the angle of a revolute joint or the displacement of a prismatic joint, and on |d| of a rope:

    limits      s ≥ s_min and s ≤ s_max: gaps of unilateral laws, active if g(q_M) < 0 like contacts
    rope        |d| ≤ length, a gap like that of a limit
    friction    −ξ ∈ N_[−aΔt, aΔt](Λ) with ξ = ṡ: a force of at most ``a`` opposes ṡ
    motor       the same with ξ = ṡ − w: a force of at most ``a`` until ṡ reaches the target speed w
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, pi, remainder
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from ....arrays import FloatArray, IntArray
from ....contact.laws import LawKind, Laws
from ....errors import ProblemError
from .joint_rows import JointPair, JointRow, perpendicular_axes
from .orientation import IDENTITY, check_orientation, rotation_matrices
from .rigid_bodies import JointRows

WORLD = -1
"""The index that stands for the world in place of a body; its body axes are the world axes."""

MAX_CLOSING_ERROR = 1e-6
"""Largest residual of a joint at the start of a motion, in m or, for orientations, rad."""

Kind = Literal["ball", "revolute", "prismatic", "fixed", "distance", "rope"]
"""Kinds of joints."""

Vector = tuple[float, float, float]
"""x, y and z."""

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
        second: index of the other one, or ``WORLD``.
        first_point: the point of the first body [m], in its body axes.
        second_point: the point of the second body, likewise.
        axis: direction of a revolute or prismatic joint, of any length, in the body axes of the second one.
        rotation: a unit quaternion that maps vectors from the first body's axes to the second's when a prismatic or
            fixed joint is closed, and when the angle of a revolute joint is 0.
        length: length of a distance joint or of a rope [m].
        friction: largest moment [N m] of friction about the axis of a revolute joint, largest force [N] along that of
            a prismatic one.
        limits: smallest and largest rotation angle of the first body in the second at a revolute joint [rad], or
            displacement of a prismatic one [m]; None for no limits.
        restitution: ε at the limits, or of a rope that tightens.
        motor_speed: target speed of the motor of a revolute [rad/s] or prismatic joint [m/s].
        motor_bound: largest moment [N m] or force [N] of the motor; 0 for no motor.

    Raises:
        ProblemError: for an unknown kind, a point that is not finite, an axis or a length that vanishes, a rotation
            that is not a unit quaternion, a number out of range, or friction, limits or a motor without an axis.
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
        for name in ("first_point", "second_point"):
            point = getattr(self, name)
            if len(point) != 3 or not np.isfinite(point).all():
                raise ProblemError(f"{name} of a joint must be three finite numbers, got {point}.")
        check_orientation("rotation of a joint", self.rotation)
        if len(self.axis) != 3 or not 0.0 < np.linalg.norm(self.axis) < inf:
            raise ProblemError(f"axis of a joint must be three finite numbers that are not all 0, got {self.axis}.")
        if self.kind in ("distance", "rope") and not 0.0 < self.length < inf:
            raise ProblemError(f"the length of a {self.kind} joint must be positive, got {self.length}.")
        for name in ("friction", "motor_bound"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ProblemError(f"{name} of a joint must be finite and not negative, got {getattr(self, name)}.")
        if not isfinite(self.motor_speed):
            raise ProblemError(f"motor_speed of a joint must be finite, got {self.motor_speed}.")
        if not 0.0 <= self.restitution <= 1.0:
            raise ProblemError(f"restitution of a joint must be between 0 and 1, got {self.restitution}.")
        for name in ("friction", "limits", "motor_bound"):
            if getattr(self, name) and self.kind not in ("revolute", "prismatic"):
                raise ProblemError(f"a {self.kind} joint has no axis for {name}; use a revolute or prismatic joint.")
        if self.limits is not None:
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
            joints do no work; a stepper with a depth removes the error of Wᵀ u at the end of each step, other steppers
            let it grow. With 0 the order is 1, and energy is lost.

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
        """Pairs of bodies connected by a joint other than a rope, first < second, shape (n, 2)."""
        joined = [
            sorted((joint.first, joint.second))
            for joint in self.joints
            if joint.second != WORLD and joint.kind != "rope"
        ]
        return np.array(joined, dtype=np.int64).reshape(-1, 2)

    def residual(self, poses: FloatArray) -> FloatArray:
        """Return the residual of the constraints [m or rad], shape (n_rows,), at poses of shape (n, 7)."""
        return np.array([row.value for joint in self.joints for row in _held(joint, _pair(joint, poses))])

    def jacobian(self, poses: FloatArray) -> sp.csc_array[Any]:
        """Return W, shape (6 n, n_rows): the rate of ``residual`` is Wᵀ u."""
        return self._columns([(joint, row) for joint in self.joints for row in _held(joint, _pair(joint, poses))])

    def limits_below(self, poses: FloatArray, margin: float) -> tuple[IntArray, FloatArray, sp.csc_array[Any]]:
        """Return keys, gaps [m or rad] and W of the limits and ropes with a gap below ``margin``."""
        reached = list(self._reached(poses, margin))
        keys, gap = np.array([key for key, *_ in reached], dtype=np.int64), [row.value for _, _, row in reached]
        return keys, np.array(gap), self._columns([(joint, row) for _, joint, row in reached])

    def rows_at(self, poses: FloatArray, seconds: float, margin: float = 0.0) -> JointRows:
        """Return rows, laws and W at poses of shape (n, 7), for a step of ``seconds``.

        Friction and motor of a joint, bounded by a force times the step, follow its constraints. Limits and ropes with
        a gap below ``margin`` follow all joints.
        """
        rows: list[_LawRow] = []
        keys, gaps, counts = [], [], []
        for key, joint in enumerate(self.joints):
            own = list(self._law_rows(joint, poses, seconds))
            if own:
                keys.append(key)
                gaps.append(0.0)
                counts.append(len(own))
                rows += own
        for key, joint, row in self._reached(poses, margin):
            keys.append(key)
            gaps.append(row.value)
            counts.append(1)
            rows.append(_LawRow(joint, row, LawKind.UNILATERAL, restitution=joint.restitution))
        laws = Laws.in_order(
            [row.kind for row in rows],
            np.zeros(len(rows)),
            np.array([row.bound for row in rows]),
            np.full(len(rows), -1),
        )
        return JointRows(
            np.array(keys, dtype=np.int64),
            np.array(gaps),
            np.array(counts, dtype=np.int64),
            laws,
            self._columns([(row.joint, row.row) for row in rows]),
            np.array([row.restitution for row in rows]),
            np.array([row.drive for row in rows]),
        )

    def check_start(self, poses: FloatArray) -> None:
        """Check that all joints close, and that none is beyond a limit.

        Raises:
            ProblemError: for the joint with the largest error, if it exceeds ``MAX_CLOSING_ERROR``.
        """
        pairs = [_pair(joint, poses) for joint in self.joints]
        errors = [
            max((abs(row.value) for row in _held(joint, pair)), default=0.0)
            for joint, pair in zip(self.joints, pairs, strict=True)
        ]
        if max(errors, default=0.0) > MAX_CLOSING_ERROR:
            worst = int(np.argmax(errors))
            raise ProblemError(
                f"joint {worst} does not close at the start: its error is {errors[worst]:.3g} m or rad; correct its "
                "points and axes, or the poses of its bodies."
            )
        beyond = [-min((row.value for row in _gaps(joint, _pair(joint, poses))), default=0.0) for joint in self.joints]
        if max(beyond, default=0.0) > MAX_CLOSING_ERROR:
            worst = int(np.argmax(beyond))
            raise ProblemError(
                f"joint {worst} is {beyond[worst]:.3g} m or rad beyond its limit at the start; widen the limit, or "
                "correct the poses of its bodies."
            )

    def _law_rows(self, joint: Joint, poses: FloatArray, seconds: float) -> "Iterator[_LawRow]":
        """Yield the rows of a joint that is always active."""
        pair = _pair(joint, poses)
        for row in _held(joint, pair):
            yield _LawRow(joint, row, LawKind.BILATERAL, restitution=self.restitution)
        if joint.friction:
            yield _LawRow(joint, _coordinate(joint, pair), LawKind.PLANAR_FRICTION, joint.friction * seconds)
        if joint.motor_bound:
            bound = joint.motor_bound * seconds
            yield _LawRow(joint, _coordinate(joint, pair), LawKind.PLANAR_FRICTION, bound, drive=joint.motor_speed)

    def _reached(self, poses: FloatArray, margin: float) -> Iterator[tuple[int, Joint, JointRow]]:
        """Yield key, joint and row of the limits with a gap below ``margin``; keys follow those of the joints."""
        for number, joint in enumerate(self.joints):
            if joint.limits is None and joint.kind != "rope":
                continue
            for side, row in enumerate(_gaps(joint, _pair(joint, poses))):
                if row.value < margin:
                    yield len(self.joints) + 2 * number + side, joint, row

    def _columns(self, rows: list[tuple[Joint, JointRow]]) -> sp.csc_array[Any]:
        parts = [
            (column, body, part)
            for column, (joint, row) in enumerate(rows)
            for body, part in ((joint.first, row.first), (joint.second, row.second))
            if body != WORLD
        ]
        values = np.array([part for _, _, part in parts]).reshape(-1)
        first_dofs = 6 * np.array([body for _, body, _ in parts], dtype=np.int32)
        dofs = (first_dofs[:, None] + np.arange(6, dtype=np.int32)).reshape(-1)
        columns = np.repeat(np.array([column for column, _, _ in parts], dtype=np.int32), 6)
        kept = values != 0.0
        entries = values[kept], (dofs[kept], columns[kept])
        found: sp.csc_array[Any] = sp.csc_array(entries, shape=(6 * self.n_bodies, len(rows)))
        found.sort_indices()
        return found


@dataclass(frozen=True, eq=False)
class _LawRow:
    """A row with its law: its fixed bound [N s or N m s], its ε, and the target speed of a motor."""

    joint: Joint
    row: JointRow
    kind: LawKind
    bound: float = 0.0
    restitution: float = 0.0
    drive: float = 0.0


def _pair(joint: Joint, poses: FloatArray) -> JointPair:
    second = None if joint.second == WORLD else poses[joint.second]
    return JointPair.create(poses[joint.first], second, np.array(joint.first_point), np.array(joint.second_point))


def _held(joint: Joint, pair: JointPair) -> list[JointRow]:
    """Return the scalars that a joint holds at zero."""
    if joint.kind == "rope":
        return []
    if joint.kind == "distance":
        if not pair.distance.any():
            raise ProblemError("the points of a distance joint coincide; move them apart.")
        row = pair.length()
        return [JointRow(row.value - joint.length, row.first, row.second)]
    held = joint.axes[1:] if joint.kind == "prismatic" else np.eye(3)
    rows = [pair.along_axis(axis) for axis in held]
    in_first = joint.closing_rotation.T
    if joint.kind == "revolute":
        rows += [pair.cosine(in_first @ joint.axes[0], axis) for axis in joint.axes[1:]]
    elif joint.kind in ("prismatic", "fixed"):
        rows += [pair.cosine(in_first[:, i], np.eye(3)[(i + 1) % 3]) for i in range(3)]
    return rows


def _coordinate(joint: Joint, pair: JointPair) -> JointRow:
    """Return the angle of a revolute joint or the displacement of a prismatic one."""
    if joint.kind == "prismatic":
        return pair.along_axis(joint.axes[0])
    return pair.angle(joint.axes, joint.closing_rotation)


def _gaps(joint: Joint, pair: JointPair) -> list[JointRow]:
    """Return the gaps to the limits of a joint, or of a rope, with their rates."""
    if joint.kind == "rope":
        if not pair.distance.any():
            return []
        row = pair.length()
        return [row.reversed_to(joint.length - row.value)]
    if joint.limits is None:
        return []
    low, high = joint.limits
    row = _coordinate(joint, pair)
    value, middle = row.value, 0.5 * (low + high)
    if joint.kind == "revolute":
        value = middle + remainder(value - middle, 2.0 * pi)
    return [JointRow(value - low, row.first, row.second), row.reversed_to(high - value)]
