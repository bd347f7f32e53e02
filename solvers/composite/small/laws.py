"""Laws and layout of the contacts of a small problem, computed from the arrays of its laws."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.blocks import write_layout
from ....problems.contact.laws import ROLLS_OF_KIND, ROWS_OF_KIND, SET_OF_KIND


class ContactLaws(NamedTuple):
    """Arrays of ``Laws`` and ``BlockLayout`` for contacts with equal numbers of rows.

    Attributes:
        sets: the convex set of each law.
        row_count: number of rows of each law.
        is_rolling: whether each law is rolling friction.
        first_row: first row of each law.
        partner_law: the partner of each law.
        mu: the friction coefficient of each law.
        bounds: the fixed part of the friction bound of each law.
        slot: place of each row in the padded blocks.
        contact_of_row: the contact of each row.
        partner: the contact whose normal impulse bounds the friction of each contact.
        friction: μ of each contact.
        fixed_bound: the fixed part of the friction bound of each contact.
        partner_lanes: slot of the normal row of the partner of each contact.
    """

    sets: NDArray[np.int8]
    row_count: IntArray
    is_rolling: NDArray[np.bool_]
    first_row: IntArray
    partner_law: IntArray
    mu: FloatArray
    bounds: FloatArray
    slot: IntArray
    contact_of_row: IntArray
    partner: IntArray
    friction: FloatArray
    fixed_bound: FloatArray
    partner_lanes: NDArray[np.uint64]


@njit(cache=True, error_model="numpy")
def lay_out_contacts(kind, partner_law, mu, bounds):  # type: ignore[no-untyped-def]
    """Return whether the laws form contacts with equal numbers of rows, and their ``ContactLaws``.

    The arguments are the arrays of ``Laws``.
    """
    n_laws, n_rows = len(kind), 0
    sets, row_count = np.empty(n_laws, dtype=np.int8), np.empty(n_laws, dtype=np.int64)
    is_rolling, first_row = np.empty(n_laws, dtype=np.bool_), np.empty(n_laws, dtype=np.int64)
    for law in range(n_laws):
        sets[law], row_count[law], first_row[law] = SET_OF_KIND[kind[law]], ROWS_OF_KIND[kind[law]], n_rows
        is_rolling[law] = ROLLS_OF_KIND[kind[law]]
        n_rows += row_count[law]
    slot, indices, block_bounds = (
        np.empty(n_rows, dtype=np.int64),
        np.empty((5, n_laws), dtype=np.int64),
        np.empty((4, n_laws)),
    )
    arrays = (sets, row_count, is_rolling, partner_law, mu, bounds, slot, indices, block_bounds)
    sliding, width, n_blocks, n_joints = write_layout(*arrays, np.empty(n_laws, dtype=np.bool_))
    are_equal_contacts = width == 1 + sliding and n_joints == 0 and n_rows == width * n_blocks
    partner, partner_lanes = indices[3, :n_blocks], np.empty(n_blocks, dtype=np.uint64)
    for b in range(n_blocks):
        partner_lanes[b] = width * partner[b]
    laws = ContactLaws(
        sets,
        row_count,
        is_rolling,
        first_row,
        partner_law,
        mu,
        bounds,
        slot,
        slot // width,
        partner,
        block_bounds[0, :n_blocks],
        block_bounds[1, :n_blocks],
        partner_lanes,
    )
    return are_equal_contacts, laws
