"""Contacts of cylinders with capsules, cylinders and polyhedra, by the library coal."""

from collections.abc import Sequence
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import FloatArray, IntArray
from ...errors import ProblemError
from ..bodies.rigid.polyhedron import Polyhedron
from ..bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from ..bodies.rigid.shapes import Box, Shape

CURVED_SAMPLES = 12
"""Points of the patch where an end of a cylinder lies on a face."""


def find_with_coal(
    shapes: Sequence[Shape], centres: FloatArray, rotations: FloatArray, pairs: IntArray, margin: float
) -> tuple[IntArray, FloatArray]:
    """Return contacts as (first, second, feature), shape (n, 3), and (point, normal, gap), shape (n, 7).

    All points of a patch have the same gap. Features number them in the order of coal, and last while the patch keeps
    its number of points.

    Args:
        shapes: of all bodies; none of a pair is a half-space.
        centres: of the bodies [m], shape (n_bodies, 3).
        rotations: from body to world axes, shape (n_bodies, 3, 3).
        pairs: pairs of bodies, shape (n_pairs, 2).
        margin: gap [m] below which a contact is reported.

    Raises:
        ProblemError: if coal is not installed.
    """
    coal = _coal()
    keys: list[tuple[int, int, int]] = []
    numbers: list[FloatArray] = []
    request = coal.CollisionRequest()
    request.security_margin = margin
    patch_request = coal.ContactPatchRequest()
    patch_request.setNumSamplesCurvedShapes(CURVED_SAMPLES)
    for i, j in pairs.tolist():
        bodies = (
            _geometry(shapes[i]),
            coal.Transform3s(rotations[i], centres[i]),
            _geometry(shapes[j]),
            coal.Transform3s(rotations[j], centres[j]),
        )
        result, patches = coal.CollisionResult(), coal.ContactPatchResult()
        if not coal.collide(*bodies, request, result):
            continue
        coal.computeContactPatch(*bodies, result, patch_request, patches)
        for number in range(patches.numContactPatches()):
            patch = patches.getContactPatch(number)
            if patch.penetration_depth < margin:
                tail = (*-patch.getNormal(), patch.penetration_depth)
                for k in range(patch.size()):
                    keys.append((i, j, k))
                    numbers.append(np.array([*patch.getPoint(k), *tail]))
    return np.array(keys, dtype=np.int64).reshape(-1, 3), np.array(numbers, dtype=np.float64).reshape(-1, 7)


def _coal() -> Any:
    try:
        return import_module("coal")
    except ModuleNotFoundError:
        raise ProblemError(
            "contacts of a cylinder with a capsule, a cylinder or a polyhedron need coal; install it by "
            "pip install 'proxbench[bodies]'."
        ) from None


@lru_cache(maxsize=1024)
def _geometry(shape: Shape) -> Any:
    """Return a shape as a geometry of coal."""
    coal = _coal()
    if isinstance(shape, Box):
        return coal.Box(*shape.size)
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius)
    if isinstance(shape, Capsule):
        return coal.Capsule(shape.radius, shape.length)
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.length)
    assert isinstance(shape, Polyhedron)
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend(list(shape.vertices))
    triangles.extend(
        [coal.Triangle(face[0], face[k], face[k + 1]) for face in shape.faces for k in range(1, len(face) - 1)]
    )
    return coal.Convex(points, triangles)
