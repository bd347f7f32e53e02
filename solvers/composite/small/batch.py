"""Many small problems in one kernel: each is prepared, swept and judged.

The arrays of all problems are joined. Problem k has the rows r_k to r_{k+1} − 1, and its sparse matrix has the entries
e_k to e_{k+1} − 1. The starts of the matrix begin at r_k + k, because each matrix has one more start than rows (or
columns). Shared laws are stored once.
"""

import numpy as np
from numba import njit

from ....problems.contact.matrices.accurate import write_accurate_over_factors, write_accurate_over_matrix
from ....problems.contact.matrices.factors import multiply_by_root
from ....problems.contact.matrices.pieces import cut_columns
from ....problems.contact.residual import write_squared_violations
from .laws import lay_out_contacts
from .preparation import COUPLED, UNSUITABLE, cut_store, prepare_matrix, prepare_pieces
from .sweeps import residual_laws, sweep_coupled_contacts, sweep_uncoupled_contacts

NOT_SOLVED = 0
"""Outcome of a problem that sweeps alone do not solve. The outcome of any other problem is the kind of its coupling."""


@njit(cache=True, nogil=True, error_model="numpy")
def solve_over_matrices(  # type: ignore[no-untyped-def]
    first,
    last,
    laws,
    law_of_problem,
    rows,
    entries,
    indptr,
    indices,
    data,
    free_velocities,
    tolerance,
    max_iterations,
    impulses,
    outcomes,
    iterations,
    residuals,
):
    """Solve the problems ``first`` to ``last`` − 1, given by G in CSR.

    Write Λ [N s], the outcome, the number of sweeps and, for a solved problem, the judge's residual of each.
    """
    for k in range(first, last):
        are_equal_contacts, contacts = _laws_of(laws, law_of_problem[k])
        outcomes[k], iterations[k] = NOT_SOLVED, 0
        if not are_equal_contacts:
            continue
        begin, end = rows[k], rows[k + 1]
        starts = indptr[begin + k : end + k + 1]
        columns, values = indices[entries[k] : entries[k + 1]], data[entries[k] : entries[k + 1]]
        free_velocity, answer = free_velocities[begin:end], impulses[begin:end]
        answer[:] = 0.0
        prepared = prepare_matrix(contacts, free_velocity, starts, columns, values)
        outcomes[k], iterations[k] = _sweep(contacts, free_velocity, prepared, tolerance, max_iterations, answer)
        if outcomes[k] != NOT_SOLVED:
            velocity, rounding = np.empty(len(free_velocity)), np.empty(len(free_velocity))
            write_accurate_over_matrix(starts, columns, values, free_velocity, answer, velocity, rounding)
            residuals[k] = _judge(contacts, prepared, answer, velocity, rounding)


@njit(cache=True, nogil=True, error_model="numpy")
def solve_over_factors(  # type: ignore[no-untyped-def]
    first,
    last,
    laws,
    law_of_problem,
    rows,
    entries,
    indptr,
    indices,
    data,
    dofs,
    mass_entries,
    mass_indptr,
    mass_indices,
    mass_data,
    is_diagonal,
    root_entries,
    root_indptr,
    root_indices,
    root_data,
    free_velocities,
    tolerance,
    max_iterations,
    impulses,
    outcomes,
    iterations,
    residuals,
):
    """Solve the problems ``first`` to ``last`` − 1, given by W in CSC, M⁻¹ and its root S in CSR.

    Write the same results as ``solve_over_matrices``. Problem k has the degrees of freedom d_k to d_{k+1} − 1, with
    d = ``dofs``; ``is_diagonal`` states whether its M⁻¹ is diagonal.
    """
    for k in range(first, last):
        are_equal_contacts, contacts = _laws_of(laws, law_of_problem[k])
        outcomes[k], iterations[k] = NOT_SOLVED, 0
        if not are_equal_contacts:
            continue
        begin, end, dof, last_dof = rows[k], rows[k + 1], dofs[k], dofs[k + 1]
        starts = indptr[begin + k : end + k + 1]
        row_indices, values = indices[entries[k] : entries[k + 1]], data[entries[k] : entries[k + 1]]
        free_velocity, answer = free_velocities[begin:end], impulses[begin:end]
        answer[:] = 0.0
        root_starts, a, b = root_indptr[dof + k : last_dof + k + 1], root_entries[k], root_entries[k + 1]
        arguments = (contacts.slot, len(contacts.partner), len(free_velocity) // len(contacts.partner))
        if is_diagonal[k]:
            pieces = cut_columns(starts, row_indices, *arguments, values, root_data[a:b])
        else:
            root = (root_starts, root_indices[a:b], root_data[a:b])
            scaled, scaled_indices, scaled_starts = multiply_by_root(*root, starts, row_indices, values)
            pieces = cut_columns(scaled_starts, scaled_indices, *arguments, scaled, np.ones(last_dof - dof))
        prepared = prepare_pieces(contacts, free_velocity, *pieces)
        outcomes[k], iterations[k] = _sweep(contacts, free_velocity, prepared, tolerance, max_iterations, answer)
        if outcomes[k] != NOT_SOLVED:
            a, b = mass_entries[k], mass_entries[k + 1]
            mass = mass_indptr[dof + k : last_dof + k + 1], mass_indices[a:b], mass_data[a:b]
            velocity, rounding = np.empty(len(free_velocity)), np.empty(len(free_velocity))
            write_accurate_over_factors(starts, row_indices, values, *mass, free_velocity, answer, velocity, rounding)
            residuals[k] = _judge(contacts, prepared, answer, velocity, rounding)


@njit(cache=True, error_model="numpy")
def _laws_of(laws, k):  # type: ignore[no-untyped-def]
    """Return the result of ``lay_out_contacts`` for laws number ``k``."""
    starts, kind, partner_law, mu, bounds = laws
    first, last = starts[k], starts[k + 1]
    return lay_out_contacts(kind[first:last], partner_law[first:last], mu[first:last], bounds[first:last])


@njit(cache=True, error_model="numpy")
def _sweep(laws, free_velocity, prepared, tolerance, max_iterations, impulses):  # type: ignore[no-untyped-def]
    """Sweep from zero; return the outcome and the number of sweeps."""
    coupling, scale, store = prepared
    if coupling == UNSUITABLE:
        return NOT_SOLVED, 0
    arguments = (laws, free_velocity, scale, store, tolerance, max_iterations, impulses)
    if coupling == COUPLED:
        is_solved, count = sweep_coupled_contacts(*arguments)
    else:
        is_solved, count = sweep_uncoupled_contacts(*arguments)
    return (coupling if is_solved else NOT_SOLVED), count


@njit(cache=True, error_model="numpy")
def _judge(laws, prepared, impulses, velocity, rounding):  # type: ignore[no-untyped-def]
    """Return the judge's residual from ξ, computed in twice the working precision, and the error bound of its rows."""
    _, scale, store = prepared
    law_values = cut_store(store, len(impulses), len(laws.friction), len(laws.sets))[5]
    largest = write_squared_violations(*residual_laws(laws), law_values, impulses, velocity)
    for law in range(len(laws.sets)):
        law_rounding = 0.0
        for row in range(laws.first_row[law], laws.first_row[law] + laws.row_count[law]):
            law_rounding += rounding[row]
        largest = max(largest, law_values[3, law] * law_values[1, law] * law_rounding)
    return largest / scale
