"""Contact patches: the loaded contacts of two bodies, joined into a polygon or a line."""

import numpy as np
import rerun as rr

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.matrices.contact_frame import contact_frames
from ..contact_states import ContactState, States

NO_PATCHES = rr.LineStrips3D([])
"""Contact patches of a step without loaded contacts."""


def patches(pairs: IntArray, points: FloatArray, normals: FloatArray, states: States) -> rr.LineStrips3D:
    """Return the patches of pairs of bodies with two or more contacts as closed lines.

    A patch sticks if one of its contacts sticks.

    Args:
        pairs: both bodies of each loaded contact, shape (n, 2) with n ≥ 1; the caller omits contacts without an
            impulse.
        points: positions of the contacts [m], shape (n, 3).
        normals: unit normals of the contacts, shape (n, 3).
        states: states of the contacts, shape (n,).
    """
    _, patch_indices = np.unique(pairs, axis=0, return_inverse=True)
    order = np.lexsort((_angles(patch_indices, points, normals), patch_indices))
    ends = np.flatnonzero(np.diff(patch_indices[order])) + 1
    strips, patch_states = [], []
    for members in np.split(order, ends):
        if len(members) > 1:
            strips.append(points[np.append(members, members[0])])
            patch_states.append(
                ContactState.STICK if (states[members] == ContactState.STICK).any() else ContactState.SLIP
            )
    return rr.LineStrips3D(strips, class_ids=patch_states)


def _angles(patch_indices: IntArray, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the angle of each contact about the centroid of its patch, in the plane of the patch, shape (n,)."""
    counts = np.bincount(patch_indices)
    centroids = np.column_stack([np.bincount(patch_indices, points[:, axis]) / counts for axis in range(3)])
    _, first_contacts = np.unique(patch_indices, return_index=True)
    frames = contact_frames(normals[first_contacts])
    arms = np.einsum("cix,cx->ci", frames[patch_indices, 1:], points - centroids[patch_indices])
    angles: FloatArray = np.arctan2(arms[:, 1], arms[:, 0])
    return angles
