"""Force directions of contacts between balls, as records of two balls and a normal.

The arm of a ball to a contact point is its radius along the normal, so both W and G follow from the normal alone. With
n from the second ball j to the first ball i, T1 and T2 as in ``contact_frame``, moments of inertia J, and σ = rω,

    γ = v_i − v_j − (σ_i + σ_j) × n,      Λ ↦ P = Λ_N n + Λ_T1 T1 + Λ_T2 T2,
    v_i += P/m_i,   v_j −= P/m_j,   σ_i −= (r_i²/J_i) n × P,   σ_j −= (r_j²/J_j) n × P.

A record takes 40 bytes; the two pieces of W of a contact take 288.
"""

import numpy as np
from numba import njit, uint64

from ...arrays import FloatArray, IntArray
from .contact_frame import tangents, write_frame
from .pieces import BallRecords, DeferredPieces

WIDTH, LENGTH = 3, 6
"""Rows of a contact with friction and degrees of freedom of a ball, in space."""


class BallContacts(DeferredPieces):
    """W of contacts with friction between balls in space, or of a ball and a surface.

    Attributes:
        chunks: first ball of each contact, and second ball or ``len(radii)`` for a surface, shape (2 · n_contacts,).
        normals: n from the second to the first ball, shape (n_contacts, 3).
        radii: r of all balls [m], shape (n_balls,).
    """

    normals: FloatArray
    radii: FloatArray

    def __init__(self, chunks: IntArray, normals: FloatArray, radii: FloatArray) -> None:
        super().__init__(chunks, len(radii), (WIDTH, LENGTH))
        self._set(normals=normals, radii=radii)

    def _compute(self) -> FloatArray:
        values: FloatArray = _write_pieces(*self.balls)
        return values

    @property
    def fills_chunks(self) -> bool:
        """Whether each block has an entry for every degree of freedom of its chunks."""
        return True

    @property
    def balls(self) -> BallRecords:
        """The contacts as records of two balls and a normal."""
        return BallRecords(self.chunks, self.normals, self.radii)

    def copy(self) -> "BallContacts":
        """Return a copy of the records."""
        return BallContacts(self.chunks.copy(), self.normals.copy(), self.radii.copy())

    def times(self, padded: FloatArray) -> FloatArray:
        """Return the product with a vector over lanes, shape (n_chunks · length,)."""
        product = np.zeros((self.n_chunks, LENGTH))
        _write_product(*self.balls, padded.reshape(-1, WIDTH), product)
        return product.reshape(-1)

    def transposed_times(self, vector: FloatArray) -> FloatArray:
        """Return the product of the transpose with a vector over degrees of freedom, shape (n_blocks · width,)."""
        product = np.empty((self.n_blocks, WIDTH))
        _write_transposed_product(*self.balls, vector.reshape(-1, LENGTH), product)
        return product.reshape(-1)

    def delassus_diagonal(self, inverse_diagonal: FloatArray) -> FloatArray:
        """Return the diagonal of G [1/kg], shape (n_rows,), for a diagonal M⁻¹, shape (n_chunks · length,)."""
        diagonal = np.empty((self.n_blocks, WIDTH))
        _write_diagonal(*self.balls, inverse_diagonal.reshape(-1, LENGTH), diagonal)
        return diagonal.reshape(-1)


class BallNormals(DeferredPieces):
    """W_N of contacts between balls, or of a ball and a surface, in space or in the plane.

    Attributes:
        chunks: first ball of each contact, and second ball or ``n_chunks`` for a surface, shape (2 · n_contacts,).
        normals: n from the second to the first ball, shape (n_contacts, d).
        n_chunks: number of balls.
        length: degrees of freedom of a ball, translations first.
    """

    normals: FloatArray

    def __init__(self, chunks: IntArray, normals: FloatArray, n_chunks: int, length: int) -> None:
        super().__init__(chunks, n_chunks, (1, length))
        self._set(normals=normals)

    def _compute(self) -> FloatArray:
        values: FloatArray = _write_normals(self.chunks, self.normals, self.n_chunks, self.length)
        return values

    @property
    def opposite_normals(self) -> FloatArray:
        """The normals, shape (n_contacts, d): a block is n on its first chunk and −n on its second."""
        return self.normals

    def copy(self) -> "BallNormals":
        """Return a copy of the records."""
        return BallNormals(self.chunks.copy(), self.normals.copy(), self.n_chunks, self.length)


@njit(cache=True)
def _write_normals(chunks, normals, n_balls, length):  # type: ignore[no-untyped-def]
    values = np.zeros((len(chunks), 1, length))
    for piece in range(len(chunks)):
        if chunks[piece] < n_balls:
            for axis in range(normals.shape[1]):
                values[piece, 0, axis] = normals[piece // 2, axis] * (1.0 - 2.0 * (piece % 2))
    return values


@njit(cache=True)
def _write_pieces(chunks, normals, radii):  # type: ignore[no-untyped-def]
    """Return W in pairs of pieces: γ_N = n·(v_i − v_j), γ_T = t·(v_i − v_j) − (n × t)·(r_i ω_i + r_j ω_j)."""
    values, rows = np.zeros((len(chunks), WIDTH, LENGTH)), np.empty((3, 3))
    for c in range(len(normals)):
        write_frame((normals[c, 0], normals[c, 1], normals[c, 2]), 3, rows)
        for side in range(2):
            piece, ball, sign = 2 * c + side, chunks[2 * c + side], 1.0 - 2.0 * side
            if ball == len(radii):
                continue
            for lane in range(3):
                for axis in range(3):
                    after, last = (axis + 1) % 3, (axis + 2) % 3
                    values[piece, lane, axis] = sign * rows[lane, axis]
                    if lane > 0:
                        lever = rows[0, after] * rows[lane, last] - rows[0, last] * rows[lane, after]
                        values[piece, lane, 3 + axis] = -radii[ball] * lever
    return values


@njit(cache=True, fastmath={"contract"})
def _write_product(chunks, normals, radii, padded, product):  # type: ignore[no-untyped-def]
    n_balls = uint64(len(radii))
    for c in range(len(normals)):
        x, y, z = normals[c, 0], normals[c, 1], normals[c, 2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
        normal, first, second = padded[c, 0], padded[c, 1], padded[c, 2]
        impulse = (
            normal * x + first * t1x + second * t2x,
            normal * y + first * t1y + second * t2y,
            normal * z + first * t1z + second * t2z,
        )
        moment = (first * t2x - second * t1x, first * t2y - second * t1y, first * t2z - second * t1z)  # n × P
        i, j = uint64(chunks[2 * c]), uint64(chunks[2 * c + 1])  # unsigned indices need no test for negative ones
        if i < n_balls:
            for axis in range(3):
                product[i, axis] += impulse[axis]
                product[i, 3 + axis] -= radii[i] * moment[axis]
        if j < n_balls:
            for axis in range(3):
                product[j, axis] -= impulse[axis]
                product[j, 3 + axis] -= radii[j] * moment[axis]


@njit(cache=True, fastmath={"contract"})
def _write_transposed_product(chunks, normals, radii, motion, product):  # type: ignore[no-untyped-def]
    n_balls = uint64(len(radii))
    for c in range(len(normals)):
        nx, ny, nz = normals[c, 0], normals[c, 1], normals[c, 2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(nx, ny, nz)
        i, j = uint64(chunks[2 * c]), uint64(chunks[2 * c + 1])
        x, y, z, r = motion[i, 0], motion[i, 1], motion[i, 2], radii[i]
        sx, sy, sz = r * motion[i, 3], r * motion[i, 4], r * motion[i, 5]
        if j < n_balls:
            x, y, z, r = x - motion[j, 0], y - motion[j, 1], z - motion[j, 2], radii[j]
            sx, sy, sz = sx + r * motion[j, 3], sy + r * motion[j, 4], sz + r * motion[j, 5]
        product[c, 0] = nx * x + ny * y + nz * z
        product[c, 1] = (t1x * x + t1y * y + t1z * z) - (t2x * sx + t2y * sy + t2z * sz)
        product[c, 2] = (t2x * x + t2y * y + t2z * z) + (t1x * sx + t1y * sy + t1z * sz)


@njit(cache=True, fastmath={"contract"})
def _write_diagonal(chunks, normals, radii, inverse, diagonal):  # type: ignore[no-untyped-def]
    """Write W_hᵀ M⁻¹ W_h of each row h, from the sums of M⁻¹ over both balls in each direction."""
    n_balls, one, two = uint64(len(radii)), uint64(1), uint64(2)
    for c in range(uint64(len(normals))):
        x, y, z = normals[c, 0], normals[c, 1], normals[c, 2]
        (t1x, t1y, t1z), (t2x, t2y, t2z) = tangents(x, y, z)
        i, j = uint64(chunks[two * c]), uint64(chunks[two * c + one])
        square = radii[i] * radii[i]
        mass_x, mass_y, mass_z = inverse[i, 0], inverse[i, 1], inverse[i, 2]
        spin_x, spin_y, spin_z = square * inverse[i, 3], square * inverse[i, 4], square * inverse[i, 5]
        if j < n_balls:
            square = radii[j] * radii[j]
            mass_x, mass_y, mass_z = mass_x + inverse[j, 0], mass_y + inverse[j, 1], mass_z + inverse[j, 2]
            spin_x, spin_y, spin_z = (
                spin_x + square * inverse[j, 3],
                spin_y + square * inverse[j, 4],
                spin_z + square * inverse[j, 5],
            )
        t1x, t1y, t1z, t2x, t2y, t2z = t1x * t1x, t1y * t1y, t1z * t1z, t2x * t2x, t2y * t2y, t2z * t2z
        diagonal[c, 0] = mass_x * x * x + mass_y * y * y + mass_z * z * z
        # n × T1 = T2 and n × T2 = −T1
        diagonal[c, 1] = (mass_x * t1x + mass_y * t1y + mass_z * t1z) + (spin_x * t2x + spin_y * t2y + spin_z * t2z)
        diagonal[c, 2] = (mass_x * t2x + mass_y * t2y + mass_z * t2z) + (spin_x * t1x + spin_y * t1y + spin_z * t1z)
