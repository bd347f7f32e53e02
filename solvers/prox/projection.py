"""Projections of one contact's impulses, for use inside kernels."""

import numpy as np
from numba import njit

TINY = 1e-300
"""Keeps 0/0 out of the projection of a zero impulse onto a disc of radius 0."""


@njit(cache=True, inline="always")
def disc_scale(x, y, bound):  # type: ignore[no-untyped-def]
    """Return the factor that projects (x, y) onto the disc of radius ``bound``; exactly 1 inside it.

    Written without a branch: whether a contact slips is what a processor predicts worst.
    """
    return bound / max(np.sqrt(x * x + y * y), max(bound, TINY))
