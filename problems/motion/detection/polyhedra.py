"""Contacts of convex polyhedra, boxes among them, with each other and with half-spaces.

Two polyhedra touch in the direction in which they overlap least, among the normals of their faces and the normals of
pairs of edges (separating axes). For the normal of a face, the opposing face of the other body is clipped by the
sides of that face, and each remaining corner is a contact. For two edges, there is one contact.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray
from ...compilation.kernel_arrays import copy_entries
from ..bodies.rigid.polyhedron import DIRECTION_TOLERANCE, MAX_CORNERS, MAX_FACES, Polyhedron
from ..bodies.rigid.shapes import Box
from .clipping import clip, dot

SLACK = 1e-6
"""Distance, divided by the size of bodies, up to which faces, edges and points are equal, so that features persist."""

EDGE_NUMBERS = 2 * MAX_CORNERS
"""Largest number of edges of a clipped face: its own, and the sides that clip it."""

FACE_FEATURES = 2 * MAX_FACES * MAX_FACES * EDGE_NUMBERS * EDGE_NUMBERS
"""Number of features of faces on faces; those of edges on edges follow."""

MAX_CONTACTS = 2 * MAX_CORNERS
"""Largest number of contacts of a pair."""

_BOX_FACES = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
"""Corners of the faces of a box, numbered as in ``Box.vertices``."""


class PackedPolyhedra(NamedTuple):
    """The polyhedra among some shapes, for kernels; arrays of starts have one more entry than shapes or faces.

    Attributes:
        vertices: corners in body axes [m], shape (n_corners, 3).
        vertex_start: first corner of each shape.
        normals: outward unit normals of faces in body axes, shape (n_faces, 3).
        face_start: first face of each shape.
        loops: corners of faces, numbered within their shape.
        loop_start: first corner of each face.
        edges: two corners of each edge, numbered within their shape, shape (n_edges, 2).
        edge_start: first edge of each shape.
        directions: index in ``edges`` of one edge for each distinct edge direction of a shape.
        direction_start: first direction of each shape.
    """

    vertices: FloatArray
    vertex_start: IntArray
    normals: FloatArray
    face_start: IntArray
    loops: IntArray
    loop_start: IntArray
    edges: IntArray
    edge_start: IntArray
    directions: IntArray
    direction_start: IntArray


@lru_cache(maxsize=16)
def pack_polyhedra(shapes: tuple[object, ...]) -> PackedPolyhedra:
    """Return the polyhedra and boxes among shapes; other shapes have no faces."""
    vertices: list[list[float]] = []
    normals: list[list[float]] = []
    loops: list[int] = []
    edges: list[tuple[int, int]] = []
    directions: list[int] = []
    starts: dict[str, list[int]] = {name: [0] for name in ("vertex", "face", "edge", "direction")}
    loop_start = [0]
    for shape in shapes:
        corners, faces = _corners_and_faces(shape)
        vertices += corners.tolist()
        for face in faces:
            normals.append(_normal(corners, face))
            loops += face
            loop_start.append(len(loops))
        shape_edges = sorted({(min(pair), max(pair)) for face in faces for pair in pairwise((*face, face[0]))})
        directions += [len(edges) + number for number in _distinct_directions(corners, shape_edges)]
        edges += shape_edges
        for name, items in (("vertex", vertices), ("face", normals), ("edge", edges), ("direction", directions)):
            starts[name].append(len(items))
    start = {name: np.array(indices, dtype=np.int64) for name, indices in starts.items()}
    return PackedPolyhedra(
        np.array(vertices, dtype=np.float64).reshape(-1, 3),
        start["vertex"],
        np.array(normals, dtype=np.float64).reshape(-1, 3),
        start["face"],
        np.array(loops, dtype=np.int64),
        np.array(loop_start, dtype=np.int64),
        np.array(edges, dtype=np.int64).reshape(-1, 2),
        start["edge"],
        np.array(directions, dtype=np.int64),
        start["direction"],
    )


def _corners_and_faces(shape: object) -> tuple[FloatArray, Sequence[tuple[int, ...]]]:
    """Return the corners [m], shape (n, 3), and the faces of a polyhedron or a box; none for other shapes."""
    if isinstance(shape, Polyhedron):
        return shape.vertices, shape.faces
    return (shape.vertices, _BOX_FACES) if isinstance(shape, Box) else (np.zeros((0, 3)), ())


def _normal(corners: FloatArray, face: Sequence[int]) -> list[float]:
    """Return the outward normal of a face from the areas of its projections (Newell)."""
    points = corners[list(face)]
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    return (normal / np.linalg.norm(normal)).tolist()  # type: ignore[no-any-return]


def _distinct_directions(corners: FloatArray, edges: Sequence[tuple[int, int]]) -> list[int]:
    """Return the index of one edge of each direction."""
    distinct: list[int] = []
    units = [(corners[b] - corners[a]) / np.linalg.norm(corners[b] - corners[a]) for a, b in edges]
    for number, unit in enumerate(units):
        if all(np.linalg.norm(np.cross(unit, units[other])) > DIRECTION_TOLERANCE for other in distinct):
            distinct.append(number)
    return distinct


def find_polyhedra(
    shapes: tuple[object, ...], centres: FloatArray, rotations: FloatArray, pairs: IntArray, margin: float
) -> tuple[IntArray, FloatArray]:
    """Return contacts as (first, second, feature), shape (n, 3), and (point, normal, gap), shape (n, 7).

    Args:
        shapes: shapes of all bodies; second bodies without faces are half-spaces.
        centres: centres of the bodies [m], shape (n_bodies, 3).
        rotations: rotation matrices from body to world axes, shape (n_bodies, 3, 3).
        pairs: pairs of bodies, shape (n_pairs, 2).
        margin: gap [m] below which a contact is reported.
    """
    keys, geometry = np.empty((MAX_CONTACTS * len(pairs), 3), dtype=np.int64), np.empty((MAX_CONTACTS * len(pairs), 7))
    count = _write_contacts(pairs, centres, rotations, pack_polyhedra(shapes), margin, keys, geometry)
    return keys[:count], geometry[:count]


@njit(cache=True)
def _world_points(points, starts, shape, centre, rotation):  # type: ignore[no-untyped-def]
    """Return the points of a shape in world axes."""
    start = starts[shape]
    world_points = np.empty((starts[shape + 1] - start, 3))
    for k in range(len(world_points)):
        for axis in range(3):
            world_points[k, axis] = centre[axis]
            for m in range(3):
                world_points[k, axis] += rotation[axis, m] * points[start + k, m]
    return world_points


@njit(cache=True)
def _lowest(points, direction):  # type: ignore[no-untyped-def]
    """Return the smallest component of points along a direction."""
    lowest = np.inf
    for k in range(len(points)):
        lowest = min(lowest, dot(points[k], direction))
    return lowest


@njit(cache=True)
def _write_contacts(pairs, centres, rotations, polyhedra, margin, keys, geometry):  # type: ignore[no-untyped-def]
    """Write the contacts of all pairs; return their number."""
    count, origin = 0, np.zeros(3)
    for k in range(len(pairs)):
        i, j = pairs[k]
        begin = count
        corners_i = _world_points(polyhedra.vertices, polyhedra.vertex_start, i, centres[i], rotations[i])
        if polyhedra.face_start[j] == polyhedra.face_start[j + 1]:
            count = _write_plane_contacts(corners_i, centres[j], rotations[j], margin, keys, geometry, count)
        else:
            corners_j = _world_points(polyhedra.vertices, polyhedra.vertex_start, j, centres[j], rotations[j])
            normals_i = _world_points(polyhedra.normals, polyhedra.face_start, i, origin, rotations[i])
            normals_j = _world_points(polyhedra.normals, polyhedra.face_start, j, origin, rotations[j])
            bodies = corners_i, normals_i, corners_j, normals_j
            count = _write_polyhedron_contacts(
                polyhedra, i, j, *bodies, centres[j] - centres[i], margin, keys, geometry, count
            )
        for c in range(begin, count):
            keys[c, 0], keys[c, 1] = i, j
    return count


@njit(cache=True)
def _write(keys, geometry, count, feature, point, normal, gap):  # type: ignore[no-untyped-def]
    keys[count, 2] = feature
    for axis in range(3):
        geometry[count, axis] = point[axis]
        geometry[count, 3 + axis] = normal[axis]
    geometry[count, 6] = gap
    return count + 1


@njit(cache=True)
def _write_plane_contacts(corners, centre, rotation, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    normal = np.ascontiguousarray(rotation[:, 2])
    for k in range(len(corners)):
        gap = dot(corners[k] - centre, normal)
        if gap < margin:
            count = _write(keys, geometry, count, k, corners[k] - 0.5 * gap * normal, normal, gap)
    return count


@njit(cache=True)
def _write_polyhedron_contacts(  # type: ignore[no-untyped-def]
    polyhedra, i, j, corners_i, normals_i, corners_j, normals_j, offset, margin, keys, geometry, count
):
    """Write the contacts of two polyhedra; at equal separation, faces precede edges, and body ``i`` precedes ``j``."""
    size = np.sqrt(dot(offset, offset))
    best, best_face, first_face_i, first_face_j = -np.inf, -1, polyhedra.face_start[i], polyhedra.face_start[j]
    n_i, n_j = len(normals_i), len(normals_j)
    for face in range(n_i + n_j):
        if face < n_i:
            corner = corners_i[polyhedra.loops[polyhedra.loop_start[first_face_i + face]]]
            distance = _lowest(corners_j, normals_i[face]) - dot(corner, normals_i[face])
        else:
            corner = corners_j[polyhedra.loops[polyhedra.loop_start[first_face_j + face - n_i]]]
            distance = _lowest(corners_i, normals_j[face - n_i]) - dot(corner, normals_j[face - n_i])
        if distance >= margin:
            return count
        if best_face < 0 or distance > best + SLACK * size:
            best, best_face = distance, face
    edge, best_axis = -1, np.zeros(3)
    for a in range(polyhedra.direction_start[i], polyhedra.direction_start[i + 1]):
        along_i = _along(polyhedra, i, corners_i, polyhedra.directions[a])
        for b in range(polyhedra.direction_start[j], polyhedra.direction_start[j + 1]):
            axis = np.cross(along_i, _along(polyhedra, j, corners_j, polyhedra.directions[b]))
            length = np.sqrt(dot(axis, axis))
            if length < SLACK:
                continue
            axis /= length if dot(axis, offset) >= 0.0 else -length
            distance = _lowest(corners_j, axis) + _lowest(corners_i, -axis)
            if distance >= margin:
                return count
            if distance > best + SLACK * size:
                best, edge = distance, polyhedra.directions[a]
                copy_entries(axis, best_axis)
    if edge >= 0:
        return _write_edge_contact(polyhedra, i, j, corners_i, corners_j, best_axis, best, keys, geometry, count)
    first, second = (corners_i, normals_i), (corners_j, normals_j)
    if best_face < n_i:
        return _write_face_contacts(polyhedra, i, j, *first, *second, best_face, -1.0, margin, keys, geometry, count)
    return _write_face_contacts(polyhedra, j, i, *second, *first, best_face - n_i, 1.0, margin, keys, geometry, count)


@njit(cache=True)
def _along(polyhedra, body, corners, edge):  # type: ignore[no-untyped-def]
    """Return the unit vector along an edge."""
    along = corners[polyhedra.edges[edge, 1]] - corners[polyhedra.edges[edge, 0]]
    return along / np.sqrt(dot(along, along))


@njit(cache=True)
def _write_face_contacts(  # type: ignore[no-untyped-def]
    polyhedra, r, o, corners_r, normals_r, corners_o, normals_o, face, sign, margin, keys, geometry, count
):
    """Write the contacts of a face of body ``r`` with the opposing face of body ``o``, clipped by its sides."""
    normal, facing, least_cosine = normals_r[face], 0, np.inf
    for k in range(len(normals_o)):
        cosine = dot(normal, normals_o[k])
        if cosine < least_cosine - SLACK:
            facing, least_cosine = k, cosine
    begin, end = (
        polyhedra.loop_start[polyhedra.face_start[o] + facing],
        polyhedra.loop_start[polyhedra.face_start[o] + facing + 1],
    )
    (polygon, clipped), n = np.empty((2, MAX_CONTACTS, 3)), end - begin
    edges, clipped_edges = np.empty((2, MAX_CONTACTS), dtype=np.int64)
    for k in range(n):
        polygon[k], edges[k] = corners_o[polyhedra.loops[begin + k]], k
    begin, end = (
        polyhedra.loop_start[polyhedra.face_start[r] + face],
        polyhedra.loop_start[polyhedra.face_start[r] + face + 1],
    )
    base = corners_r[polyhedra.loops[begin]]
    for k in range(end - begin):
        here = corners_r[polyhedra.loops[begin + k]]
        there = corners_r[polyhedra.loops[begin + (k + 1) % (end - begin)]]
        across = np.cross(there - here, normal)
        length = np.sqrt(dot(across, across))
        across /= length
        limit, slack = dot(across, here), SLACK * length
        n = clip(polygon, edges, n, across, limit, slack, MAX_CORNERS + k, clipped, clipped_edges)
        polygon, edges, clipped, clipped_edges = clipped, clipped_edges, polygon, edges
    number = (face * MAX_FACES + facing) * 2 + (1 if sign > 0.0 else 0)
    for k in range(n):
        gap = dot(polygon[k] - base, normal)
        if gap < margin:
            feature = (number * EDGE_NUMBERS + edges[k - 1 if k else n - 1]) * EDGE_NUMBERS + edges[k]
            count = _write(keys, geometry, count, feature, polygon[k] - 0.5 * gap * normal, sign * normal, gap)
    return count


@njit(cache=True)
def _write_edge_contact(polyhedra, i, j, corners_i, corners_j, axis, gap, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contact of the edge of ``i`` farthest along ``axis`` with the edge of ``j`` farthest against it."""
    a = _outermost(polyhedra, i, corners_i, axis)
    b = _outermost(polyhedra, j, corners_j, -axis)
    on_i, on_j = corners_i[polyhedra.edges[a, 0]], corners_j[polyhedra.edges[b, 0]]
    along_i, along_j, between = _along(polyhedra, i, corners_i, a), _along(polyhedra, j, corners_j, b), on_j - on_i
    cosine, toward_i, toward_j = dot(along_i, along_j), dot(between, along_i), dot(between, along_j)
    squared_sine = max(1.0 - cosine * cosine, SLACK * SLACK)
    shift_i, shift_j = (toward_i - cosine * toward_j) / squared_sine, (cosine * toward_i - toward_j) / squared_sine
    middle = 0.5 * (on_i + shift_i * along_i + on_j + shift_j * along_j)
    n_edges = polyhedra.edge_start[j + 1] - polyhedra.edge_start[j]
    feature = FACE_FEATURES + (a - polyhedra.edge_start[i]) * n_edges + (b - polyhedra.edge_start[j])
    return _write(keys, geometry, count, feature, middle, -axis, gap)


@njit(cache=True)
def _outermost(polyhedra, body, corners, axis):  # type: ignore[no-untyped-def]
    """Return the edge whose two ends reach farthest along an axis."""
    best, farthest = polyhedra.edge_start[body], -np.inf
    for edge in range(polyhedra.edge_start[body], polyhedra.edge_start[body + 1]):
        reach = dot(corners[polyhedra.edges[edge, 0]], axis) + dot(corners[polyhedra.edges[edge, 1]], axis)
        if reach > farthest:
            best, farthest = edge, reach
    return best
