"""Planar scenes stand in space on the plane y = 0."""

import numpy as np

from ...problems.arrays import FloatArray


def in_space(vectors: FloatArray) -> FloatArray:
    """Return vectors over (x, z), shape (…, 2), as vectors over (x, 0, z), shape (…, 3); spatial ones as they are."""
    if vectors.shape[-1] == 3:
        return vectors
    return np.stack([vectors[..., 0], np.zeros(vectors.shape[:-1]), vectors[..., 1]], axis=-1)
