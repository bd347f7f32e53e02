"""Force directions W of contacts between rigid bodies, written directly into pieces."""

import numpy as np
from numba import njit

from ....arrays import FloatArray
from ....contact.matrices.contact_frame import write_frame
from ....contact.matrices.pieces import Pieces
from ...detection.narrow_phase import ContactSet
from .orientation import rotation_matrices

ROLLING_LANES = tuple(np.array(axes, dtype=np.int64) for axes in ((), (0,), (1, 2), (1, 2, 0)))
"""Indices in (N, T1, T2) of the axes of 0, 1, 2 and 3 rows of rolling friction: none, spinning, rolling, both."""


def force_directions(contacts: ContactSet, poses: FloatArray, n_linear: int, n_rolling: int) -> Pieces:
    """Return W of contacts, with rows of the velocity of each contact point, then rows of its angular velocity.

    γ_d = d·(v_i + ω_i × r_i − v_j − ω_j × r_j) for d = N, T1, T2, and ω_d = d·(ω_i − ω_j). N points from j to i,
    and r_i from the centre of body i to the contact point.

    Args:
        contacts: the contacts; bodies with an index of ``len(poses)`` or more are fixed.
        poses: (x, quaternion) of each moving body, shape (n, 7).
        n_linear: rows of velocity, 1 or 3.
        n_rolling: rows of angular velocity, 0 to 3; see ``ROLLING_LANES``.

    Returns:
        Pieces with one block per contact and one chunk of 6 velocities (v, ω) per moving body.
    """
    rolling_lanes = ROLLING_LANES[n_rolling]
    pairs = (contacts.first, contacts.second, contacts.point, contacts.normal)
    bodies = (np.ascontiguousarray(poses[:, :3]), rotation_matrices(poses[:, 3:]))
    starts, chunks, values = _force_directions(*pairs, *bodies, n_linear, rolling_lanes)
    return Pieces(starts, chunks, values, len(poses))


@njit(cache=True)
def _force_directions(first, second, points, normals, centres, rotations, n_linear, rolling_lanes):  # type: ignore[no-untyped-def]
    """Return starts, chunks and values of W, two pieces per contact; those of fixed bodies are 0, on the idle chunk."""
    n_contacts, n_bodies, width = len(first), len(centres), n_linear + len(rolling_lanes)
    chunks = np.full(2 * n_contacts, n_bodies, dtype=np.int64)
    values = np.zeros((2 * n_contacts, width, 6))
    frame = np.zeros((3, 3))
    for c in range(n_contacts):
        write_frame(normals[c], 3, frame)
        for side in range(2):
            body = first[c] if side == 0 else second[c]
            if body < 0 or body >= n_bodies:
                continue
            sign = 1.0 if side == 0 else -1.0
            chunks[2 * c + side] = body
            _write_piece(
                sign, points[c] - centres[body], rotations[body], frame, n_linear, rolling_lanes, values[2 * c + side]
            )
    return 2 * np.arange(n_contacts + 1), chunks, values


@njit(cache=True)
def _write_piece(sign, arm, rotation, frame, n_linear, rolling_lanes, piece):  # type: ignore[no-untyped-def]
    """Write the rows of a contact on one body; d·(ω × r) is Ω·Rᵀ(r × d) with Ω = Rᵀω in body axes."""
    for lane in range(len(piece)):
        is_linear = lane < n_linear
        axis = lane if is_linear else rolling_lanes[lane - n_linear]
        x, y, z = frame[axis]
        if is_linear:
            piece[lane, 0], piece[lane, 1], piece[lane, 2] = sign * x, sign * y, sign * z
            x, y, z = arm[1] * z - arm[2] * y, arm[2] * x - arm[0] * z, arm[0] * y - arm[1] * x
        for k in range(3):
            piece[lane, 3 + k] = sign * (rotation[0, k] * x + rotation[1, k] * y + rotation[2, k] * z)
