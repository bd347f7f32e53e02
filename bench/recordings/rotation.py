"""Orientations of balls, which no motion depends on and only a picture needs: quaternions (x, y, z, w)."""

import numpy as np

from ...problems.arrays import FloatArray


def upright(count: int) -> FloatArray:
    """Return ``count`` unturned orientations, shape (count, 4)."""
    return np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))


def turned(orientations: FloatArray, spins: FloatArray, seconds: float) -> FloatArray:
    """Return orientations turned by constant angular velocities for some time, exactly.

    q⁺ = exp(ω Δt / 2) q with ω in the axes of space.

    Args:
        orientations: unit quaternions (x, y, z, w), shape (n, 4).
        spins: ω [rad/s], shape (n, 3).
        seconds: Δt [s].
    """
    half = 0.5 * seconds * spins
    angle = np.linalg.norm(half, axis=1)
    axis = half * np.sinc(angle / np.pi)[:, None]
    scalar = np.cos(angle)
    x, w = orientations[:, :3], orientations[:, 3]
    vector = scalar[:, None] * x + w[:, None] * axis + np.cross(axis, x)
    product = np.column_stack([vector, scalar * w - (axis * x).sum(axis=1)])
    unit: FloatArray = product / np.linalg.norm(product, axis=1)[:, None]
    return unit


def about_depth(angle: float) -> tuple[float, float, float, float]:
    """Return the orientation of a body of the plane (x, z) that is turned by ``angle`` [rad] from x to z."""
    return 0.0, -float(np.sin(angle / 2.0)), 0.0, float(np.cos(angle / 2.0))
