"""The frame N, T1, T2 of a contact from its normal."""

import numpy as np
from numba import njit

from ...arrays import FloatArray


def contact_frames(normals: FloatArray) -> FloatArray:
    """Return N, T1, T2 of spatial contacts as rows, shape (n, 3, 3), from their unit normals, shape (n, 3)."""
    frames = np.empty((len(normals), 3, 3))
    for frame, normal in zip(frames, normals, strict=True):
        write_frame(normal, 3, frame)
    return frames


@njit(cache=True)
def write_frame(normal, dim, rows):  # type: ignore[no-untyped-def]
    """Write N and T (planar) or N, T1, T2 (spatial; Duff et al. 2017, which jumps only at n_z = 0) into ``rows``."""
    x, y, z = normal
    rows[0, 0], rows[0, 1], rows[0, 2] = x, y, z
    if dim == 2:
        rows[1, 0], rows[1, 1] = -y, x
        return
    sign = 1.0 if z >= 0.0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    rows[1, 0], rows[1, 1], rows[1, 2] = 1.0 + sign * x * x * a, sign * b, -sign * x
    rows[2, 0], rows[2, 1], rows[2, 2] = b, sign + y * y * a, -y
