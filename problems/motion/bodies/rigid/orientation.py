"""Orientations of rigid bodies: unit quaternions (w, x, y, z), which map vectors from body axes to world axes.

A body that rotates with the angular velocity ω [rad/s], in body axes, for s seconds moves from q to q ⊗ exp(s ω/2).
"""

from collections.abc import Sequence

import numpy as np
from numba import njit

from ....arrays import FloatArray, check_number, finite_vector
from ....errors import ProblemError

IDENTITY = (1.0, 0.0, 0.0, 0.0)
"""The orientation whose body axes are the world axes."""

Y_AXIS, Z_AXIS = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
"""Unit vectors of the world: the axis of rotation in all plane motions of the scenes, and the vertical direction."""

UNIT_TOLERANCE = 1e-6
"""Tolerated deviation of the length of a quaternion from 1."""

MAX_NEWTON_STEPS = 20
"""Largest number of Newton steps per free rotation; a rotation by less than a radian takes four."""


def check_orientation(what: str, quaternion: Sequence[float]) -> None:
    """Check that a quaternion has unit length to ``UNIT_TOLERANCE``.

    Raises:
        ProblemError: if the quaternion does not have four numbers or unit length; the message starts with ``what``.
    """
    if len(quaternion) != 4 or not abs(np.linalg.norm(quaternion) - 1.0) <= UNIT_TOLERANCE:
        raise ProblemError(
            f"{what} must be a unit quaternion (w, x, y, z), got {tuple(quaternion)}; divide it by its length."
        )


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return first ⊗ second, shape (n, 4), from two arrays of this shape: the rotation ``second``, then ``first``."""
    w, x, y, z = first.T
    a, b, c, d = second.T
    return np.column_stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    )


def exponential(vectors: FloatArray) -> FloatArray:
    """Return the quaternions, shape (n, 4), of rotations about ``vectors``, shape (n, 3), by their lengths [rad]."""
    rotations: FloatArray = _exponential(np.ascontiguousarray(vectors, dtype=np.float64))
    return rotations


def about(axis: tuple[float, float, float], angle: float) -> FloatArray:
    """Return the quaternion, shape (4,), of the rotation by ``angle`` [rad] about ``axis``, of any length.

    Raises:
        ProblemError: if the axis is zero or not three finite numbers, or the angle is not a finite number.
    """
    check_number("angle of a rotation", angle)
    direction = finite_vector(axis, "axis", 3)
    if not direction.any():
        raise ProblemError("the axis of a rotation must not be zero; give its direction, such as (1, 0, 0).")
    scaled = direction / np.abs(direction).max()  # the square of a short or long axis underflows or overflows
    unit = scaled / np.linalg.norm(scaled)
    rotation: FloatArray = exponential(angle * unit[None, :])[0]
    return rotation


def rotation_matrices(quaternions: FloatArray) -> FloatArray:
    """Return the matrices, shape (n, 3, 3), of the rotations ``quaternions``, shape (n, 4), from body to world axes.

    Quaternions need not have length 1: extrapolated ones deviate from it by the error of a step.
    """
    matrices: FloatArray = _rotation_matrices(np.ascontiguousarray(quaternions, dtype=np.float64))
    return matrices


def moved(position: FloatArray, velocity: FloatArray, seconds: float) -> FloatArray:
    """Return the poses of bodies that move uniformly for ``seconds``.

    Args:
        position: (x, quaternion) of each body, shape (7 n,).
        velocity: (v in world axes, ω in body axes) of each body, shape (6 n,).
        seconds: time [s], of any sign.

    Returns:
        Poses with unit quaternions, shape (7 n,).
    """
    poses: FloatArray = _moved(position, velocity, seconds)
    return poses


def free_spins(
    spins: FloatArray, inertias: FloatArray, seconds: float, impulses: FloatArray | None = None
) -> FloatArray:
    """Return the spins ω_F = ω_E − J⁻¹ p, where ω_E are the spins after a step with the angular impulses p.

    The implicit midpoint rule for Euler's equations is J (ω_E − ω_B) = −Δt ω_m × J ω_m + p with ω_m = (ω_B + ω_E)/2.
    The gyroscopic moment is normal to ω_m, so it does no work for any p. It is also normal to J ω_m. Without p,
    ½ ωᵀJω and |Jω| are therefore conserved, and ω_F is ω_E. If p has the error O(Δt²), ω_F has the error O(Δt³).

    Args:
        spins: ω_B in body axes [rad/s], shape (n, 3).
        inertias: principal moments J [kg m²], shape (n, 3).
        seconds: Δt [s].
        impulses: p in body axes [N m s], shape (n, 3); 0 if None.

    Returns:
        ω_F in body axes [rad/s], shape (n, 3).
    """
    impulses = np.zeros_like(spins) if impulses is None else np.ascontiguousarray(impulses)
    free_spins: FloatArray = _free_spins(spins, inertias, seconds, impulses)
    return free_spins


@njit(cache=True)
def _rotation_quaternion(x, y, z, scale):  # type: ignore[no-untyped-def]
    """Return the quaternion of a rotation by the vector (x, y, z) times ``scale``."""
    x, y, z = 0.5 * scale * x, 0.5 * scale * y, 0.5 * scale * z
    squared = x * x + y * y + z * z
    if squared < 1e-8:  # sin(a)/a by its series, exact to rounding
        ratio = 1.0 - squared / 6.0 * (1.0 - squared / 20.0)
        return np.sqrt(1.0 - squared * ratio * ratio), ratio * x, ratio * y, ratio * z
    angle = np.sqrt(squared)
    ratio = np.sin(angle) / angle
    return np.cos(angle), ratio * x, ratio * y, ratio * z


@njit(cache=True)
def _exponential(vectors):  # type: ignore[no-untyped-def]
    rotations = np.empty((len(vectors), 4))
    for i in range(len(vectors)):
        w, x, y, z = _rotation_quaternion(vectors[i, 0], vectors[i, 1], vectors[i, 2], 1.0)
        rotations[i, 0], rotations[i, 1], rotations[i, 2], rotations[i, 3] = w, x, y, z
    return rotations


@njit(cache=True)
def _rotation_matrices(quaternions):  # type: ignore[no-untyped-def]
    matrices = np.empty((len(quaternions), 3, 3))
    for i in range(len(quaternions)):
        w, x, y, z = quaternions[i]
        double = 2.0 / (w * w + x * x + y * y + z * z)
        matrices[i, 0, 0] = 1.0 - double * (y * y + z * z)
        matrices[i, 0, 1] = double * (x * y - w * z)
        matrices[i, 0, 2] = double * (x * z + w * y)
        matrices[i, 1, 0] = double * (x * y + w * z)
        matrices[i, 1, 1] = 1.0 - double * (x * x + z * z)
        matrices[i, 1, 2] = double * (y * z - w * x)
        matrices[i, 2, 0] = double * (x * z - w * y)
        matrices[i, 2, 1] = double * (y * z + w * x)
        matrices[i, 2, 2] = 1.0 - double * (x * x + y * y)
    return matrices


@njit(cache=True)
def _moved(position, velocity, seconds):  # type: ignore[no-untyped-def]
    """Return x + s v and q ⊗ exp(s ω/2) of each body, with unit quaternions."""
    end_position = np.empty_like(position)
    for i in range(len(position) // 7):
        p, u = 7 * i, 6 * i
        for axis in range(3):
            end_position[p + axis] = position[p + axis] + seconds * velocity[u + axis]
        a, b, c, d = _rotation_quaternion(velocity[u + 3], velocity[u + 4], velocity[u + 5], seconds)
        w, x, y, z = position[p + 3], position[p + 4], position[p + 5], position[p + 6]
        turned_w = w * a - x * b - y * c - z * d
        turned_x = w * b + x * a + y * d - z * c
        turned_y = w * c - x * d + y * a + z * b
        turned_z = w * d + x * c - y * b + z * a
        length = np.sqrt(turned_w**2 + turned_x**2 + turned_y**2 + turned_z**2)
        end_position[p + 3], end_position[p + 4] = turned_w / length, turned_x / length
        end_position[p + 5], end_position[p + 6] = turned_y / length, turned_z / length
    return end_position


@njit(cache=True)
def _free_spins(spins, inertias, seconds, impulses):  # type: ignore[no-untyped-def]
    """Return ω_F of ``free_spins``: Newton's method for ω_E with the residual r, the Jacobian a and its cofactors c."""
    end_spins = spins.copy()
    for i in range(len(spins)):
        j, begin, end, p = inertias[i], spins[i], end_spins[i], impulses[i]
        scale = max(np.abs(j * begin).max(), np.abs(p).max())
        last_size = np.inf
        for _ in range(MAX_NEWTON_STEPS):
            m0, m1, m2 = 0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1]), 0.5 * (begin[2] + end[2])
            r0 = j[0] * (end[0] - begin[0]) + seconds * (j[2] - j[1]) * m1 * m2 - p[0]
            r1 = j[1] * (end[1] - begin[1]) + seconds * (j[0] - j[2]) * m2 * m0 - p[1]
            r2 = j[2] * (end[2] - begin[2]) + seconds * (j[1] - j[0]) * m0 * m1 - p[2]
            size = max(abs(r0), abs(r1), abs(r2))
            if size == 0.0 or (size >= last_size and size <= 1e-12 * scale):  # the remainder is rounding
                break
            last_size = size
            half = 0.5 * seconds
            a01, a02 = half * (j[2] - j[1]) * m2, half * (j[2] - j[1]) * m1
            a10, a12 = half * (j[0] - j[2]) * m2, half * (j[0] - j[2]) * m0
            a20, a21 = half * (j[1] - j[0]) * m1, half * (j[1] - j[0]) * m0
            c00, c01, c02 = j[1] * j[2] - a12 * a21, a02 * a21 - a01 * j[2], a01 * a12 - a02 * j[1]
            c10, c11, c12 = a12 * a20 - a10 * j[2], j[0] * j[2] - a02 * a20, a02 * a10 - j[0] * a12
            c20, c21, c22 = a10 * a21 - j[1] * a20, a01 * a20 - j[0] * a21, j[0] * j[1] - a01 * a10
            determinant = j[0] * c00 + a01 * c10 + a02 * c20
            end[0] -= (c00 * r0 + c01 * r1 + c02 * r2) / determinant
            end[1] -= (c10 * r0 + c11 * r1 + c12 * r2) / determinant
            end[2] -= (c20 * r0 + c21 * r1 + c22 * r2) / determinant
        end -= p / j
    return end_spins
