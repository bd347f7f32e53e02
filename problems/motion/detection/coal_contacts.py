"""Contacts of cylinders with capsules, cylinders and polyhedra, computed by the library coal."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import FloatArray, IntArray
from ...errors import ProblemError
from ..bodies.rigid.polyhedron import Polyhedron
from ..bodies.rigid.round_shapes import Capsule, Cylinder, Sphere
from ..bodies.rigid.shapes import Box, HalfSpace, Shape
from .polyhedra import pack_polyhedra

_Body = tuple[Shape, FloatArray, FloatArray]

CURVED_SAMPLES = 12
"""Number of points of the patch if an end of a cylinder lies on a face."""

TOLERANCE = 1e-10
"""Tolerance of coal for gaps [m]; with its default of 1e-6, gaps of curved shapes have errors of 2e-6."""

MAX_ITERATIONS = 256
"""Iteration limit of coal for one pair of shapes."""

PROBE_GAP = 0.005
"""Gap at which the nearest points are found, divided by the size of the smaller body."""

MAX_PASSES = 20
"""Largest number of moves to ``PROBE_GAP``, each along a better normal; two or three suffice unless rims touch."""

TINY = np.array([0.0, 0.0, 1e-12])
"""Offset that defines a direction between centres that coincide [m]."""

RETRY_SHARES = (0.0, 0.01, 0.1, 1.0)
"""Distances by which bodies are moved apart until coal finds a normal, divided by the size of the smaller body."""

FLATNESS = 1e-3
"""Largest height of points of a patch, divided by the size of the smaller body."""

NEARLY_ALONG = 1.0 - 1e-5
"""Cosine of the largest angle between the contact normal and a face at which the face defines the heights of points;
at larger angles, a plane normal to the contact normal defines them."""

END = 0.7
"""Cosine of the largest angle between contact normal and axis at which a cylinder touches with its end."""

RANKING_OFFSET = np.pi / CURVED_SAMPLES
"""Points of a patch are ranked from this angle [rad] before the first axis, where coal returns no points of an end."""


def needs_coal(first: Shape, second: Shape) -> bool:
    """Return whether coal finds the contacts of two shapes."""
    pairs = (first, second), (second, first)
    return any(isinstance(a, Cylinder) and not isinstance(b, Sphere | HalfSpace) for a, b in pairs)


def find_with_coal(
    shapes: Sequence[Shape], centres: FloatArray, rotations: FloatArray, pairs: IntArray, margin: float
) -> tuple[IntArray, FloatArray]:
    """Return contacts as (first, second, feature), shape (n, 3), and (point, normal, gap), shape (n, 7).

    coal gives the points and the normal of a patch, and one gap for all; the gap of each point is computed from the
    tangent planes of the shapes. Features number the points around their centre in the axes of a cylinder; they persist
    while the number of points is constant.

    Args:
        shapes: shapes of all bodies; no pair contains a half-space.
        centres: centres of the bodies [m], shape (n_bodies, 3).
        rotations: rotation matrices from body to world axes, shape (n_bodies, 3, 3).
        pairs: pairs of bodies, shape (n_pairs, 2).
        margin: gap [m] below which a contact is reported.

    Raises:
        ProblemError: if coal is not installed, or finds no normal for a pair.
    """
    coal = require_coal()
    keys: list[tuple[int, int, int]] = []
    geometry: list[FloatArray] = []
    for i, j in pairs.tolist():
        first, second = ((shapes[body], centres[body], rotations[body]) for body in (i, j))
        patch = list(_patch(coal, first, second, margin))
        axes = first[2] if isinstance(first[0], Cylinder) else second[2]
        for feature, (point, normal, gap) in zip(_features(patch, axes), patch, strict=True):
            if gap < margin:
                keys.append((i, j, feature))
                geometry.append(np.array([*point, *-normal, gap]))
    return np.array(keys, dtype=np.int64).reshape(-1, 3), np.array(geometry, dtype=np.float64).reshape(-1, 7)


def _patch(coal: Any, first: _Body, second: _Body, margin: float) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """Yield point [m], normal from first to second, and gap [m] of each point of the patch of two bodies.

    Near gap 0, coal has errors of 1e-6 m in gaps and 1e-4 in normals, and finds no contact at some poses. The search
    therefore has a larger margin: the second body is moved along the normal to a gap at which coal is exact, and this
    displacement is subtracted from the gap. If bodies are farthest apart along the normal of a face or an axis, this
    direction is the normal, without error.
    """
    size = min(first[0].bounding_radius, second[0].bounding_radius)
    directions = _directions(first, second)
    separations = _separations(first, second, directions)
    best = int(np.argmax(separations))
    gap = least_gap = float(separations[best])
    if least_gap > margin:
        return
    # for bodies that penetrate deeply, coal finds the smallest penetration only at the given poses
    shift = (PROBE_GAP * size - least_gap) * directions[best] if abs(least_gap) < PROBE_GAP * size else np.zeros(3)
    for _ in range(MAX_PASSES):
        result, last_shift = _collide(coal, first, second, shift, (directions, separations), margin + FLATNESS * size)
        if result is None:
            return
        contact = result.getContact(0)
        normal = np.array(contact.normal)
        gap = contact.penetration_depth - last_shift @ normal
        if least_gap >= _separations(first, second, normal):
            normal, gap = directions[best], least_gap
        shift = max(PROBE_GAP * size - gap, 0.0) * normal
        if np.abs(shift - last_shift).max() <= TOLERANCE * size:
            break
    if gap > margin + TOLERANCE * size:
        return
    patch_request, patches = coal.ContactPatchRequest(), coal.ContactPatchResult()
    patch_request.setNumSamplesCurvedShapes(CURVED_SAMPLES)
    patch_request.setPatchTolerance(FLATNESS * size)
    arguments = (*_coal_arguments(coal, first, normal=normal), *_coal_arguments(coal, second, last_shift, normal))
    coal.computeContactPatch(*arguments, result, patch_request, patches)
    if not patches.numContactPatches():
        return
    patch = patches.getContactPatch(0)
    points = [np.array(patch.getPoint(number)) - 0.5 * last_shift for number in range(patch.size())]
    if len(points) == 1:
        yield points[0], normal, gap
        return
    (normal_a, offset_a), (normal_b, offset_b) = _tangent_plane(*first, normal), _tangent_plane(*second, -normal)
    for point in points:
        above = (offset_a - normal_a @ point) / (normal_a @ normal)
        below = (offset_b - normal_b @ point) / (normal_b @ -normal)
        yield point + 0.5 * (above - below) * normal, normal, -float(above + below)


def _features(patch: Sequence[tuple[FloatArray, FloatArray, float]], axes: FloatArray) -> list[int]:
    """Return the rank of each point of a patch by its angle around their centre, in the axes of a cylinder."""
    if len(patch) < 2:
        return [0] * len(patch)
    points, normal = np.array([point for point, _, _ in patch]), patch[0][1]
    along = axes[:, 0] if abs(axes[:, 2] @ normal) > END else axes[:, 2]
    offsets = points - points.mean(axis=0)
    angles = np.arctan2(offsets @ np.cross(normal, along), offsets @ along)
    ranks: list[int] = np.argsort(np.argsort((angles + RANKING_OFFSET) % (2.0 * np.pi))).tolist()
    return ranks


def _collide(
    coal: Any, first: _Body, second: _Body, shift: FloatArray, candidates: tuple[FloatArray, FloatArray], margin: float
) -> tuple[Any, FloatArray]:
    """Return the collision of two bodies by coal, and the displacement of the second body at which it was found.

    The collision is None if the bodies are farther apart than ``margin``. At some poses coal returns no normal, or a
    normal along which the bodies are closer than along one of ``candidates``. The second body is then moved farther
    away.

    Args:
        coal: the module.
        first: shape, centre and rotation of the first body.
        second: those of the second body.
        shift: displacement of the second body [m], shape (3,).
        candidates: directions and the distances along them, as of ``_directions`` and ``_separations``.
        margin: gap [m] up to which coal looks for a collision.

    Raises:
        ProblemError: if coal finds no normal at any of the distances ``RETRY_SHARES``.
    """
    request = coal.CollisionRequest()
    request.gjk_tolerance = request.epa_tolerance = TOLERANCE
    request.gjk_max_iterations = request.epa_max_iterations = MAX_ITERATIONS
    size = min(first[0].bounding_radius, second[0].bounding_radius)
    directions, separations = candidates
    outward = directions[np.argmax(separations + directions @ shift)]
    for share in RETRY_SHARES:
        moved = shift + share * size * outward
        request.security_margin = margin + float(np.linalg.norm(moved))
        result = coal.CollisionResult()
        if not coal.collide(*_coal_arguments(coal, first), *_coal_arguments(coal, second, moved), request, result):
            return None, moved
        contact = result.getContact(0)
        normal = np.array(contact.normal)
        if not abs(np.abs(normal).max() - 0.75) < 0.3:  # 0, NaN or huge
            continue
        separation, slack = _separations(first, second, normal) + normal @ moved, FLATNESS * size
        if (
            abs(separation - contact.penetration_depth) < slack
            and separation > (separations + directions @ moved).max() - slack
        ):
            return result, moved
    names = " and a ".join(type(body[0]).__name__.lower() for body in (first, second))
    raise ProblemError(f"coal does not find the distance of a {names}; change their initial poses slightly.")


def _directions(first: _Body, second: _Body) -> FloatArray:
    """Return unit vectors from first to second along which they may be farthest apart, shape (n, 3).

    These are the directions of the line of centres, of face normals, of axes, and of normals to axes.
    """
    between = second[1] - first[1] + TINY
    vectors = [between[None]]
    for (shape, _, rotation), sign in ((first, 1.0), (second, -1.0)):
        axis = rotation[:, 2]
        if isinstance(shape, Cylinder | Capsule):
            vectors.append(np.array([axis, -axis, between - (between @ axis) * axis]))
        else:
            vectors.append(sign * pack_polyhedra((shape,)).normals @ rotation.T)
    directions = np.concatenate(vectors)
    lengths = np.linalg.norm(directions, axis=1)
    unit: FloatArray = directions[lengths > 0.0] / lengths[lengths > 0.0, None]
    return unit


def _separations(first: _Body, second: _Body, directions: FloatArray) -> Any:
    """Return the distances of two bodies along unit vectors [m]; the largest over all directions is the gap."""
    return directions @ (second[1] - first[1]) - _extents(first, directions) - _extents(second, -directions)


def _coal_arguments(
    coal: Any, body: _Body, shift: FloatArray | None = None, normal: FloatArray | None = None
) -> tuple[Any, Any]:
    """Return the coal geometry and the pose of a body, moved by ``shift``.

    coal finds a single point instead of a patch if the normal points against the axis of a cylinder. The cylinder is
    then reversed, which does not change it.
    """
    shape, centre, rotation = body
    if normal is not None and isinstance(shape, Cylinder) and rotation[:, 2] @ normal < 0.0:
        rotation = rotation * np.array([1.0, -1.0, -1.0])
    return _geometry(shape), coal.Transform3s(rotation, centre if shift is None else centre + shift)


def _tangent_plane(
    shape: Shape, centre: FloatArray, rotation: FloatArray, outward: FloatArray
) -> tuple[FloatArray, float]:
    """Return outward normal and offset [m] of the plane that touches a shape and is nearly normal to ``outward``."""
    local = rotation.T @ outward
    radial = np.array([local[0], local[1], 0.0])
    radial /= max(float(np.linalg.norm(radial)), 1e-300)
    if isinstance(shape, Cylinder):
        candidates = np.array([radial, [0.0, 0.0, np.copysign(1.0, local[2])]])
    elif isinstance(shape, Capsule):
        candidates = radial[None]
    else:
        candidates = pack_polyhedra((shape,)).normals
    normal = candidates[np.argmax(candidates @ local)]
    if normal @ local < NEARLY_ALONG:
        normal = local
    in_world = rotation @ normal
    return in_world, float(_extents((shape, centre, rotation), in_world) + in_world @ centre)


def _extents(body: _Body, directions: FloatArray) -> Any:
    """Return the extents of a body from its centre along unit vectors [m]."""
    shape, _, rotation = body
    local = directions @ rotation
    if isinstance(shape, Cylinder | Capsule):
        along = 0.5 * shape.length * np.abs(local[..., 2])
        return along + shape.radius * (1.0 if isinstance(shape, Capsule) else np.hypot(local[..., 0], local[..., 1]))
    return (local @ pack_polyhedra((shape,)).vertices.T).max(axis=-1)


def require_coal() -> Any:
    """Return the module coal.

    Raises:
        ProblemError: if coal is not installed.
    """
    try:
        return import_module("coal")
    except ImportError:  # missing, or lacks a required library
        raise ProblemError(
            "contacts of a cylinder with a capsule, a cylinder, a box or a polyhedron need coal; "
            'run pip install ".[bodies]" in a clone of proxbench.'
        ) from None


@lru_cache(maxsize=1024)
def _geometry(shape: Shape) -> Any:
    """Return the coal geometry of a shape."""
    coal = require_coal()
    if isinstance(shape, Box):
        return coal.Box(*shape.size)
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
