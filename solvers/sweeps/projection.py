"""Projection of one spatial friction impulse, for use inside kernels."""

import numpy as np
from numba import njit


@njit(cache=True, inline="always")
def disc_scale(x, y, bound):  # type: ignore[no-untyped-def]
    """Return the factor that projects (x, y) onto the disc of radius ``bound``; exactly 1 inside it."""
    scale = 1.0
    squared = x * x + y * y
    if squared > bound * bound:
        scale = bound / np.sqrt(squared)
    return scale
