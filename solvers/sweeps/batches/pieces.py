"""Sweeps over spatial contacts in batches that the vector units of the processor update simultaneously.

Contacts without a common body do not affect each other's updates. The contacts of a sweep are assigned to batches of
``LANES`` contacts. No two contacts of a batch share a body. If two contacts share a body, the earlier one is in the
earlier batch. Each contact then reads exactly the velocities of a sequential sweep, and the iterates are the same.

A batch is stored as a record. The values of one quantity for all its contacts are adjacent; the quantities are two
pieces of W̃, c, the step sizes, a, μ and the coupling. The loop over a batch has no branches, so that the compiler
vectorises it; indexed data are copied before and after it. Empty lanes hold zeros and use the idle chunk.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.matrices.pieces import Pieces
from ...iteration.momentum import extrapolate, momentum_after
from .lanes import LANES, gather_chunks, scatter_chunks

MIN_FILL = 0.75
"""Smallest share of used lanes for which batches save time."""


class Batches(NamedTuple):
    """The position (batch · LANES + lane) of each block, shape (n_blocks,), and the number of batches."""

    positions: Any
    n_batches: int


def assign_batches(pieces: Pieces) -> Batches:
    """Assign each block to a lane of a batch."""
    positions, n_batches = _assign_lanes(pieces.chunks, pieces.n_chunks)
    return Batches(positions, int(n_batches))


def batch_arguments(
    pieces: Pieces, batches: Batches, free_velocity: FloatArray, laws: tuple[Any, ...], coupling: FloatArray
) -> tuple[Any, ...]:
    """Return the constant arguments of ``sweep_batches``: axes of a chunk, bodies of the contacts, and the records.

    Args:
        pieces: W̃, two pieces of width 3 per block.
        batches: the batch and lane of each block.
        free_velocity: c [m/s], padded and flat, shape (3 · n_blocks,).
        laws: step sizes [kg] of N and T of each block, flat, shape (2 · n_blocks,); μ and a [N s], shape (n_blocks,).
        coupling: G_T1N and G_T2N [1/kg] of each block, flat, shape (2 · n_blocks,).
    """
    arrays: tuple[Any, ...] = (pieces.chunks, pieces.values, pieces.n_chunks, *batches, free_velocity, *laws, coupling)
    return tuple(np.arange(pieces.length, dtype=np.uint64)), *_pack(*arrays)


def slots_in_batches(positions: Any) -> IntArray:
    """Return the positions of Λ_N, Λ_T1 and Λ_T2 of each block for ``sweep_batches``, shape (3 · n_blocks,).

    A batch holds Λ_N of all its contacts, then Λ_T1, then Λ_T2.
    """
    normal = 2 * LANES * (positions // LANES) + positions
    slots: IntArray = (normal[:, None] + LANES * np.arange(3)).reshape(-1)
    return slots


@njit(cache=True)
def _assign_lanes(chunks, idle):  # type: ignore[no-untyped-def]
    """Return the position of each block, and the number of batches."""
    one, two, lanes, n_blocks = uint64(1), uint64(2), uint64(LANES), uint64(len(chunks) // 2)
    positions = np.empty(n_blocks, dtype=np.int64)
    next_batch = np.zeros(idle + 1, dtype=np.uint64)  # first batch after the last one that touches each chunk
    n_used = np.zeros(n_blocks + one, dtype=np.uint64)  # lanes in use
    first_open = n_batches = uint64(0)
    for block in range(n_blocks):
        a, b = uint64(chunks[two * block]), uint64(chunks[two * block + one])
        batch = max(first_open, max(next_batch[a], next_batch[b]))
        while n_used[batch] == lanes:
            batch += one
        positions[block] = lanes * batch + n_used[batch]
        n_used[batch] += one
        next_batch[a] = next_batch[b] = batch + one
        next_batch[uint64(idle)] = 0  # batches may touch the idle chunk several times
        n_batches = max(n_batches, batch + one)
        while n_used[first_open] == lanes:
            first_open += one
    return positions, n_batches


@njit(cache=True)
def _pack(chunks, values, idle, positions, n_batches, free_velocity, step_sizes, friction, fixed_bound, coupling):  # type: ignore[no-untyped-def]
    """Return the first coordinates of bodies, flat from shape (n_batches, 2, LANES), and the records, flat."""
    length = values.shape[2]
    pieces, entries_per_contact = values.reshape(-1), uint64(6 * length)
    block_at = np.zeros(n_batches * LANES, dtype=np.uint64)
    n_used = np.zeros(n_batches, dtype=np.uint64)
    for block in range(len(positions)):
        block_at[positions[block]] = block
        n_used[positions[block] // LANES] += 1
    bodies = np.full(n_batches * 2 * LANES, idle * length, dtype=np.uint64)
    records = np.zeros(n_batches * (6 * length + 9) * LANES)
    one, two, three, lanes, first_entry = uint64(1), uint64(2), uint64(3), uint64(LANES), uint64(0)
    for batch in range(uint64(n_batches)):
        for k in range(entries_per_contact):
            for lane in range(n_used[batch]):
                records[first_entry + lane] = pieces[entries_per_contact * block_at[batch * lanes + lane] + k]
            first_entry += lanes
        for lane in range(n_used[batch]):
            block, law_entry = block_at[batch * lanes + lane], first_entry + lane
            bodies[two * batch * lanes + lane] = chunks[two * block] * length
            bodies[(two * batch + one) * lanes + lane] = chunks[two * block + one] * length
            for k in range(three):
                records[law_entry + k * lanes] = free_velocity[three * block + k]
            for k in range(two):
                records[law_entry + (three + k) * lanes] = step_sizes[two * block + k]
                records[law_entry + (uint64(7) + k) * lanes] = coupling[two * block + k]
            records[law_entry + uint64(5) * lanes] = fixed_bound[block]
            records[law_entry + uint64(6) * lanes] = friction[block]
        first_entry += uint64(9) * lanes
    return bodies, records


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_batches(  # type: ignore[no-untyped-def]
    count, axes, bodies, records, impulses, scaled_velocity, change, previous_velocity, momentum, delay, sweeps, beta
):
    """Do ``count`` sweeps, and return the β of the sweep after them.

    ``impulses`` is Λ in the order of ``slots_in_batches``, and ``scaled_velocity`` is v = W̃ Λ, with an idle chunk last.
    ``change`` is the change of Λ in the previous sweep. With momentum, ``previous_velocity`` is the v at which that
    sweep began. ``beta`` is the β of the next sweep. ``momentum`` and ``delay`` are those of ``MomentumState`` after
    ``sweeps`` sweeps.
    """
    two, three, lanes, length = uint64(2), uint64(3), uint64(LANES), uint64(len(axes))
    row, n_batches = lanes * length, uint64(len(bodies)) // (two * lanes)
    v_before, v_after, turn = np.empty(two * row), np.empty(two * row), np.empty(lanes)
    for _ in range(count):
        if momentum > 0.0:
            extrapolate(scaled_velocity, previous_velocity, beta, 0, len(scaled_velocity))
        turn[:] = 0.0
        for batch in range(n_batches):
            pair = two * lanes * batch
            gather_chunks(axes, bodies, pair, scaled_velocity, v_before)
            begin, first_entry = (uint64(6) * row + uint64(9) * lanes) * batch, three * lanes * batch
            update_batch(axes, records, begin, impulses, change, first_entry, beta, turn, v_before, v_after)
            scatter_chunks(axes, bodies, pair, v_after, scaled_velocity)
        sweeps += 1
        beta = 0.0 if turn.sum() > 0.0 else momentum_after(sweeps, momentum, delay)
    return beta


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_batch(axes, records, begin, impulses, change, first_entry, beta, turn, v_before, v_after):  # type: ignore[no-untyped-def]
    """Update the impulses of one batch.

    Its record begins at ``begin`` of ``records``, and its Λ at ``first_entry`` of ``impulses``. Read v of its bodies
    from ``v_before``, and write it to ``v_after``. Add (Λ̂ − Λ⁺)·(Λ⁺ − Λ) to ``turn``, where Λ becomes Λ⁺ and Λ̂ = Λ + β
    ``change``.
    """
    two, lanes, length = uint64(2), uint64(LANES), uint64(len(axes))
    row = lanes * length
    law = begin + uint64(6) * row
    for lane in range(lanes):
        a, c, n = begin + lane, law + lane, first_entry + lane
        b, t1, t2 = a + uint64(3) * row, n + lanes, n + two * lanes
        normal, first, second = records[c], records[c + lanes], records[c + two * lanes]
        normal_b, first_b, second_b = 0.0, 0.0, 0.0
        for x in range(length):
            v_a, v_b = v_before[lanes * x + lane], v_before[lanes * (length + x) + lane]
            normal += records[a + lanes * x] * v_a
            first += records[a + row + lanes * x] * v_a
            second += records[a + two * row + lanes * x] * v_a
            normal_b += records[b + lanes * x] * v_b
            first_b += records[b + row + lanes * x] * v_b
            second_b += records[b + two * row + lanes * x] * v_b
        ahead_n, ahead_t1, ahead_t2 = beta * change[n], beta * change[t1], beta * change[t2]
        old_n, old_t1, old_t2 = impulses[n] + ahead_n, impulses[t1] + ahead_t1, impulses[t2] + ahead_t2
        step_size_n, step_size_t = records[c + uint64(3) * lanes], records[c + uint64(4) * lanes]
        new_n = max(old_n - step_size_n * (normal + normal_b), 0.0)
        dn = new_n - old_n
        new_t1 = old_t1 - step_size_t * (first + first_b + records[c + uint64(7) * lanes] * dn)
        new_t2 = old_t2 - step_size_t * (second + second_b + records[c + uint64(8) * lanes] * dn)
        bound = records[c + uint64(5) * lanes] + records[c + uint64(6) * lanes] * new_n
        squared = new_t1 * new_t1 + new_t2 * new_t2
        scale = bound / np.sqrt(squared) if squared > bound * bound else 1.0
        new_t1 *= scale
        new_t2 *= scale
        step_n, step_t1, step_t2 = new_n - impulses[n], new_t1 - impulses[t1], new_t2 - impulses[t2]
        turn[lane] += (ahead_n - step_n) * step_n + (ahead_t1 - step_t1) * step_t1 + (ahead_t2 - step_t2) * step_t2
        change[n], change[t1], change[t2] = step_n, step_t1, step_t2
        impulses[n], impulses[t1], impulses[t2] = new_n, new_t1, new_t2
        dt1, dt2 = new_t1 - old_t1, new_t2 - old_t2
        for x in range(length):
            v_after[lanes * x + lane] = v_before[lanes * x + lane] + (
                records[a + lanes * x] * dn
                + records[a + row + lanes * x] * dt1
                + records[a + two * row + lanes * x] * dt2
            )
            v_after[lanes * (length + x) + lane] = v_before[lanes * (length + x) + lane] + (
                records[b + lanes * x] * dn
                + records[b + row + lanes * x] * dt1
                + records[b + two * row + lanes * x] * dt2
            )
