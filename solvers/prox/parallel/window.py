"""Kernels of windows: sweeps over slabs and checks of the residual, which several threads run in one call.

A sweep is a sequence of three stages: the momentum of v, the even slabs, and the odd slabs. A check is one stage, in
which each slab writes its largest violation and a copy of its impulses. The window ends with a stage that writes Λ over
rows, or ξ. A task of a stage (a piece of v, or a slab) writes numbers that no other task of the stage reads or writes.
A stage begins when the previous one is complete.

The thread that claims a task first does it. The arithmetic of a task does not depend on the thread, and sums over tasks
are taken in the order of the tasks. The result is therefore identical for any number of threads. Each thread begins
with its own share of a stage, whose data are then in the cache of its core: v is in the order of the levels, so that
the shares of all stages concern the same bodies. Other threads do the tasks of a late thread.

A late thread passes through the completed stages, whose tasks it cannot claim. It takes the same decisions as the
others, because the violations of a check are kept until the window ends. β of a completed sweep may be overwritten, but
only a thread that finds no tasks of the next sweep can read it then.
"""

import numpy as np
from numba import njit

from ...iteration.momentum import extrapolate, momentum_after
from ...sweeps.batches.ball_kernels import SCRATCH, largest_of_lanes, write_rows
from ...sweeps.batches.lanes import BALL_LENGTH, LANES
from .atomic import add, swap_if_equal, wait_for
from .ball_tasks import raise_to_violations, update_ball_batch, write_ball_velocities
from .piece_tasks import update_pieces, write_piece_velocities
from .team import joins_call, leave_call

PIECE_LENGTH = 512
"""Number of entries of v, 4 kB, that one task extrapolates."""

MAX_CHECKS = 20
"""Maximum number of checks in a window."""


@njit(cache=True, nogil=True)
def run_windows(thread, threads, calls, states, *arguments):  # type: ignore[no-untyped-def]
    """Do the part of the calling thread (number 0) in one window, or of another thread in each window; see ``Team``."""
    result = 0.0, 0, 0
    while thread == 0 or joins_call(calls, states, thread):
        result = _run_window(thread, threads, *arguments)
        if thread == 0:
            break
        leave_call(states, thread)
    return result


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _run_window(  # type: ignore[no-untyped-def]
    thread, threads, plan, counts, momenta, limits, slabs, pieces, balls, arrays, checks, turns, claims, n_completed
):
    """Do the share of one thread in a window; return β of the next sweep, the number of checks, and the best copy.

    The window does ``counts[k]`` sweeps before check k, and ends after the first check whose residual is not between
    the limits. Without checks it does ``counts[0]`` sweeps, and then writes ξ.

    Args:
        thread: number of the thread.
        threads: number of threads.
        plan: numbers of earlier sweeps, of earlier stages that are no part of a sweep, and of checks.
        counts: number of sweeps before each check.
        momenta: the bound and delay of ``MomentumState``, and β of the next sweep.
        limits: the tolerance, the residual from which the sweeps diverge, and the scale of the residual.
        slabs: the first task of each stage of a sweep, and the first batch of each slab.
        pieces: the constant data of batches of pieces, or None.
        balls: the constant data of batches of balls, or None.
        arrays: Λ (P of balls), v, the last change of Λ, v before the last sweep, and ξ.
        checks: the weights of violations, the slot of each row, Λ over rows, the largest squared violation of each
            slab in each check, the residuals, and two copies of P. The best copy has the lowest residual before that of
            the last check.
        turns: the part of each slab in the product that is positive if the iterates turn back
            (``iteration.momentum``), for even and odd sweeps.
        claims: how often each task was claimed: those of a sweep, and then those of other stages.
        n_completed: number of completed tasks in the window.
    """
    sweeps, passes, n_checks = plan[0], plan[1], plan[2]
    momentum, delay, beta = momenta[0], momenta[1], momenta[2]
    squares, residuals, copies = checks[3], checks[4], checks[5]
    n_sweep_tasks, n_slabs, n_required = slabs[0][-1], turns.shape[1], 0
    check, best, best_residual, completed = 0, 0, np.inf, 0
    while True:
        for sweep in range(sweeps, sweeps + counts[check]):
            state = beta, turns[sweep % 2], claims, n_completed, n_required
            _sweep(thread, threads, sweep, slabs, pieces, balls, arrays, *state)
            n_required += n_sweep_tasks
            wait_for(n_completed, 0, n_required)
            beta = 0.0 if turns[sweep % 2].sum() > 0.0 else momentum_after(sweep + 1, momentum, delay)
        if n_checks == 0:
            completed = _write_xi(thread, threads, passes, slabs, pieces, balls, arrays, claims)
            break
        sweeps += counts[check]
        is_last = check + 1 == n_checks
        results = checks[0], squares[check], copies[1 - best], not is_last
        if balls is not None:
            completed = _write_violations(thread, threads, passes, slabs, balls, arrays, *results, claims)
        add(n_completed, 0, completed)
        passes, n_required = passes + 1, n_required + n_slabs
        wait_for(n_completed, 0, n_required)
        violation = np.sqrt(largest_of_lanes(squares[check]))
        residual = violation if violation == 0.0 else violation / limits[2]
        if thread == 0:
            residuals[check] = residual
        check += 1
        if is_last or not limits[0] < residual < limits[1]:
            if balls is not None:
                completed = _write_rows(thread, threads, passes, slabs, balls, arrays, checks, claims)
            break
        if residual < best_residual:
            best_residual, best = residual, 1 - best
    add(n_completed, 0, completed)
    wait_for(n_completed, 0, n_required + n_slabs)
    return beta, check, best


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _sweep(  # type: ignore[no-untyped-def]
    thread, threads, sweep, slabs, pieces, balls, arrays, beta, turns, claims, n_completed, n_required
):
    """Do the share of one thread in a sweep with momentum ``beta``, which begins after ``n_required`` tasks."""
    stages, first_batch = slabs
    impulses, scaled_velocity, change, previous_velocity, _ = arrays
    length = BALL_LENGTH
    if pieces is not None:
        length = len(pieces[0])
    work, second_work, turn = np.empty(2 * LANES * length), np.empty(2 * LANES * length), np.empty(LANES)
    for stage in range(len(stages) - 1):
        begin, size, completed = stages[stage], stages[stage + 1] - stages[stage], 0
        wait_for(n_completed, 0, n_required)
        for k in range(threads):
            share = (thread + k) % threads
            for task in range(begin + size * share // threads, begin + size * (share + 1) // threads):
                if claims[task] != sweep or not swap_if_equal(claims, task, sweep, sweep + 1):
                    continue
                completed += 1
                if stage == 0:
                    first, last = PIECE_LENGTH * task, min(PIECE_LENGTH * (task + 1), len(scaled_velocity))
                    extrapolate(scaled_velocity, previous_velocity, beta, first, last)
                    continue
                slab = task - stages[1]
                turn[:] = 0.0
                for batch in range(first_batch[slab], first_batch[slab + 1]):
                    if balls is not None:
                        update_ball_batch(
                            balls, batch, scaled_velocity, impulses, change, beta, turn, work, second_work
                        )
                    if pieces is not None:
                        update_pieces(pieces, batch, scaled_velocity, impulses, change, beta, turn, work, second_work)
                turns[slab] = turn.sum()
        if completed:
            add(n_completed, 0, completed)
        n_required += size


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _write_xi(thread, threads, passes, slabs, pieces, balls, arrays, claims):  # type: ignore[no-untyped-def]
    """Do the share of one thread in ξ, and return the number of completed tasks."""
    stages, first_batch = slabs
    _, scaled_velocity, _, _, velocity = arrays
    length, completed = BALL_LENGTH, 0
    if pieces is not None:
        length = len(pieces[0])
    work, n_slabs = np.empty(2 * LANES * length), len(first_batch) - 1
    for k in range(threads):
        share = (thread + k) % threads
        for position in range(n_slabs * share // threads, n_slabs * (share + 1) // threads):
            slab = _claim(position, stages, passes, claims)
            if slab >= 0:
                for batch in range(first_batch[slab], first_batch[slab + 1]):
                    if balls is not None:
                        write_ball_velocities(balls, batch, scaled_velocity, work, velocity)
                    if pieces is not None:
                        write_piece_velocities(pieces, batch, scaled_velocity, work, velocity)
                completed += 1
    return completed


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _write_violations(  # type: ignore[no-untyped-def]
    thread, threads, passes, slabs, balls, arrays, weights, squares, copy, has_copy, claims
):
    """Do the share of one thread in the violations, and in a copy of P if ``has_copy``; see ``_write_xi``."""
    stages, first_batch = slabs
    impulses, scaled_velocity, _, _, _ = arrays
    moves, scratch, largest = np.empty(6 * LANES), np.empty(SCRATCH * LANES), np.empty(LANES)
    n_slabs, completed = len(squares), 0
    for k in range(threads):
        share = (thread + k) % threads
        for position in range(n_slabs * share // threads, n_slabs * (share + 1) // threads):
            slab = _claim(position, stages, passes, claims)
            if slab >= 0:
                largest[:] = 0.0
                for batch in range(first_batch[slab], first_batch[slab + 1]):
                    raise_to_violations(balls, batch, scaled_velocity, impulses, weights, moves, scratch, largest)
                squares[slab] = largest_of_lanes(largest)
                if has_copy:
                    for entry in range(3 * LANES * first_batch[slab], 3 * LANES * first_batch[slab + 1]):
                        copy[entry] = impulses[entry]
                completed += 1
    return completed


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _write_rows(thread, threads, passes, slabs, balls, arrays, checks, claims):  # type: ignore[no-untyped-def]
    """Do the share of one thread in Λ over rows; see ``_write_xi``."""
    stages, first_batch = slabs
    _, slots, rows, _, _, _ = checks
    n_slabs, n_contacts, completed = len(first_batch) - 1, len(slots) // 3, 0
    for k in range(threads):
        share = (thread + k) % threads
        for position in range(n_slabs * share // threads, n_slabs * (share + 1) // threads):
            if _claim(position, stages, passes, claims) >= 0:
                begin, end = n_contacts * position // n_slabs, n_contacts * (position + 1) // n_slabs
                write_rows(balls.normals, balls.friction, slots, arrays[0], begin, end, rows)
                completed += 1
    return completed


@njit(inline="always")
def _claim(position, stages, passes, claims):  # type: ignore[no-untyped-def]
    """Claim the slab at a position in the order of the levels, in which even and odd slabs alternate.

    Return the slab, or −1 if its task in the stage that ``passes`` others precede is claimed already.
    """
    task, n_even = stages[-1] + position, stages[2] - stages[1]
    if claims[task] == passes and swap_if_equal(claims, task, passes, passes + 1):
        return position // 2 + n_even * (position % 2)
    return -1
