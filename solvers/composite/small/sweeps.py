"""Sweeps of a small problem from the first impulses to the outcome, in one kernel.

Both kernels do what ``Robust`` does in an ordinary solve: they sweep, check the residual at the same iterations, and
end when it reaches the tolerance. They stop without an outcome if ``Robust`` might act differently: if a window of
sweeps gains no digit, the residual grows, iterates may repeat, a limit is reached, or rounding may affect the residual.
"""

import numpy as np
from numba import njit

from ....problems.compilation.kernel_arrays import copy_entries
from ....problems.contact.residual import RESOLUTION, find_largest_diagonal_term, write_squared_violations
from ...iteration.stopping import (
    CYCLE_PATIENCE,
    DIVERGENCE_GROWTH,
    MAX_CHECK_INTERVAL,
    MIN_PLATEAU_SWEEPS,
    RECORD_RATIO,
)
from ...sweeps.blocks import solve_frictionless_blocks, solve_planar_blocks, solve_usual_spatial_blocks
from ...sweeps.delassus import (
    sweep_frictionless,
    sweep_planar,
    sweep_spatial,
    write_spatial_velocity,
    write_velocity,
)
from ...sweeps.safeguarded import INTERVALS, reduce_opposed_steps
from ..sweep_selection import ROWS_PER_CHECK
from ..windows import SHORT_WINDOW
from .laws import lay_out_contacts
from .preparation import cut_store

FIRST_INTERVAL, LAST_INTERVAL = INTERVALS[0], len(INTERVALS) - 1
"""Number of sweeps in the first interval of ``SafeguardedSORprox``, and index of its last interval."""

SOLVED, CONTINUE, UNUSUAL = 1, 0, -1
"""Results of a check: the tolerance is reached, sweeps continue, or the sweeps end without an outcome."""


@njit(cache=True, error_model="numpy")
def sweep_coupled(kind, partner_law, mu, bounds, free_velocity, scale, store, tolerance, max_iterations, impulses):  # type: ignore[no-untyped-def]
    """Sweep coupled contacts, given by the arrays of their laws, c, and the scale and data of ``preparation``.

    Return whether the tolerance was reached, and the number of sweeps.
    """
    _, laws = lay_out_contacts(kind, partner_law, mu, bounds)
    return sweep_coupled_contacts(laws, free_velocity, scale, store, tolerance, max_iterations, impulses)


@njit(cache=True, error_model="numpy")
def sweep_uncoupled(kind, partner_law, mu, bounds, free_velocity, scale, store, tolerance, max_iterations, impulses):  # type: ignore[no-untyped-def]
    """Sweep uncoupled contacts; see ``sweep_coupled``."""
    _, laws = lay_out_contacts(kind, partner_law, mu, bounds)
    return sweep_uncoupled_contacts(laws, free_velocity, scale, store, tolerance, max_iterations, impulses)


@njit(cache=True, error_model="numpy")
def sweep_coupled_contacts(laws, free_velocity, scale, store, tolerance, max_iterations, impulses):  # type: ignore[no-untyped-def]
    """Sweep as ``SafeguardedSORprox`` does; return whether the tolerance was reached, and the number of sweeps."""
    friction, fixed_bound, partner = laws.friction, laws.fixed_bound, laws.partner_lanes
    n_rows, n_blocks = len(free_velocity), len(friction)
    width, between_checks = n_rows // n_blocks, max(1, min(MAX_CHECK_INTERVAL, ROWS_PER_CHECK // n_rows))
    starts, lanes, values, step_sizes, diagonal, law_values, work = cut_store(store, n_rows, n_blocks, len(laws.sets))
    velocity, second_last, previous, fraction = work[0], work[1], work[2], work[3, :n_blocks]
    scaled_step_sizes = work[4:6].reshape(-1)[: 2 * n_blocks]
    fraction[:] = 1.0
    copy_entries(step_sizes, scaled_step_sizes)
    since_check, checks_since_reduction, interval = 0, 0, FIRST_INTERVAL
    progress, iteration, residual_arrays = _begin_progress(), np.int64(0), residual_laws(laws)
    while True:
        _write_velocity(width, starts, lanes, values, free_velocity, impulses, velocity)
        arrays = (residual_arrays, law_values, diagonal, impulses, velocity)
        state, progress = _check(progress, iteration, tolerance, scale, *arrays)
        if state != CONTINUE or iteration >= max_iterations:
            return state == SOLVED, iteration
        count = min(max_iterations - iteration, max(between_checks, min(MAX_CHECK_INTERVAL, 1 + iteration // 2)))
        iteration += count
        while count > 0:
            sweeps_left = interval - since_check
            if sweeps_left == 2:
                copy_entries(impulses, second_last)
            elif sweeps_left == 1:
                copy_entries(impulses, previous)
            step = min(count, sweeps_left - 2 if sweeps_left > 2 else 1)
            _sweep(
                width,
                step,
                starts,
                lanes,
                values,
                free_velocity,
                scaled_step_sizes,
                friction,
                fixed_bound,
                partner,
                impulses,
            )
            since_check += step
            count -= step
            if step == sweeps_left:
                since_check, checks_since_reduction = 0, checks_since_reduction + 1
                if reduce_opposed_steps(width, width - 1, 2, second_last, previous, impulses, step_sizes, fraction):
                    checks_since_reduction = 0
                    for i in range(n_blocks):
                        scaled_step_sizes[2 * i] = step_sizes[2 * i] * fraction[i]
                        scaled_step_sizes[2 * i + 1] = step_sizes[2 * i + 1] * fraction[i]
                interval = INTERVALS[min(checks_since_reduction, LAST_INTERVAL)]


@njit(cache=True, error_model="numpy")
def sweep_uncoupled_contacts(laws, free_velocity, scale, store, tolerance, max_iterations, impulses):  # type: ignore[no-untyped-def]
    """Sweep as ``NSGS`` does, whose first sweep is nearly exact; see ``sweep_coupled``."""
    friction, fixed_bound, partner = laws.friction, laws.fixed_bound, laws.partner_lanes
    n_rows, n_blocks = len(free_velocity), len(friction)
    width = n_rows // n_blocks
    starts, lanes, values, _, diagonal, law_values, work = cut_store(store, n_rows, n_blocks, len(laws.sets))
    velocity, relaxation = work[0], work[1, :n_blocks]
    relaxation[:] = 1.0
    progress, iteration, residual_arrays = _begin_progress(), np.int64(0), residual_laws(laws)
    while True:
        _write_velocity(width, starts, lanes, values, free_velocity, impulses, velocity)
        arrays = (residual_arrays, law_values, diagonal, impulses, velocity)
        state, progress = _check(progress, iteration, tolerance, scale, *arrays)
        if state != CONTINUE or iteration >= max_iterations:
            return state == SOLVED, iteration
        count = min(max_iterations - iteration, min(MAX_CHECK_INTERVAL, 1 + iteration // 2))
        iteration += count
        if iteration >= FIRST_INTERVAL:  # from here on, ``NSGS`` also compares increments
            return False, iteration
        if not _solve_blocks(
            width, count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
        ):
            return False, iteration


@njit(cache=True, error_model="numpy")
def residual_laws(laws):  # type: ignore[no-untyped-def]
    """Return the arrays of ``ContactLaws`` that determine violations of laws."""
    return laws.sets, laws.row_count, laws.first_row, laws.mu, laws.bounds, laws.partner_law


@njit(cache=True, error_model="numpy")
def _begin_progress():  # type: ignore[no-untyped-def]
    """Return the best and first residual, number of checks without progress, and start and residual of the window."""
    zero = np.int64(0)  # a literal would make numba compile ``_check`` once more
    return np.inf, np.inf, zero, zero, np.inf


@njit(cache=True, error_model="numpy")
def _check(progress, iteration, tolerance, scale, laws, law_values, diagonal, impulses, velocity):  # type: ignore[no-untyped-def]
    """Return the result of a check by the criteria of ``Monitor`` and ``Window``, and the progress so far."""
    best, first, n_stale_checks, window_begin, window_residual = progress
    _, row_count, first_row, _, _, _ = laws
    violation = write_squared_violations(*laws, law_values, impulses, velocity)
    residual = 0.0 if violation == 0.0 else violation / scale
    if not residual < np.inf:
        return UNUSUAL, progress
    if residual <= tolerance:
        largest_term = find_largest_diagonal_term(
            row_count, first_row, law_values[3], law_values[1], diagonal, impulses
        )
        return (SOLVED if RESOLUTION * largest_term / scale <= tolerance else UNUSUAL), progress
    if iteration == 0:
        first, window_residual = max(residual, 1.0), residual
    n_stale_checks += 1
    if residual < best:
        if residual < RECORD_RATIO * best:
            n_stale_checks = 0
        best = residual
    is_unusual = not residual < DIVERGENCE_GROWTH * first
    is_unusual |= n_stale_checks >= CYCLE_PATIENCE or iteration >= MIN_PLATEAU_SWEEPS
    if best <= 0.1 * window_residual:
        window_begin, window_residual = iteration, best
    is_unusual |= iteration - window_begin >= SHORT_WINDOW
    progress = best, first, n_stale_checks, window_begin, window_residual
    return (UNUSUAL if is_unusual else CONTINUE), progress


@njit(cache=True, error_model="numpy")
def _write_velocity(width, starts, lanes, values, free_velocity, impulses, velocity):  # type: ignore[no-untyped-def]
    if width == 3:
        write_spatial_velocity(starts, lanes, values, free_velocity, impulses, velocity)
    else:
        write_velocity(width, starts, lanes, values, free_velocity, impulses, velocity)


@njit(cache=True, error_model="numpy")
def _sweep(  # type: ignore[no-untyped-def]
    width, count, starts, lanes, values, free_velocity, step_sizes, friction, fixed_bound, partner, impulses
):
    if width == 3:
        sweep_spatial(count, starts, lanes, values, free_velocity, step_sizes, friction, fixed_bound, partner, impulses)
    elif width == 2:
        sweep_planar(count, starts, lanes, values, free_velocity, step_sizes, friction, fixed_bound, partner, impulses)
    else:
        sweep_frictionless(
            count, starts, lanes, values, free_velocity, step_sizes, friction, fixed_bound, partner, impulses
        )


@njit(cache=True, error_model="numpy")
def _solve_blocks(  # type: ignore[no-untyped-def]
    width, count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
):
    """Solve each contact ``count`` times; return whether all contacts were always in usual states."""
    if width == 3:
        n_solved = solve_usual_spatial_blocks(
            count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
        )
        return n_solved == count * len(friction)
    if width == 2:
        solve_planar_blocks(
            count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
        )
    else:
        solve_frictionless_blocks(
            count, relaxation, starts, lanes, values, free_velocity, friction, fixed_bound, partner, impulses
        )
    return True
