"""Clipping of polygons by planes, for contacts of faces."""

from numba import njit


@njit(cache=True)
def dot(a, b):  # type: ignore[no-untyped-def]
    """Return a · b for two vectors, with rounding that does not depend on a linear algebra library."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def clip(polygon, edges, n, across, limit, slack, number, left, left_edges):  # type: ignore[no-untyped-def]
    """Write the part of a polygon below a plane, and the number of the edge that leaves each of its corners.

    If an edge leaves the slack from a corner between the plane and the slack, it is cut at that corner.

    Args:
        polygon: corners; only the first ``n`` are used.
        edges: number of the edge that leaves each corner.
        n: number of corners.
        across: normal of the plane.
        limit: its distance from the origin along the normal.
        slack: distance above the plane up to which a corner stays.
        number: number of the new edge.
        left: filled with the corners of the part; must have room for one more than ``n``.
        left_edges: filled with the numbers of their edges.

    Returns:
        Number of corners of the part.
    """
    m = 0
    for k in range(n):
        here, there = polygon[k], polygon[(k + 1) % n]
        height, next_height = dot(across, here) - limit, dot(across, there) - limit
        if height <= slack:
            left_edges[m] = edges[k]
            for axis in range(3):
                left[m, axis] = here[axis]
            m += 1
        if (height <= slack) != (next_height <= slack):
            fraction = min(max(height / (height - next_height), 0.0), 1.0)
            for axis in range(3):
                left[m, axis] = here[axis] + fraction * (there[axis] - here[axis])
            left_edges[m] = number if height <= slack else edges[k]
            m += 1
    return m
