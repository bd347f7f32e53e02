"""Data of a small problem for sweeps, computed from its arrays by one kernel.

Each function calls the kernels that prepare large problems, so the results are the same. The sweeps need a problem with
contacts only, with or without sliding friction, all with the same number of rows.
"""

import numpy as np
from numba import njit

from ....problems.compilation.kernel_arrays import copy_entries
from ....problems.contact.coupling import components_over_matrix, components_over_pieces, write_scales_and_ratios
from ....problems.contact.matrices.delassus import gather_blocks, multiply_pieces, write_diagonal
from ....problems.contact.matrices.factors import multiply_by_root
from ....problems.contact.matrices.pieces import cut_columns
from ....problems.contact.residual import MAX_SQUARED, MIN_SQUARED
from ...sweeps.step_size import write_step_sizes
from ..sweep_selection import FACTORS_READ_RATIO_ON_FEW_ROWS, RELAXATION, count_shared_chunks, couples_contacts
from .laws import lay_out_contacts

UNSUITABLE, UNCOUPLED, COUPLED = 0, 1, 2
"""Kinds of problem: unsuitable for the sweeps of small problems, or with uncoupled or coupled contacts."""

ROWS_OF_LAW_VALUES = 5
"""Number of rows of the array from which the residual is computed, as in ``Residual``."""

N_WORK = 6
"""Number of vectors of n_rows entries that the sweeps need as work space."""


@njit(cache=True, error_model="numpy")
def prepare_over_matrix(kind, partner_law, mu, bounds, free_velocity, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Return the data of ``_pack_data`` for a problem given by the arrays of its laws, c, and G in CSR."""
    are_equal_contacts, laws = lay_out_contacts(kind, partner_law, mu, bounds)
    if not are_equal_contacts:
        return UNSUITABLE, 0.0, np.empty(0)
    return prepare_matrix(laws, free_velocity, indptr, indices, data)


@njit(cache=True, error_model="numpy")
def prepare_over_columns(kind, partner_law, mu, bounds, free_velocity, indptr, indices, data, root):  # type: ignore[no-untyped-def]
    """Return the data of ``_pack_data`` for a problem given by laws, c, W in CSC and the root of the diagonal M⁻¹."""
    are_equal_contacts, laws = lay_out_contacts(kind, partner_law, mu, bounds)
    if not are_equal_contacts:
        return UNSUITABLE, 0.0, np.empty(0)
    n_contacts = len(laws.partner)
    width = len(free_velocity) // n_contacts
    starts, chunks, values, n_chunks = cut_columns(indptr, indices, laws.slot, n_contacts, width, data, root)
    return prepare_pieces(laws, free_velocity, starts, chunks, values, n_chunks)


@njit(cache=True, error_model="numpy")
def prepare_over_factors(  # type: ignore[no-untyped-def]
    kind, partner_law, mu, bounds, free_velocity, indptr, indices, data, root_indptr, root_indices, root_data
):
    """Return the data of ``_pack_data`` for a problem given by laws, c, W in CSC and S in CSR, with M⁻¹ = S Sᵀ."""
    are_equal_contacts, laws = lay_out_contacts(kind, partner_law, mu, bounds)
    if not are_equal_contacts:
        return UNSUITABLE, 0.0, np.empty(0)
    n_contacts = len(laws.partner)
    width, ones = len(free_velocity) // n_contacts, np.ones(len(root_indptr) - 1)
    scaled, rows, column_starts = multiply_by_root(root_indptr, root_indices, root_data, indptr, indices, data)
    starts, chunks, values, n_chunks = cut_columns(column_starts, rows, laws.slot, n_contacts, width, scaled, ones)
    return prepare_pieces(laws, free_velocity, starts, chunks, values, n_chunks)


@njit(cache=True, error_model="numpy")
def prepare_over_pieces(kind, partner_law, mu, bounds, free_velocity, starts, chunks, values, n_chunks):  # type: ignore[no-untyped-def]
    """Return the data of ``_pack_data`` for a problem given by laws, c, and the pieces of W̃ = Sᵀ W."""
    are_equal_contacts, laws = lay_out_contacts(kind, partner_law, mu, bounds)
    if not are_equal_contacts:
        return UNSUITABLE, 0.0, np.empty(0)
    return prepare_pieces(laws, free_velocity, starts, chunks, values, n_chunks)


@njit(cache=True, error_model="numpy")
def prepare_matrix(laws, free_velocity, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Return the data of ``_pack_data`` for ``ContactLaws``, c, and G in CSR."""
    diagonal, n_contacts = np.zeros(len(free_velocity)), len(laws.partner)
    write_diagonal(indptr, indices, data, diagonal)
    coupling, component = UNCOUPLED, np.zeros(n_contacts, dtype=np.int64)
    if n_contacts > 1:
        component = components_over_matrix(indptr, indices, data, diagonal, laws.contact_of_row, laws.partner)
        if couples_contacts(indptr, indices, data, laws.contact_of_row):
            coupling = COUPLED
    width = len(free_velocity) // n_contacts
    blocks = gather_blocks(indptr, indices, laws.slot, n_contacts, width, data)
    return _pack_data(coupling, blocks, diagonal, component, laws, free_velocity)


@njit(cache=True, error_model="numpy")
def prepare_pieces(laws, free_velocity, starts, chunks, values, n_chunks):  # type: ignore[no-untyped-def]
    """Return the data of ``_pack_data`` for ``ContactLaws``, c, and the pieces of W̃."""
    coupling, component = UNCOUPLED, np.zeros(len(laws.partner), dtype=np.int64)
    if len(laws.partner) > 1:
        component = components_over_pieces(starts, chunks, values, n_chunks, laws.partner)
        max_shared, pairs = count_shared_chunks(chunks, n_chunks)
        if max_shared > 1:
            read_ratio = values.shape[1] ** 2 * pairs / max(2.0 * values.size, 1.0)
            coupling = COUPLED if read_ratio <= FACTORS_READ_RATIO_ON_FEW_ROWS else UNSUITABLE
    diagonal = np.zeros(len(free_velocity))
    _add_square_sums(starts, values, diagonal)
    blocks = multiply_pieces(starts, chunks, values, n_chunks)
    return _pack_data(coupling, blocks, diagonal, component, laws, free_velocity)


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
def _pack_data(coupling, blocks, diagonal, component, laws, free_velocity):  # type: ignore[no-untyped-def]
    """Return the kind of problem, the scale of the residual [m/s], and the data for the sweeps in one array.

    ``cut_store`` returns the parts of the array. The problem is unsuitable if no impulse satisfies a law, or if squares
    of its velocities overflow or underflow.
    """
    block_starts, columns, block_values = blocks
    n_rows, n_blocks, n_laws, n_stored = len(free_velocity), len(component), len(laws.sets), len(columns)
    width = n_rows // n_blocks
    n_numbers = block_values.size + 2 * n_blocks + n_rows + ROWS_OF_LAW_VALUES * n_laws + N_WORK * n_rows
    store = np.empty(n_blocks + 1 + (n_stored + 1) // 2 + n_numbers)
    copy_entries(block_starts, store[: n_blocks + 1].view(np.int64))
    _, lanes, values, step_sizes, stored_diagonal, law_values, _ = cut_store(store, n_rows, n_blocks, n_laws)
    for k in range(n_stored):
        lanes[k] = width * columns[k]
    copy_entries(block_values.reshape(-1), values)
    step_sizes[:] = 0.0
    relaxation = RELAXATION if coupling == COUPLED else 1.0
    write_step_sizes(laws.slot, width, diagonal, relaxation, step_sizes.reshape(n_blocks, 2))
    copy_entries(diagonal, stored_diagonal)
    law_arrays = (laws.sets, laws.row_count, laws.is_rolling, laws.first_row, laws.partner_law)
    stuck, scale = write_scales_and_ratios(
        *law_arrays, diagonal, free_velocity, component, laws.slot, width, law_values
    )
    if stuck >= 0 or not MIN_SQUARED <= scale <= MAX_SQUARED:
        coupling = UNSUITABLE
    return coupling, scale, store


@njit(cache=True, error_model="numpy")
def cut_store(store, n_rows, n_blocks, n_laws):  # type: ignore[no-untyped-def]
    """Return the parts of the array of ``_pack_data``.

    These are the first stored block of each block row, the first lane of the column of each stored block, the entries
    of the blocks, the step sizes, the diagonal of G, the numbers of the residual, and work space for the sweeps.
    """
    width, starts = n_rows // n_blocks, store[: n_blocks + 1].view(np.uint64)
    n_stored = np.int64(starts[n_blocks])
    lanes_end = n_blocks + 1 + (n_stored + 1) // 2
    values_end = lanes_end + n_stored * width * width
    step_sizes_end = values_end + 2 * n_blocks
    diagonal_end = step_sizes_end + n_rows
    law_values_end = diagonal_end + ROWS_OF_LAW_VALUES * n_laws
    lanes = store[n_blocks + 1 : lanes_end].view(np.uint32)[:n_stored]
    law_values = store[diagonal_end:law_values_end].reshape(ROWS_OF_LAW_VALUES, n_laws)
    work = store[law_values_end:].reshape(N_WORK, n_rows)
    values, step_sizes = store[lanes_end:values_end], store[values_end:step_sizes_end]
    return starts, lanes, values, step_sizes, store[step_sizes_end:diagonal_end], law_values, work
