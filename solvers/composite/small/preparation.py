"""Data of a small problem for sweeps, computed from its arrays by one kernel.

Each function calls the kernels that prepare large problems, so the results are the same. The problem must contain only
contacts, with or without sliding friction, all with the same number of rows.
"""

import numpy as np
from numba import njit

from ....problems.contact.coupling import components_over_matrix, components_over_pieces, write_scales_and_ratios
from ....problems.contact.matrices.delassus import gather_blocks, multiply_pieces, write_diagonal
from ....problems.contact.matrices.pieces import cut_columns
from ...sweeps.step_size import write_step_sizes
from ..sweep_selection import FACTORS_READ_RATIO_ON_FEW_ROWS, RELAXATION, count_shared_chunks, couples_contacts

NEEDS_OTHER_SWEEPS, UNCOUPLED, COUPLED = 0, 1, 2
"""Kinds of coupling: coupled contacts on which other sweeps are faster, uncoupled contacts, other coupled contacts."""

ROWS_OF_LAW_VALUES = 5
"""Number of rows of the array from which the residual is computed, as in ``Residual``."""

N_WORK = 6
"""Number of vectors of n_rows entries that the sweeps need as work space."""


@njit(cache=True, error_model="numpy")
def prepare_over_matrix(  # type: ignore[no-untyped-def]
    indptr, indices, data, free_velocity, sets, row_count, is_rolling, first_row, partner_law, slot, contacts, partner
):
    """Return the data of ``_pack_data`` for a problem given by G in CSR; ``contacts`` holds the contact of each row."""
    diagonal = np.zeros(len(free_velocity))
    write_diagonal(indptr, indices, data, diagonal)
    coupling, component = UNCOUPLED, np.zeros(len(partner), dtype=np.int64)
    if len(partner) > 1:
        component = components_over_matrix(indptr, indices, data, diagonal, contacts, partner)
        if couples_contacts(indptr, indices, data, contacts):
            coupling = COUPLED
    width = len(free_velocity) // len(partner)
    blocks = gather_blocks(indptr, indices, slot, len(partner), width, data)
    laws = (sets, row_count, is_rolling, first_row, partner_law)
    return _pack_data(coupling, blocks, diagonal, component, laws, free_velocity, slot)


@njit(cache=True, error_model="numpy")
def prepare_over_columns(  # type: ignore[no-untyped-def]
    indptr,
    indices,
    data,
    root,
    free_velocity,
    sets,
    row_count,
    is_rolling,
    first_row,
    partner_law,
    slot,
    contacts,
    partner,
):
    """Return the data of ``_pack_data`` for a problem given by W in CSC and the root of the diagonal of M⁻¹."""
    width = len(free_velocity) // len(partner)
    starts, chunks, values, n_chunks = cut_columns(indptr, indices, slot, len(partner), width, data, root)
    laws = (sets, row_count, is_rolling, first_row, partner_law)
    return _prepare_over_pieces(starts, chunks, values, n_chunks, laws, free_velocity, slot, partner)


@njit(cache=True)
def prepare_over_pieces(  # type: ignore[no-untyped-def]
    starts,
    chunks,
    values,
    n_chunks,
    free_velocity,
    sets,
    row_count,
    is_rolling,
    first_row,
    partner_law,
    slot,
    contacts,
    partner,
):
    """Return the data of ``_pack_data`` for a problem given by the pieces of W̃ = Sᵀ W, with M⁻¹ = S Sᵀ."""
    laws = (sets, row_count, is_rolling, first_row, partner_law)
    return _prepare_over_pieces(starts, chunks, values, n_chunks, laws, free_velocity, slot, partner)


@njit(cache=True, error_model="numpy")
def _prepare_over_pieces(starts, chunks, values, n_chunks, laws, free_velocity, slot, partner):  # type: ignore[no-untyped-def]
    """See ``prepare_over_pieces``."""
    coupling, component = UNCOUPLED, np.zeros(len(partner), dtype=np.int64)
    if len(partner) > 1:
        component = components_over_pieces(starts, chunks, values, n_chunks, partner)
        max_shared, pairs = count_shared_chunks(chunks, n_chunks)
        if max_shared > 1:
            read_ratio = values.shape[1] ** 2 * pairs / max(2.0 * values.size, 1.0)
            coupling = COUPLED if read_ratio <= FACTORS_READ_RATIO_ON_FEW_ROWS else NEEDS_OTHER_SWEEPS
    diagonal = np.zeros(len(free_velocity))
    _add_square_sums(starts, values, diagonal)
    blocks = multiply_pieces(starts, chunks, values, n_chunks)
    return _pack_data(coupling, blocks, diagonal, component, laws, free_velocity, slot)


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _add_square_sums(starts, values, sums):  # type: ignore[no-untyped-def]
    """Add the squared norm of each column, as ``Pieces.square_sums`` does."""
    _, width, length = values.shape
    for i in range(len(starts) - 1):
        for p in range(starts[i], starts[i + 1]):
            for lane in range(width):
                for k in range(length):
                    entry = values[p, lane, k]
                    sums[width * i + lane] += entry * entry


@njit(cache=True, error_model="numpy")
def _pack_data(coupling, blocks, diagonal, component, laws, free_velocity, slot):  # type: ignore[no-untyped-def]
    """Return the data for the sweeps.

    Returns:
        The kind of coupling, the index of a law that no impulse satisfies or −1, the scale of the residual [m/s], the
        first stored block of each block row, the first lane of the column of each stored block, and all numbers in one
            array: the blocks, the step sizes, the diagonal of G, the numbers of the residual, and work space for the
            sweeps.
    """
    starts, columns, values = blocks
    sets, row_count, is_rolling, first_row, partner_law = laws
    n_rows, n_blocks, n_laws = len(free_velocity), len(component), len(sets)
    width = n_rows // n_blocks
    n_values, n_step_sizes, n_law_values = values.size, 2 * n_blocks, ROWS_OF_LAW_VALUES * n_laws
    store = np.empty(n_values + n_step_sizes + n_rows + n_law_values + N_WORK * n_rows)
    store[:n_values] = values.reshape(-1)
    offset = n_values
    step_sizes = store[offset : offset + n_step_sizes].reshape(n_blocks, 2)
    step_sizes[:] = 0.0
    write_step_sizes(slot, width, diagonal, RELAXATION if coupling == COUPLED else 1.0, step_sizes)
    offset += n_step_sizes
    store[offset : offset + n_rows] = diagonal
    offset += n_rows
    law_values = store[offset : offset + n_law_values].reshape(ROWS_OF_LAW_VALUES, n_laws)
    law_arrays = (sets, row_count, is_rolling, first_row, partner_law)
    stuck, scale = write_scales_and_ratios(*law_arrays, diagonal, free_velocity, component, slot, width, law_values)
    return coupling, stuck, scale, starts.view(np.uint64), (width * columns).astype(np.uint32), store
