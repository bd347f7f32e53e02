"""Contacts of cylinders with half-spaces and with spheres, in closed form.

On a half-space, the contact points of each end of a cylinder are the lowest point of its rim and points that are fixed
in the body. The features of an upright cylinder are therefore constant.
"""

import numpy as np
from numba import njit

from ...arrays import FloatArray, IntArray
from .clipping import dot
from .round_bodies import PLANE, SEGMENT, RoundShapes, write_contact

RIM_POINTS = 8
"""Number of points of each rim that are fixed in the body."""

UPRIGHT = 1e-6
"""Sine of the angle between an end and a plane below which the end has no lowest point."""


def find_cylinders(
    shapes: RoundShapes, centres: FloatArray, rotations: FloatArray, pairs: IntArray, margin: float
) -> tuple[IntArray, FloatArray]:
    """Return contacts as (first, second, feature), shape (n, 3), and (point, normal, gap), shape (n, 7).

    Args:
        shapes: shapes of all bodies; each pair has a cylinder, and a half-space or a sphere.
        centres: centres of the bodies [m], shape (n_bodies, 3).
        rotations: rotation matrices from body to world axes, shape (n_bodies, 3, 3).
        pairs: pairs of bodies, shape (n_pairs, 2).
        margin: gap [m] below which a contact is reported.
    """
    capacity = 2 * (RIM_POINTS + 1) * len(pairs)
    keys, geometry = np.empty((capacity, 3), dtype=np.int64), np.empty((capacity, 7))
    count = _find(shapes, centres, rotations, pairs, margin, keys, geometry)
    return keys[:count], geometry[:count]


@njit(cache=True)
def _find(shapes, centres, rotations, pairs, margin, keys, geometry):  # type: ignore[no-untyped-def]
    count = 0
    for k in range(len(pairs)):
        i, j = pairs[k]
        begin = count
        if shapes.kind[j] == PLANE:
            body = centres[i], rotations[i], shapes.half_length[i], shapes.radius[i]
            normal = np.ascontiguousarray(rotations[j][:, 2])
            count = _write_plane_contacts(*body, centres[j], normal, margin, keys, geometry, count)
        elif shapes.kind[i] == SEGMENT:
            body = centres[j], rotations[j], shapes.half_length[j], shapes.radius[j]
            count = _write_ball_contact(*body, centres[i], shapes.radius[i], 1.0, margin, keys, geometry, count)
        else:
            body = centres[i], rotations[i], shapes.half_length[i], shapes.radius[i]
            count = _write_ball_contact(*body, centres[j], shapes.radius[j], -1.0, margin, keys, geometry, count)
        for c in range(begin, count):
            keys[c, 0], keys[c, 1] = i, j
    return count


@njit(cache=True)
def _write_plane_contacts(centre, rotation, half_length, radius, origin, normal, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contacts of a cylinder with a plane through ``origin``; return the number of contacts."""
    axis = np.ascontiguousarray(rotation[:, 2])
    steepness = dot(axis, normal)
    down = steepness * axis - normal  # the downward direction within the ends
    sine = np.sqrt(dot(down, down))
    for end in range(2):
        middle = centre + (half_length if end else -half_length) * axis
        for number in range(RIM_POINTS + 1):
            if number < RIM_POINTS:
                angle = 2.0 * np.pi * number / RIM_POINTS
                point = middle + radius * (np.cos(angle) * rotation[:, 0] + np.sin(angle) * rotation[:, 1])
            elif sine > UPRIGHT:
                point = middle + radius / sine * down
            else:
                continue
            gap = dot(point - origin, normal)
            if gap < margin:
                feature = end * (RIM_POINTS + 1) + number
                count = write_contact(keys, geometry, count, feature, point - gap * normal, normal, 1.0, gap)
    return count


@njit(cache=True)
def _write_ball_contact(centre, rotation, half_length, radius, ball, ball_radius, sign, margin, keys, geometry, count):  # type: ignore[no-untyped-def]
    """Write the contact of a cylinder with a ball if it is close; return the number of contacts."""
    axis = np.ascontiguousarray(rotation[:, 2])
    offset = ball - centre
    along = dot(offset, axis)
    across = offset - along * axis
    distance = np.sqrt(dot(across, across))
    outward = across / distance if distance > 0.0 else np.ascontiguousarray(rotation[:, 0])
    side = 1.0 if along >= 0.0 else -1.0
    beyond_end, beyond_side = abs(along) - half_length, distance - radius
    if beyond_end > 0.0 and beyond_side > 0.0:
        foot = centre + side * half_length * axis + radius * outward
        normal = side * beyond_end * axis + beyond_side * outward
        height = np.sqrt(dot(normal, normal))
        normal /= height
    elif beyond_end > beyond_side:
        height, normal = beyond_end, side * axis
        foot = ball - height * normal
    else:
        height, normal = beyond_side, outward
        foot = ball - height * normal
    if height - ball_radius < margin:
        count = write_contact(keys, geometry, count, 0, foot, normal, sign, height - ball_radius)
    return count
