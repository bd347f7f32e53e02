"""Contacts of spheres and capsules with half-spaces, with each other, and with polyhedra, boxes among them.

Spheres and capsules are the points within a radius of a segment; the segment of a sphere has length 0. In each contact,
a part of one body (an end of a segment, an edge or a corner) touches the other body. Its number is the feature of the
contact, which therefore persists from step to step:

    0, 1                     ends of the segment of the sphere or capsule, or of the first of two
    2, 3                     ends of the segment of the second of two spheres or capsules
    CROSSING                 points between the ends of two segments
    2 + k                    edge k of a polyhedron, then its corners
    2 + n_edges + n_corners  where a segment enters the polyhedron; the next number, where it leaves

The distance between two bodies is at most that of their parts, so each reported gap is an upper bound.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray
from ...compilation.kernel_arrays import copy_entries
from .clipping import dot
from .polyhedra import MAX_CONTACTS, PackedPolyhedra

PLANE, POLYHEDRON, SEGMENT, CYLINDER = range(4)
"""Kinds of shapes."""

PARALLEL = 1e-6
"""Sine of the angle below which two lines count as parallel and contacts are at their ends."""

DISTANCE_TOLERANCE = 1e-9
"""Difference below which distances count as equal, relative to the size of a body."""

CROSSING = 4
"""Feature of two capsules that touch between their ends."""


class RoundShapes(NamedTuple):
    """The dimensions of all shapes as arrays, for kernels.

    Attributes:
        kind: PLANE, POLYHEDRON, SEGMENT or CYLINDER, shape (n,).
        half_length: half the length along z [m], 0 for spheres, shape (n,).
        radius: r [m], shape (n,).
    """

    kind: IntArray
    half_length: FloatArray
    radius: FloatArray


def find_round(
    shapes: RoundShapes,
    polyhedra: PackedPolyhedra,
    centres: FloatArray,
    rotations: FloatArray,
    pairs: IntArray,
    *,
    margin: float,
) -> tuple[IntArray, FloatArray]:
    """Return contacts as (first, second, feature), shape (n, 3), and (point, normal, gap), shape (n, 7).

    Args:
        shapes: shapes of all bodies; one of each pair is a sphere or a capsule, and none is a cylinder.
        polyhedra: the polyhedra among the shapes.
        centres: centres of the bodies [m], shape (n_bodies, 3).
        rotations: rotation matrices from body to world axes, shape (n_bodies, 3, 3).
        pairs: pairs of bodies, shape (n_pairs, 2).
        margin: gap [m] below which a contact is reported.
    """
    capacity = MAX_CONTACTS * max(len(pairs), 1)
    while True:
        keys, geometry = np.empty((capacity, 3), dtype=np.int64), np.empty((capacity, 7))
        count = _find(shapes, polyhedra, centres, rotations, pairs, margin, keys, geometry)
        if count <= capacity:
            return keys[:count], geometry[:count]
        capacity = count


@njit(cache=True)
def write_contact(keys, geometry, count, feature, surface, normal, sign, gap):  # type: ignore[no-untyped-def]
    """Write a contact if the arrays have room for it; return the number of contacts, this one included.

    Args:
        keys: (first, second, feature) of contacts, filled here with the feature.
        geometry: (point, normal, gap) of contacts.
        count: number of contacts so far.
        feature: part of the pair that touches.
        surface: point on the surface of the body from which ``normal`` points outwards.
        normal: unit vector to the other body.
        sign: 1 if ``normal`` points from the second body of the pair to the first, else −1.
        gap: distance [m].
    """
    if count < len(keys):
        keys[count, 2] = feature
        for axis in range(3):
            geometry[count, axis] = surface[axis] + 0.5 * gap * normal[axis]
            geometry[count, 3 + axis] = sign * normal[axis]
        geometry[count, 6] = gap
    return count + 1


@njit(cache=True)
def ends_of(centre, rotation, half_length):  # type: ignore[no-untyped-def]
    """Return the ends of the segment along z, shape (2, 3)."""
    ends = np.empty((2, 3))
    for axis in range(3):
        ends[0, axis] = centre[axis] - half_length * rotation[axis, 2]
        ends[1, axis] = centre[axis] + half_length * rotation[axis, 2]
    return ends


@njit(cache=True)
def _find(shapes, polyhedra, centres, rotations, pairs, margin, keys, geometry):  # type: ignore[no-untyped-def]
    count: Any = np.int64(0)  # with a literal, numba would compile the called functions twice
    for k in range(len(pairs)):
        i, j = pairs[k]
        begin = count
        sign = 1.0
        if shapes.kind[i] != SEGMENT:
            i, j, sign = j, i, -1.0  # from here on, j is the second body
        ends, radius, half_length = (
            ends_of(centres[i], rotations[i], shapes.half_length[i]),
            shapes.radius[i],
            shapes.half_length[i],
        )
        if shapes.kind[j] == PLANE:
            normal = np.ascontiguousarray(rotations[j][:, 2])
            for end in range(2 if half_length > 0.0 else 1):
                height = dot(ends[end] - centres[j], normal)
                if height - radius < margin:
                    foot = ends[end] - height * normal
                    count = write_contact(keys, geometry, count, end, foot, normal, sign, height - radius)
        elif shapes.kind[j] == SEGMENT:
            other_ends = ends_of(centres[j], rotations[j], shapes.half_length[j])
            bodies = ends, half_length, radius, other_ends, shapes.half_length[j], shapes.radius[j]
            count = _write_segment_contacts(*bodies, margin, keys, geometry, count)
        else:
            for end in range(2):
                ends[end] = np.dot(rotations[j].T, ends[end] - centres[j])
            count = _write_polyhedron_contacts(
                polyhedra, j, ends, half_length, radius, sign, margin, keys, geometry, count
            )
            for c in range(begin, min(count, len(keys))):  # from the axes of the polyhedron to those of the world
                geometry[c, :3] = np.dot(rotations[j], geometry[c, :3]) + centres[j]
                geometry[c, 3:6] = np.dot(rotations[j], geometry[c, 3:6])
        for c in range(begin, min(count, len(keys))):
            keys[c, 0], keys[c, 1] = pairs[k]
    return count


@njit(cache=True)
def nearest_on_segment(point, begin, end):  # type: ignore[no-untyped-def]
    """Return the fraction of a segment at which it is nearest to a point, from 0 to 1."""
    along = end - begin
    squared = dot(along, along)
    return min(1.0, max(0.0, dot(point - begin, along) / squared)) if squared > 0.0 else 0.0


@njit(cache=True)
def nearest_inside(p, p_end, q, q_end):  # type: ignore[no-untyped-def]
    """Return the fractions at which two segments are nearest if these points lie between the ends, else (−1, −1)."""
    d, e, between = p_end - p, q_end - q, p - q
    a, b, c = dot(d, d), dot(d, e), dot(e, e)
    determinant = a * c - b * b
    if determinant <= PARALLEL * PARALLEL * a * c:
        return -1.0, -1.0
    s = (b * dot(e, between) - c * dot(d, between)) / determinant
    t = (a * dot(e, between) - b * dot(d, between)) / determinant
    if 0.0 < s < 1.0 and 0.0 < t < 1.0:
        return s, t
    return -1.0, -1.0


@njit(cache=True)
def is_between(fraction, half_length):  # type: ignore[no-untyped-def]
    """Return whether a fraction of a segment, which may have no length, lies between its ends."""
    return half_length > 0.0 and fraction > 0.0 and fraction < 1.0


@njit(cache=True)
def _write_ball_contact(keys, geometry, count, feature, x, r_x, y, r_y, fallback, margin):  # type: ignore[no-untyped-def]
    """Write the contact of balls with centres x (first body) and y if they are close; use ``fallback`` if x = y."""
    normal = x - y
    distance = np.sqrt(dot(normal, normal))
    if distance - r_x - r_y >= margin:
        return count
    if distance > 0.0:
        normal /= distance
    else:
        copy_entries(fallback, normal)
    return write_contact(keys, geometry, count, feature, y + r_y * normal, normal, 1.0, distance - r_x - r_y)


@njit(cache=True)
def _write_segment_contacts(p, half_p, r_p, q, half_q, r_q, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contacts of two segments with radii: of each end with the other segment, and between the ends.

    Two ends are in contact if each end is the point of its segment nearest to the other end.
    """
    fallback = np.cross(p[1] - p[0], q[1] - q[0])
    length = np.sqrt(dot(fallback, fallback))
    if length > PARALLEL * half_p * half_q:
        fallback /= length
    else:
        fallback[0], fallback[1], fallback[2] = 1.0, 0.0, 0.0
    for end in range(2 if half_p > 0.0 else 1):
        t = nearest_on_segment(p[end], q[0], q[1])
        other = q[0] + t * (q[1] - q[0])
        if is_between(t, half_q) or nearest_on_segment(other, p[0], p[1]) == end:
            count = _write_ball_contact(keys, geometry, count, end, p[end], r_p, other, r_q, fallback, margin)
    for end in range(2 if half_q > 0.0 else 1):
        s = nearest_on_segment(q[end], p[0], p[1])
        if is_between(s, half_p):
            other = p[0] + s * (p[1] - p[0])
            count = _write_ball_contact(keys, geometry, count, 2 + end, other, r_p, q[end], r_q, fallback, margin)
    if half_p == 0.0:
        return count
    if half_q > 0.0:
        s, t = nearest_inside(p[0], p[1], q[0], q[1])
        if s >= 0.0:
            x, y = p[0] + s * (p[1] - p[0]), q[0] + t * (q[1] - q[0])
            count = _write_ball_contact(keys, geometry, count, CROSSING, x, r_p, y, r_q, fallback, margin)
    return count


@njit(cache=True)
def nearest_on_polyhedron(polyhedra, body, point, foot, normal):  # type: ignore[no-untyped-def]
    """Return the distance between a point and a polyhedron [m], negative inside.

    Args:
        polyhedra: polyhedra.
        body: index of the polyhedron.
        point: point in body axes [m], shape (3,).
        foot: filled with the nearest point of the surface [m], shape (3,).
        normal: filled with the outward unit normal, shape (3,).
    """
    highest, best, squared = -np.inf, 0, np.inf
    for face in range(polyhedra.face_start[body], polyhedra.face_start[body + 1]):
        height = _height(polyhedra, body, face, point)
        if height > highest:
            highest, best = height, face
        if height > 0.0:
            nearest = _nearest_on_face(polyhedra, body, face, point, height)
            offset = point - nearest
            if dot(offset, offset) < squared:
                squared = dot(offset, offset)
                copy_entries(nearest, foot)
    face_normal = polyhedra.normals[best]
    if highest <= 0.0:
        copy_entries(point - highest * face_normal, foot)
        copy_entries(face_normal, normal)
        return highest
    distance = np.sqrt(squared)
    # above the interior of a face, the distance is the height, and the normal is exact at any height
    copy_entries(face_normal if distance <= highest * (1.0 + 1e-15) else (point - foot) / distance, normal)
    return distance


@njit(cache=True)
def _height(polyhedra, body, face, point):  # type: ignore[no-untyped-def]
    """Return the height of a point above the plane of a face [m]."""
    corner = polyhedra.vertices[polyhedra.vertex_start[body] + polyhedra.loops[polyhedra.loop_start[face]]]
    return dot(point - corner, polyhedra.normals[face])


@njit(cache=True)
def _nearest_on_face(polyhedra, body, face, point, height):  # type: ignore[no-untyped-def]
    """Return the point of a face that is nearest to a point at ``height`` above the plane of the face."""
    normal, begin, end = polyhedra.normals[face], polyhedra.loop_start[face], polyhedra.loop_start[face + 1]
    nearest, squared, is_above = point - height * normal, np.inf, True
    foot = nearest.copy()
    for k in range(begin, end):
        here = polyhedra.vertices[polyhedra.vertex_start[body] + polyhedra.loops[k]]
        there = polyhedra.vertices[polyhedra.vertex_start[body] + polyhedra.loops[k + 1 if k + 1 < end else begin]]
        if dot(np.cross(there - here, foot - here), normal) >= 0.0:
            continue
        is_above = False
        edge_point = here + nearest_on_segment(foot, here, there) * (there - here)
        offset = foot - edge_point
        if dot(offset, offset) < squared:
            squared = dot(offset, offset)
            nearest = edge_point
    return foot if is_above else nearest


@njit(cache=True)
def _write_polyhedron_contacts(polyhedra, body, ends, half_length, radius, sign, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contacts of a segment with a radius on a polyhedron, all in the axes of the polyhedron."""
    corners, edges = polyhedra.vertex_start[body], polyhedra.edge_start[body]
    n_corners, n_edges = polyhedra.vertex_start[body + 1] - corners, polyhedra.edge_start[body + 1] - edges
    begin, finish, exit_face = _part_inside(polyhedra, body, ends)
    if half_length > 0.0 and begin < finish:
        normal = polyhedra.normals[exit_face]
        for end in range(2):
            point = ends[0] + (finish if end else begin) * (ends[1] - ends[0])
            height = _height(polyhedra, body, exit_face, point)
            feature = 2 + n_edges + n_corners + end
            count = write_contact(
                keys, geometry, count, feature, point - height * normal, normal, sign, height - radius
            )
        return count
    foot, normal = np.empty(3), np.empty(3)
    for end in range(2 if half_length > 0.0 else 1):
        distance = nearest_on_polyhedron(polyhedra, body, ends[end], foot, normal)
        if distance - radius < margin:
            count = write_contact(keys, geometry, count, end, foot, normal, sign, distance - radius)
    if half_length == 0.0:
        return count
    for k in range(n_edges + n_corners):
        if k < n_edges:
            here = polyhedra.vertices[corners + polyhedra.edges[edges + k, 0]]
            there = polyhedra.vertices[corners + polyhedra.edges[edges + k, 1]]
            s, t = nearest_inside(ends[0], ends[1], here, there)
            part_point = here + t * (there - here)
        else:
            part_point = polyhedra.vertices[corners + k - n_edges]
            s = nearest_on_segment(part_point, ends[0], ends[1])
        if not 0.0 < s < 1.0:
            continue
        point = ends[0] + s * (ends[1] - ends[0])
        offset = point - part_point
        distance = np.sqrt(dot(offset, offset))
        if distance - radius >= margin or distance == 0.0:
            continue
        nearest_distance = nearest_on_polyhedron(polyhedra, body, point, foot, normal)
        # if ``nearest_distance`` is smaller, the edge or corner faces away from the segment
        if nearest_distance >= distance - DISTANCE_TOLERANCE * (radius + half_length):
            count = write_contact(keys, geometry, count, 2 + k, part_point, offset / distance, sign, distance - radius)
    return count


@njit(cache=True)
def _part_inside(polyhedra, body, ends):  # type: ignore[no-untyped-def]
    """Return the fractions at which a segment enters and leaves a polyhedron, and the face with the shortest exit.

    If the segment is outside, the first fraction is not below the second.
    """
    begin, finish, exit_face, highest = 0.0, 1.0, 0, -np.inf
    for face in range(polyhedra.face_start[body], polyhedra.face_start[body + 1]):
        first, last = _height(polyhedra, body, face, ends[0]), _height(polyhedra, body, face, ends[1])
        if min(first, last) > highest:
            exit_face, highest = face, min(first, last)
        if first > 0.0 and last > 0.0:
            return 1.0, 0.0, face
        if first > 0.0:
            begin = max(begin, first / (first - last))
        elif last > 0.0:
            finish = min(finish, first / (first - last))
    return begin, finish, exit_face
