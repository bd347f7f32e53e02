"""Contacts of pairs of shapes: boxes on half-spaces, and boxes on boxes by separating axes and clipped faces.

The modules ``polyhedra``, ``round_bodies`` and ``cylinders`` and the library coal find the contacts of other pairs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray
from ...errors import ProblemError
from ..bodies.rigid.orientation import rotation_matrices
from ..bodies.rigid.shapes import Shape
from .clipping import clip, dot
from .coal_contacts import find_with_coal
from .cylinders import find_cylinders
from .polyhedra import find_polyhedra
from .round_bodies import CYLINDER, PLANE, SEGMENT, find_round
from .shape_arrays import ShapeArrays, shape_arrays

MAX_FEATURES = 1 << 26
"""Largest number of features of a pair."""

FACE_FEATURES = 12 * 6 * 8 * 8
"""Number of features of a face on a face of two boxes; those of edges on edges follow."""

SLACK = 1e-6
"""Distance, divided by the size of a box, up to which faces and points count as equal, so that features persist."""

PARALLEL = 1e-6
"""Sine of the angle between two edges below which they count as parallel."""

BOXES, POLYHEDRA, ROUND, CYLINDERS, WITH_COAL, REFUSED = range(6)
"""Methods that find the contacts of a pair: this module, ``polyhedra``, ``round_bodies``, ``cylinders`` and coal.

``REFUSED`` marks a pair whose first body is a half-space, for which ``find_contacts`` raises an error."""


@dataclass(frozen=True, eq=False)
class ContactSet:
    """Contacts, sorted by first body, second body and feature.

    Attributes:
        first: first bodies, shape (n,).
        second: second bodies, shape (n,); first < second.
        feature: part of the pair that touches, constant while the contact lasts, shape (n,).
        point: halfway between the surfaces [m], shape (n, 3).
        normal: unit vectors from second to first, shape (n, 3).
        gap: distance [m], negative if the bodies penetrate, shape (n,).
    """

    first: IntArray
    second: IntArray
    feature: IntArray
    point: FloatArray
    normal: FloatArray
    gap: FloatArray


def find_contacts(shapes: Sequence[Shape], poses: FloatArray, pairs: IntArray, margin: float) -> ContactSet:
    """Return the contacts of ascending ``pairs`` with a gap below ``margin`` [m].

    Args:
        shapes: shapes of all bodies, fixed ones last.
        poses: (x [m], quaternion) of each body, shape (n_bodies, 7).
        pairs: pairs of bodies, shape (n_pairs, 2), for instance those whose bounding spheres are close.
        margin: gap below which a contact is reported [m].

    Raises:
        ProblemError: if the first body of a pair is a half-space, or a pair needs coal and it is not installed.
    """
    if not len(pairs):
        return _contact_set([])
    shapes = tuple(shapes)
    arrays = shape_arrays(shapes)
    methods, counts = _methods(pairs, arrays.round_shapes.kind, arrays.is_box, arrays.is_ball)
    if counts[REFUSED]:
        raise ProblemError("a half-space cannot move: list it among the fixed bodies.")
    centres, rotations = np.ascontiguousarray(poses[:, :3]), rotation_matrices(poses[:, 3:])
    round_shapes, contact_parts = arrays.round_shapes, []
    for method in np.flatnonzero(counts):
        method_pairs = pairs if counts[method] == len(pairs) else pairs[methods == method]
        if method == BOXES:
            contacts = _find_boxes(arrays, centres, rotations, method_pairs, margin)
        elif method == POLYHEDRA:
            contacts = find_polyhedra(shapes, centres, rotations, method_pairs, margin)
        elif method == ROUND:
            contacts = find_round(round_shapes, arrays.polyhedra, centres, rotations, method_pairs, margin=margin)
        elif method == CYLINDERS:
            contacts = find_cylinders(round_shapes, centres, rotations, method_pairs, margin)
        else:
            contacts = find_with_coal(shapes, centres, rotations, method_pairs, margin)
        contact_parts.append(contacts)
    return _contact_set(contact_parts)


@njit(cache=True)
def _methods(pairs, kind, is_box, is_ball):  # type: ignore[no-untyped-def]
    """Return the method that finds the contacts of each pair, and the number of pairs of each method."""
    methods, counts = np.empty(len(pairs), dtype=np.int64), np.zeros(REFUSED + 1, dtype=np.int64)
    for k in range(len(pairs)):
        i, j = pairs[k]
        if kind[i] == PLANE:
            method = REFUSED
        elif is_box[i] and (is_box[j] or kind[j] == PLANE):
            method = BOXES
        elif kind[i] == CYLINDER or kind[j] == CYLINDER:
            method = CYLINDERS if kind[j] == PLANE or is_ball[i] or is_ball[j] else WITH_COAL
        elif kind[i] == SEGMENT or kind[j] == SEGMENT:
            method = ROUND
        else:
            method = POLYHEDRA
        methods[k] = method
        counts[method] += 1
    return methods, counts


def _find_boxes(
    arrays: ShapeArrays, centres: FloatArray, rotations: FloatArray, pairs: IntArray, margin: float
) -> tuple[IntArray, FloatArray]:
    """Return contacts of boxes with boxes and half-spaces; see ``find_polyhedra``."""
    keys, geometry = np.empty((8 * len(pairs), 3), dtype=np.int64), np.empty((8 * len(pairs), 7))
    axes = np.ascontiguousarray(rotations.transpose(0, 2, 1))
    is_plane = arrays.round_shapes.kind == PLANE
    count = _write_box_contacts(pairs, centres, axes, arrays.half_sizes, is_plane, margin, keys, geometry)
    return keys[:count], geometry[:count]


def _contact_set(contact_parts: list[tuple[IntArray, FloatArray]]) -> ContactSet:
    """Return contacts of several kinds of pairs in the order of bodies and features."""
    if not contact_parts:
        contact_parts = [(np.zeros((0, 3), dtype=np.int64), np.zeros((0, 7)))]
    if len(contact_parts) == 1:
        keys, geometry = contact_parts[0]
        return ContactSet(*_reordered(keys, geometry, _stable_order(keys)))
    keys, geometry = (
        np.concatenate([contacts[0] for contacts in contact_parts]),
        np.concatenate([contacts[1] for contacts in contact_parts]),
    )
    return ContactSet(*_reordered(keys, geometry, np.lexsort((keys[:, 2], keys[:, 1], keys[:, 0]))))


@njit(cache=True)
def _stable_order(keys):  # type: ignore[no-untyped-def]
    """Return the stable order of keys by an insertion sort; pairs of bodies ascend, so only their few features move."""
    order = np.arange(len(keys))
    for k in range(1, len(keys)):
        a, b, c = keys[k]
        slot = k
        while slot > 0:
            p, q, r = keys[order[slot - 1]]
            if p < a or (p == a and (q < b or (q == b and r <= c))):
                break
            order[slot] = order[slot - 1]
            slot -= 1
        order[slot] = k
    return order


@njit(cache=True)
def _reordered(keys, geometry, order):  # type: ignore[no-untyped-def]
    """Return the fields of a ``ContactSet`` of contacts in the given order."""
    n = len(order)
    first, second, feature = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    point, normal, gap = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    for k in range(n):
        c = order[k]
        first[k], second[k], feature[k] = keys[c]
        for axis in range(3):
            point[k, axis], normal[k, axis] = geometry[c, axis], geometry[c, 3 + axis]
        gap[k] = geometry[c, 6]
    return first, second, feature, point, normal, gap


@njit(cache=True)
def _write_box_contacts(pairs, centres, axes, half_sizes, is_plane, margin, keys, geometry):  # type: ignore[no-untyped-def]
    """Write the contacts of all pairs; return their number.

    Most pairs are too far apart for a contact. The distance is tested first, without views of the arrays.
    """
    count = 0
    for k in range(len(pairs)):
        i, j, begin = pairs[k, 0], pairs[k, 1], count
        if is_plane[j]:
            if _is_above(i, j, centres, axes, half_sizes, margin):
                continue
            count = _write_plane_contacts(
                centres[i], axes[i], half_sizes[i], centres[j], axes[j], margin, keys, geometry, count
            )
        else:
            axis, distance = _separating_axis(i, j, centres, axes, half_sizes, margin)
            if axis < 0:
                continue
            bodies = centres[i], axes[i], half_sizes[i], centres[j], axes[j], half_sizes[j]
            count = _write_box_on_box(*bodies, axis, distance, margin, keys, geometry, count)
        for c in range(begin, count):
            keys[c, 0], keys[c, 1] = i, j
    return count


@njit(cache=True)
def _write(keys, geometry, count, feature, point, normal, sign, gap):  # type: ignore[no-untyped-def]
    """Write a contact at a point halfway between the surfaces, with the normal sign · ``normal``; return the count."""
    keys[count, 2] = feature
    for axis in range(3):
        geometry[count, axis] = point[axis]
        geometry[count, 3 + axis] = sign * normal[axis]
    geometry[count, 6] = gap
    return count + 1


@njit(cache=True)
def _write_plane_contacts(centre, axes, half, origin, plane_axes, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contacts of the corners of a box with a plane."""
    normal, corner = plane_axes[2], np.empty(3)
    for number in range(8):
        for axis in range(3):
            corner[axis] = centre[axis]
            for k in range(3):
                side = 1.0 if number >> k & 1 else -1.0
                corner[axis] += side * half[k] * axes[k, axis]
        gap = 0.0
        for axis in range(3):
            gap += (corner[axis] - origin[axis]) * normal[axis]
        if gap < margin:
            for axis in range(3):
                corner[axis] -= 0.5 * gap * normal[axis]
            count = _write(keys, geometry, count, number, corner, normal, 1.0, gap)
    return count


@njit(cache=True)
def _is_above(i, j, centres, axes, half_sizes, margin):  # type: ignore[no-untyped-def]
    """Return whether box i is certainly farther from half-space j than ``margin``."""
    height, reach = 0.0, 0.0
    for k in range(3):
        height += (centres[i, k] - centres[j, k]) * axes[j, 2, k]
        reach += half_sizes[i, k] * abs(_along(axes, i, k, axes[j, 2, 0], axes[j, 2, 1], axes[j, 2, 2]))
    return height - (1.0 + SLACK) * reach > margin


@njit(cache=True)
def _along(axes, body, k, x, y, z):  # type: ignore[no-untyped-def]
    """Return the component of (x, y, z) along an axis of a body."""
    return x * axes[body, k, 0] + y * axes[body, k, 1] + z * axes[body, k, 2]


@njit(cache=True)
def _separating_axis(i, j, centres, axes, half_sizes, margin):  # type: ignore[no-untyped-def]
    """Return the axis along which two boxes overlap least, and their distance along it, negative if they overlap.

    Axes 0 to 2 are those of box i, 3 to 5 those of box j, and 6 to 14 are perpendicular to one of each. The axis is −1
    if the boxes are apart by at least ``margin``. Of axes that are equal up to ``SLACK``, the first is returned.
    """
    slack = SLACK * (half_sizes[i].max() + half_sizes[j].max())
    dx, dy, dz = centres[j, 0] - centres[i, 0], centres[j, 1] - centres[i, 1], centres[j, 2] - centres[i, 2]
    best, best_distance = -1, -np.inf
    for number in range(15):
        if number < 6:
            body, k = (i, number) if number < 3 else (j, number - 3)
            x, y, z = axes[body, k, 0], axes[body, k, 1], axes[body, k, 2]
        else:
            k, m = (number - 6) // 3, (number - 6) % 3
            a, b, c = axes[i, k, 0], axes[i, k, 1], axes[i, k, 2]
            u, v, w = axes[j, m, 0], axes[j, m, 1], axes[j, m, 2]
            x, y, z = b * w - c * v, c * u - a * w, a * v - b * u
            length = np.sqrt(x * x + y * y + z * z)
            if length < PARALLEL:
                continue
            x, y, z = x / length, y / length, z / length
        reach_i, reach_j = 0.0, 0.0
        for k in range(3):
            reach_i += half_sizes[i, k] * abs(_along(axes, i, k, x, y, z))
            reach_j += half_sizes[j, k] * abs(_along(axes, j, k, x, y, z))
        distance = abs(dx * x + dy * y + dz * z) - reach_i - reach_j
        if distance >= margin:
            return -1, distance
        if distance > best_distance + (0.0 if best < 0 else slack):
            best, best_distance = number, distance
    return best, best_distance


@njit(cache=True)
def _write_box_on_box(c_a, r_a, h_a, c_b, r_b, h_b, axis, distance, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contacts of two boxes in the direction in which they overlap least; see ``_separating_axis``.

    A box has its centre c, its axes in the rows of r, and its half edge lengths h.
    """
    if axis < 3:
        return _write_face_contacts(c_a, r_a, h_a, c_b, r_b, h_b, axis, -1.0, margin, keys, geometry, count)
    if axis < 6:
        return _write_face_contacts(c_b, r_b, h_b, c_a, r_a, h_a, axis - 3, 1.0, margin, keys, geometry, count)
    edges = axis - 6
    return _write_edge_contact(c_a, r_a, h_a, c_b, r_b, h_b, edges // 3, edges % 3, distance, keys, geometry, count)


@njit(cache=True)
def _write_face_contacts(c_r, r_r, h_r, c_o, r_o, h_o, axis, sign, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contacts of the reference face with the opposing face of the other box, clipped by its sides."""
    outward = 1.0 if dot((c_o[0] - c_r[0], c_o[1] - c_r[1], c_o[2] - c_r[2]), r_r[axis]) >= 0.0 else -1.0
    normal = outward * r_r[axis, 0], outward * r_r[axis, 1], outward * r_r[axis, 2]
    facing, largest_cosine = 0, -1.0
    for k in range(3):
        cosine = abs(dot(normal, r_o[k]))
        if cosine > largest_cosine + SLACK:
            facing, largest_cosine = k, cosine
    side = -1.0 if dot(normal, r_o[facing]) > 0.0 else 1.0
    p, q = (facing + 1) % 3, (facing + 2) % 3
    (polygon, clipped), (edges, clipped_edges) = np.empty((2, 16, 3)), np.empty((2, 16), dtype=np.int64)
    for corner in range(4):
        s = 1.0 if corner == 1 or corner == 2 else -1.0
        t = 1.0 if corner >= 2 else -1.0
        for k in range(3):
            middle = c_o[k] + side * h_o[facing] * r_o[facing, k]
            polygon[corner, k] = middle + s * h_o[p] * r_o[p, k] + t * h_o[q] * r_o[q, k]
        edges[corner] = corner
    n = 4
    for plane in range(4):
        k = (axis + 1 + plane // 2) % 3
        turn = 1.0 if plane % 2 else -1.0
        across = turn * r_r[k, 0], turn * r_r[k, 1], turn * r_r[k, 2]
        limit, slack = dot(across, c_r) + h_r[k], SLACK * h_r[k]
        n = clip(polygon, edges, n, across, limit, slack, 4 + plane, clipped, clipped_edges)
        polygon, edges, clipped, clipped_edges = clipped, clipped_edges, polygon, edges
    reference = (6 if sign > 0.0 else 0) + 2 * axis + (1 if outward > 0.0 else 0)
    pair_of_faces = 6 * reference + 2 * facing + (1 if side > 0.0 else 0)
    for k in range(min(n, 8)):
        x, y, z = polygon[k, 0], polygon[k, 1], polygon[k, 2]
        gap = dot((x - c_r[0], y - c_r[1], z - c_r[2]), normal) - h_r[axis]
        if gap < margin:
            feature, half = 64 * pair_of_faces + 8 * edges[k - 1 if k else n - 1] + edges[k], 0.5 * gap
            point = x - half * normal[0], y - half * normal[1], z - half * normal[2]
            count = _write(keys, geometry, count, feature, point, normal, sign, gap)
    return count


@njit(cache=True)
def _write_edge_contact(c_a, r_a, h_a, c_b, r_b, h_b, a, b, gap, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contact of the edges along axes a and b that face each other."""
    normal = np.cross(r_a[a], r_b[b])
    normal /= np.sqrt(dot(normal, normal))
    if dot(c_b - c_a, normal) < 0.0:
        normal = -normal
    on_a, on_b, feature = c_a.copy(), c_b.copy(), 3 * a + b
    for k in range(3):
        s = 1.0 if dot(normal, r_a[k]) > 0.0 else -1.0
        t = -1.0 if dot(normal, r_b[k]) > 0.0 else 1.0
        if k != a:
            on_a += s * h_a[k] * r_a[k]
            feature = 2 * feature + (1 if s > 0.0 else 0)
        if k != b:
            on_b += t * h_b[k] * r_b[k]
            feature = 2 * feature + (1 if t > 0.0 else 0)
    along_a, along_b, between = r_a[a], r_b[b], on_b - on_a
    cosine, toward_a, toward_b = dot(along_a, along_b), dot(between, along_a), dot(between, along_b)
    shift_a = (toward_a - cosine * toward_b) / (1.0 - cosine * cosine)
    shift_b = (cosine * toward_a - toward_b) / (1.0 - cosine * cosine)
    middle = 0.5 * (on_a + shift_a * along_a + on_b + shift_b * along_b)
    return _write(keys, geometry, count, FACE_FEATURES + feature, middle, normal, -1.0, gap)
