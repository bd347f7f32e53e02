"""Contacts of pairs of shapes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays import FloatArray, IntArray
from ..bodies.rigid.orientation import rotation_matrices
from ..bodies.rigid.shapes import Box, HalfSpace, Shape

MAX_FEATURES = 1024


@dataclass(frozen=True, eq=False)
class ContactSet:
    """Contacts, ordered by (first, second, feature)."""

    first: IntArray
    second: IntArray
    feature: IntArray
    point: FloatArray
    normal: FloatArray
    gap: FloatArray


def find_contacts(shapes: Sequence[Shape], poses: FloatArray, pairs: IntArray, margin: float) -> ContactSet:
    """Return the contacts of ``pairs`` with a gap below ``margin`` [m]."""
    rotations = rotation_matrices(poses[:, 3:])
    found: list[tuple[Any, ...]] = []
    for a, b in pairs.tolist():
        box, plane = shapes[a], shapes[b]
        assert isinstance(box, Box)
        assert isinstance(plane, HalfSpace)
        normal = rotations[b, :, 2]
        corners = poses[a, :3] + box.vertices @ rotations[a].T
        for number, corner in enumerate(corners):
            gap = float((corner - poses[b, :3]) @ normal)
            if gap < margin:
                found.append((a, b, number, corner - 0.5 * gap * normal, normal, gap))
    n = len(found)
    first = np.array([one[0] for one in found], dtype=np.int64)
    second = np.array([one[1] for one in found], dtype=np.int64)
    feature = np.array([one[2] for one in found], dtype=np.int64)
    point, normals = (np.array([one[k] for one in found]).reshape(n, 3) for k in (3, 4))
    return ContactSet(first, second, feature, point, normals, np.array([one[5] for one in found]))
