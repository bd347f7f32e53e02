"""Sweeps over spatial contacts in batches that the processor's vector units update at once.

Contacts that share no body do not see each other's updates. The contacts of a sweep are dealt into batches of ``LANES``
such that no two of a batch share a body, and that of any two which do, the earlier one is in the earlier batch: each
contact then reads exactly the velocities that it would read in a sweep one by one, and the iterates are the same.

A batch is kept as a record: for each number of a contact (its two pieces of W̃, c, step sizes, a, μ and coupling) the
values of all its contacts side by side. The loop over a batch has no branches, and the compiler makes it vector
instructions; what it reads and writes through indices is copied before and after. Lanes left empty hold zeros and touch
the idle chunk.
"""

from typing import Any

import numpy as np
from numba import njit, uint64

from ...problems.laws import FloatArray
from ...problems.pieces import Pieces

LANES = 16
"""Contacts in a batch: the fewest for which compilers make vector instructions of a loop of known length."""

FULLNESS = 0.75
"""Least share of lanes in use for which batches pay."""


def deal_into_batches(pieces: Pieces) -> tuple[Any, int]:
    """Return the place (batch · LANES + lane) of each block, shape (n_blocks,), and the number of batches."""
    places, n_batches = _deal(pieces.chunks, pieces.n_chunks)
    return places, int(n_batches)


def batch_arguments(
    pieces: Pieces, places: Any, n_batches: int, free: FloatArray, laws: tuple[Any, ...], coupling: FloatArray
) -> tuple[Any, ...]:
    """Return what ``sweep_batches`` reads: axes of a chunk, bodies and places of the contacts, and the records.

    Args:
        pieces: W̃ in pairs of pieces of width 3.
        places: place of each block.
        n_batches: number of batches.
        free: c, padded and flat.
        laws: step sizes (N, T in turn), μ, a.
        coupling: G_T1N and G_T2N of each block, in turn.
    """
    sizes, friction, fixed = laws
    bodies, records = _pack(
        pieces.chunks, pieces.values, pieces.n_chunks, places, n_batches, free, sizes, friction, fixed, coupling
    )
    return tuple(np.arange(pieces.length, dtype=np.uint64)), bodies, places.astype(np.uint64), records


@njit(cache=True)
def _deal(chunks, idle):  # type: ignore[no-untyped-def]
    n_blocks = len(chunks) // 2
    places = np.empty(n_blocks, dtype=np.int64)
    next_batch = np.zeros(idle + 1, dtype=np.int64)  # first batch behind the last one that touches each chunk
    used = np.zeros(n_blocks + 1, dtype=np.int64)  # lanes in use
    first_open, n_batches = 0, 0
    for block in range(n_blocks):
        batch = first_open
        for p in (2 * block, 2 * block + 1):
            if chunks[p] != idle:
                batch = max(batch, next_batch[chunks[p]])
        while used[batch] == LANES:
            batch += 1
        places[block] = LANES * batch + used[batch]
        used[batch] += 1
        for p in (2 * block, 2 * block + 1):
            next_batch[chunks[p]] = batch + 1
        n_batches = max(n_batches, batch + 1)
        while used[first_open] == LANES:
            first_open += 1
    return places, n_batches


@njit(cache=True)
def _pack(chunks, values, idle, places, n_batches, free, sizes, friction, fixed, coupling):  # type: ignore[no-untyped-def]
    """Return first coordinate of both bodies of each lane, shape (n_batches, 2, LANES), and the records, flat."""
    length = values.shape[2]
    pieces, numbers = values.reshape(-1), uint64(6 * length)
    block_at = np.zeros(n_batches * LANES, dtype=np.uint64)
    used = np.zeros(n_batches, dtype=np.uint64)
    for block in range(len(places)):
        block_at[places[block]] = block
        used[places[block] // LANES] += 1
    bodies = np.full(n_batches * 2 * LANES, idle * length, dtype=np.uint64)
    records = np.zeros(n_batches * (6 * length + 9) * LANES)
    one, two, three, lanes, at = uint64(1), uint64(2), uint64(3), uint64(LANES), uint64(0)
    for batch in range(uint64(n_batches)):
        for k in range(numbers):
            for lane in range(used[batch]):
                records[at + lane] = pieces[numbers * block_at[batch * lanes + lane] + k]
            at += lanes
        for lane in range(used[batch]):
            block, here = block_at[batch * lanes + lane], at + lane
            bodies[two * batch * lanes + lane] = chunks[two * block] * length
            bodies[(two * batch + one) * lanes + lane] = chunks[two * block + one] * length
            for k in range(three):
                records[here + k * lanes] = free[three * block + k]
            for k in range(two):
                records[here + (three + k) * lanes] = sizes[two * block + k]
                records[here + (uint64(7) + k) * lanes] = coupling[two * block + k]
            records[here + uint64(5) * lanes] = fixed[block]
            records[here + uint64(6) * lanes] = friction[block]
        at += uint64(9) * lanes
    return bodies, records


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def sweep_batches(count, axes, bodies, places, records, impulses, scaled):  # type: ignore[no-untyped-def]
    """Do ``count`` sweeps on Λ, padded and flat, and v = W̃ Λ with an idle chunk behind."""
    one, two, three, lanes, length = uint64(1), uint64(2), uint64(3), uint64(LANES), uint64(len(axes))
    row, n_batches = lanes * length, uint64(len(bodies)) // (two * lanes)
    held = np.zeros(three * lanes * n_batches)
    for block in range(uint64(len(places))):
        at = three * lanes * (places[block] // lanes) + places[block] % lanes
        held[at], held[at + lanes], held[at + two * lanes] = (
            impulses[three * block],
            impulses[three * block + one],
            impulses[three * block + two],
        )
    before, after = np.empty(two * row), np.empty(two * row)
    for _ in range(count):
        for batch in range(n_batches):
            pair = two * lanes * batch
            for lane in range(lanes):
                a, b = bodies[pair + lane], bodies[pair + lanes + lane]
                for x in range(length):
                    before[lanes * x + lane] = scaled[a + x]
                    before[lanes * (length + x) + lane] = scaled[b + x]
            _update(
                axes, records, (uint64(6) * row + uint64(9) * lanes) * batch, held, three * lanes * batch, before, after
            )
            for lane in range(lanes):
                a, b = bodies[pair + lane], bodies[pair + lanes + lane]
                for x in range(length):
                    scaled[a + x] = after[lanes * x + lane]
                    scaled[b + x] = after[lanes * (length + x) + lane]
    for block in range(uint64(len(places))):
        at = three * lanes * (places[block] // lanes) + places[block] % lanes
        impulses[three * block] = held[at]
        impulses[three * block + one] = held[at + lanes]
        impulses[three * block + two] = held[at + two * lanes]


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def _update(axes, records, begin, held, own, before, after):  # type: ignore[no-untyped-def]
    """Update a batch: its record from ``begin`` on, its Λ in ``held`` from ``own`` on, v ``before`` and ``after``."""
    two, lanes, length = uint64(2), uint64(LANES), uint64(len(axes))
    row = lanes * length
    law = begin + uint64(6) * row
    for lane in range(lanes):
        a, c, h = begin + lane, law + lane, own + lane
        b = a + uint64(3) * row
        normal, first, second = records[c], records[c + lanes], records[c + two * lanes]
        normal_b, first_b, second_b = 0.0, 0.0, 0.0
        for x in range(length):
            v_a, v_b = before[lanes * x + lane], before[lanes * (length + x) + lane]
            normal += records[a + lanes * x] * v_a
            first += records[a + row + lanes * x] * v_a
            second += records[a + two * row + lanes * x] * v_a
            normal_b += records[b + lanes * x] * v_b
            first_b += records[b + row + lanes * x] * v_b
            second_b += records[b + two * row + lanes * x] * v_b
        old_n, old_t, old_s = held[h], held[h + lanes], held[h + two * lanes]
        size_n, size_t = records[c + uint64(3) * lanes], records[c + uint64(4) * lanes]
        new = max(old_n - size_n * (normal + normal_b), 0.0)
        dn = new - old_n
        t = old_t - size_t * (first + first_b + records[c + uint64(7) * lanes] * dn)
        s = old_s - size_t * (second + second_b + records[c + uint64(8) * lanes] * dn)
        bound = records[c + uint64(5) * lanes] + records[c + uint64(6) * lanes] * new
        squared = t * t + s * s
        scale = bound / np.sqrt(squared) if squared > bound * bound else 1.0
        t *= scale
        s *= scale
        held[h], held[h + lanes], held[h + two * lanes] = new, t, s
        dt, ds = t - old_t, s - old_s
        for x in range(length):
            after[lanes * x + lane] = before[lanes * x + lane] + (
                records[a + lanes * x] * dn
                + records[a + row + lanes * x] * dt
                + records[a + two * row + lanes * x] * ds
            )
            after[lanes * (length + x) + lane] = before[lanes * (length + x) + lane] + (
                records[b + lanes * x] * dn
                + records[b + row + lanes * x] * dt
                + records[b + two * row + lanes * x] * ds
            )
