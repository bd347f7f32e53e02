"""Overlaps of balls with balls and surfaces, in one list that is ordered by key."""

from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numba import njit, uint64

from ...arrays import FloatArray, IntArray
from ...compilation.kernel_arrays import copy_entries
from .surfaces import SurfaceContacts

ROUNDING = 1e-9
"""Bound of the rounding errors of a distance, relative to the sum of two radii."""


class DetectedContacts(NamedTuple):
    """Overlaps of balls with balls and surfaces, ordered by key.

    Attributes:
        keys: identity of each contact, shape (n_contacts,); in keys, surfaces are numbered after the balls.
        chunks: first and second ball of each contact, or the number of balls for a surface, shape (2 · n_contacts,).
        gap: g [m], negative, shape (n_contacts,).
        normals: from the second ball or the surface to the first ball, shape (n_contacts, d).
    """

    keys: IntArray
    chunks: IntArray
    gap: FloatArray
    normals: FloatArray


def merge_contacts(
    near: IntArray, centres: FloatArray, radii: FloatArray, on_surfaces: list[SurfaceContacts]
) -> DetectedContacts:
    """Return the overlaps among near pairs of balls, and those of balls with each surface."""
    none = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, centres.shape[1]))
    ends = np.array([*accumulate(len(balls) for balls, _, _ in on_surfaces)], dtype=np.int64)
    ball, depth, inward = (np.concatenate(parts) for parts in zip(none, *on_surfaces, strict=True))
    return DetectedContacts(*_merge(near, centres, radii, ends, ball, depth, inward))


@njit(cache=True)
def lowest_gap(gaps):  # type: ignore[no-untyped-def]
    """Return the lowest of several gaps, or 0 if all are positive."""
    lowest = 0.0
    for k in range(len(gaps)):
        lowest = min(lowest, gaps[k])
    return lowest


@njit(cache=True)
def is_deeper(near, centres, radii, tolerated):  # type: ignore[no-untyped-def]
    """Return whether a pair overlaps by more than ``tolerated``."""
    for k in range(len(near)):
        i, j = uint64(near[k, 0]), uint64(near[k, 1])  # unsigned indices need no test for negative ones
        reach = radii[i] + radii[j]
        limit = max(reach - tolerated + ROUNDING * reach, 0.0)
        x, y, z = _difference(centres, i, j)
        squared = x * x + y * y + z * z
        if not squared < min(limit, reach) ** 2:  # usually, so that few roots are needed
            continue
        if np.sqrt(squared) - radii[i] - radii[j] < -tolerated:
            return True
    return False


@njit(cache=True, inline="always")
def _difference(centres, i, j):  # type: ignore[no-untyped-def]
    """Return x_i − x_j; its third component is 0 in the plane."""
    z = centres[i, 2] - centres[j, 2] if centres.shape[1] == 3 else 0.0
    return centres[i, 0] - centres[j, 0], centres[i, 1] - centres[j, 1], z


@njit(cache=True)
def _merge(near, centres, radii, ends, ball, depth, inward):  # type: ignore[no-untyped-def]
    """Return keys, chunks, gaps and normals of all overlaps, ordered by first ball, then second ball or surface.

    ``near`` holds pairs of balls in this order. The overlaps of each surface end at ``ends`` and are sorted by ball.
    The normal of concentric balls is undefined and is set to the x axis.
    """
    n, dim = centres.shape
    overlapping, n_pairs = _find_overlaps(near, centres, radii)
    n_bodies, capacity = n + len(ends), n_pairs + len(ball)
    keys, chunks = np.empty(capacity, dtype=np.int64), np.empty((capacity, 2), dtype=np.int64)
    gaps, normals = np.empty(capacity), np.zeros((capacity, dim))
    heads = np.zeros(len(ends), dtype=np.int64)
    copy_entries(ends[:-1], heads[1:])
    count, surface_ball = uint64(0), _next_ball(heads, ends, ball, n)
    for pair in range(n_pairs + 1):
        k = uint64(overlapping[pair]) if pair < n_pairs else uint64(0)
        i = near[k, 0] if pair < n_pairs else n
        while surface_ball < i:
            for surface in range(len(ends)):
                index = heads[surface]
                if index < ends[surface] and ball[index] == surface_ball:
                    keys[count], gaps[count] = surface_ball * n_bodies + n + surface, depth[index]
                    chunks[count, 0], chunks[count, 1] = surface_ball, n
                    normals[count] = inward[index]
                    heads[surface], count = index + 1, count + uint64(1)
            surface_ball = _next_ball(heads, ends, ball, n)
        if i == n:
            break
        first, second = uint64(i), uint64(near[k, 1])
        x, y, z = _difference(centres, first, second)
        distance = np.sqrt(x * x + y * y + z * z)
        keys[count], gaps[count] = i * n_bodies + near[k, 1], distance - radii[first] - radii[second]
        chunks[count, 0], chunks[count, 1] = i, near[k, 1]
        if distance > 0.0:
            normals[count, 0], normals[count, 1] = x / distance, y / distance
            if dim == 3:
                normals[count, 2] = z / distance
        else:
            normals[count, 0] = 1.0
        count += uint64(1)
    return keys, chunks.reshape(-1), gaps, normals


@njit(cache=True)
def _find_overlaps(near, centres, radii):  # type: ignore[no-untyped-def]
    """Return the indices of the pairs that overlap, in an array that may be longer, and their number.

    Each index is written, and the next one replaces it unless its pair overlaps: a branch would often be mispredicted.
    """
    overlapping, count = np.empty(len(near), dtype=np.int64), uint64(0)
    for k in range(uint64(len(near))):
        i, j = uint64(near[k, 0]), uint64(near[k, 1])
        reach = radii[i] + radii[j]
        x, y, z = _difference(centres, i, j)
        overlapping[count] = k
        count += uint64(x * x + y * y + z * z < reach * reach)
    return overlapping, np.int64(count)


@njit(cache=True)
def _next_ball(heads, ends, ball, n):  # type: ignore[no-untyped-def]
    """Return the first ball among the next overlaps of all surfaces, n if there are none."""
    first = n
    for surface in range(len(ends)):
        if heads[surface] < ends[surface]:
            first = min(first, ball[heads[surface]])
    return first
