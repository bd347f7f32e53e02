"""Many small problems in one kernel: each is prepared, swept and judged.

The arrays of all problems are joined. Problem k has the rows r_k to r_{k+1} − 1, and its sparse matrix has the entries
e_k to e_{k+1} − 1. The starts of the matrix begin at r_k + k, because each matrix has one more start than rows (or
columns). Shared laws are stored once.
"""

import numpy as np
from numba import njit

from ....problems.contact.matrices.accurate import write_accurate_over_factors, write_accurate_over_matrix
from ....problems.contact.residual import MAX_SQUARED, MIN_SQUARED, write_squared_violations
from ...iteration.stopping import MAX_CHECK_INTERVAL
from ..sweep_selection import ROWS_PER_CHECK
from .preparation import COUPLED, NEEDS_OTHER_SWEEPS, prepare_over_columns, prepare_over_matrix
from .sweeps import cut_store, sweep_coupled, sweep_uncoupled

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
        begin, end = rows[k], rows[k + 1]
        starts = indptr[begin + k : end + k + 1]
        columns, values = indices[entries[k] : entries[k + 1]], data[entries[k] : entries[k + 1]]
        free_velocity, answer = free_velocities[begin:end], impulses[begin:end]
        answer[:] = 0.0
        preparation, sweeps = _laws_of(laws, law_of_problem[k])
        prepared = prepare_over_matrix(starts, columns, values, free_velocity, *preparation)
        outcomes[k], iterations[k] = _sweep(prepared, free_velocity, sweeps, tolerance, max_iterations, answer)
        if outcomes[k] != NOT_SOLVED:
            velocity, rounding = np.empty(len(free_velocity)), np.empty(len(free_velocity))
            write_accurate_over_matrix(starts, columns, values, free_velocity, answer, velocity, rounding)
            residuals[k] = _judge(prepared, sweeps, answer, velocity, rounding)


@njit(cache=True, nogil=True, error_model="numpy")
def solve_over_columns(  # type: ignore[no-untyped-def]
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
    mass_indptr,
    mass_indices,
    mass_data,
    root,
    free_velocities,
    tolerance,
    max_iterations,
    impulses,
    outcomes,
    iterations,
    residuals,
):
    """Solve the problems ``first`` to ``last`` − 1, given by W in CSC and a diagonal M⁻¹.

    Write the same results as ``solve_over_matrices``. The root of M⁻¹ of problem k has the entries d_k to d_{k+1} − 1,
    with d = ``dofs``.
    """
    for k in range(first, last):
        begin, end, dof, last_dof = rows[k], rows[k + 1], dofs[k], dofs[k + 1]
        starts = indptr[begin + k : end + k + 1]
        row_indices, values = indices[entries[k] : entries[k + 1]], data[entries[k] : entries[k + 1]]
        free_velocity, answer = free_velocities[begin:end], impulses[begin:end]
        answer[:] = 0.0
        preparation, sweeps = _laws_of(laws, law_of_problem[k])
        prepared = prepare_over_columns(starts, row_indices, values, root[dof:last_dof], free_velocity, *preparation)
        outcomes[k], iterations[k] = _sweep(prepared, free_velocity, sweeps, tolerance, max_iterations, answer)
        if outcomes[k] != NOT_SOLVED:
            mass = mass_indptr[dof + k : last_dof + k + 1], mass_indices[dof:last_dof], mass_data[dof:last_dof]
            velocity, rounding = np.empty(len(free_velocity)), np.empty(len(free_velocity))
            write_accurate_over_factors(starts, row_indices, values, *mass, free_velocity, answer, velocity, rounding)
            residuals[k] = _judge(prepared, sweeps, answer, velocity, rounding)


@njit(cache=True, error_model="numpy")
def _laws_of(laws, k):  # type: ignore[no-untyped-def]
    """Return the arguments of preparation and sweeps for laws number ``k``."""
    (
        law_starts,
        row_starts,
        block_starts,
        sets,
        row_count,
        is_rolling,
        first_row,
        partner_law,
        slot,
        contacts,
        partner,
        friction,
        fixed_bound,
        partner_lanes,
        mu,
        bounds,
    ) = laws
    a, b = law_starts[k], law_starts[k + 1]
    c, d = row_starts[k], row_starts[k + 1]
    e, f = block_starts[k], block_starts[k + 1]
    kinds, counts, first_rows, partners = sets[a:b], row_count[a:b], first_row[a:b], partner_law[a:b]
    preparation = (kinds, counts, is_rolling[a:b], first_rows, partners, slot[c:d], contacts[c:d], partner[e:f])
    block_arrays = (friction[e:f], fixed_bound[e:f], partner_lanes[e:f])
    return preparation, (*block_arrays, kinds, counts, first_rows, mu[a:b], bounds[a:b], partners)


@njit(cache=True, error_model="numpy")
def _sweep(prepared, free_velocity, laws, tolerance, max_iterations, impulses):  # type: ignore[no-untyped-def]
    """Sweep from zero; return the outcome and the number of sweeps."""
    coupling, stuck, scale, starts, lanes, store = prepared
    if coupling == NEEDS_OTHER_SWEEPS or stuck >= 0 or not MIN_SQUARED <= scale <= MAX_SQUARED:
        return NOT_SOLVED, 0
    between_checks = max(1, min(MAX_CHECK_INTERVAL, ROWS_PER_CHECK // len(free_velocity))) if coupling == COUPLED else 1
    arguments = (starts, lanes, store, scale, free_velocity, *laws, tolerance, max_iterations, between_checks, impulses)
    if coupling == COUPLED:
        is_solved, count = sweep_coupled(*arguments)
    else:
        is_solved, count = sweep_uncoupled(*arguments)
    return (coupling if is_solved else NOT_SOLVED), count


@njit(cache=True, error_model="numpy")
def _judge(prepared, laws, impulses, velocity, rounding):  # type: ignore[no-untyped-def]
    """Return the judge's residual from ξ, computed in twice the working precision, and the error bound of its rows."""
    _, _, scale, _, lanes, store = prepared
    friction, _, _, sets, row_count, first_row, mu, bounds, partner_law = laws
    width = len(impulses) // len(friction)
    _, _, _, law_values, _ = cut_store(store, len(lanes) * width * width, len(impulses), len(friction), len(sets))
    largest = write_squared_violations(
        sets, row_count, first_row, mu, bounds, partner_law, law_values, impulses, velocity
    )
    for law in range(len(sets)):
        law_rounding = 0.0
        for row in range(first_row[law], first_row[law] + row_count[law]):
            law_rounding += rounding[row]
        largest = max(largest, law_values[3, law] * law_values[1, law] * law_rounding)
    return largest / scale
