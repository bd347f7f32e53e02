"""Construction of the contact frame N, T1, T2 from the normal."""

import numpy as np
from numba import njit

from ...arrays import FloatArray


@njit(cache=True, inline="always", error_model="numpy")
def tangents(x, y, z):  # type: ignore[no-untyped-def]
    """Return T1 and T2 for the unit normal (x, y, z).

    The frame is right-handed, and discontinuous only at z = 0 (Duff et al. 2017).
    """
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return (1.0 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)


def contact_frames(normals: FloatArray) -> FloatArray:
    """Return N, T1, T2 of spatial contacts as rows, shape (n, 3, 3), from their unit normals, shape (n, 3)."""
    frames = np.empty((len(normals), 3, 3))
    for frame, normal in zip(frames, normals, strict=True):
        write_frame(normal, 3, frame)
    return frames


@njit(cache=True)
def write_frame(normal, dim, rows):  # type: ignore[no-untyped-def]
    """Write N and T (planar) or N, T1, T2 (spatial, see ``tangents``) into ``rows``."""
    x, y, z = normal[0], normal[1], normal[2]  # unpacking an array would compile for seconds
    rows[0, 0], rows[0, 1], rows[0, 2] = x, y, z
    if dim == 2:
        rows[1, 0], rows[1, 1] = -y, x
        return
    rows[1], rows[2] = tangents(x, y, z)
