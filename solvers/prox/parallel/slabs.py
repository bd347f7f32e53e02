"""Slabs of contacts in two colours, for sweeps in several threads.

The slabs of one colour share no movable body, so that threads may sweep them simultaneously. Bodies are stored in the
order of the search, so that the bodies of a slab are adjacent in memory.

A breadth-first search over the bodies, from a body far from the others, assigns levels: a contact touches one level or
two successive ones (the rooted level structure of Cuthill & McKee, 1969; the start is found as by George & Liu, 1979).
The level of a contact is the lower one of its bodies. A slab holds the contacts of successive levels. Its contacts
touch bodies of these levels and of the next one, so that slabs that are not neighbours share no movable body. Even
slabs are of the first colour, odd slabs of the second one.

Components of the graph that share no contact get separate levels, one component after the other.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from ....problems.arrays import IntArray
from ....problems.contact.matrices.pieces import Pieces
from ...sweeps.batches.lanes import LANES

MIN_SLAB = 256
"""Minimum number of contacts of each slab except the last; batches of smaller slabs have more empty lanes."""

OPEN_BATCHES = 63
"""Number of batches that are filled at the same time: one for each bit of an integer except the last one."""

EXPONENT, BIAS = 52, 1023
"""First bit of the exponent of a double, and the number that is added to the exponent."""


class Slabs(NamedTuple):
    """Slabs of contacts, those of the first colour first.

    Attributes:
        positions: position of each contact, batch · LANES + lane, shape (n_contacts,).
        first_batch: first batch of each slab, then the number of batches, shape (n_slabs + 1,).
        first_slab: 0, the first slab of the second colour, and the number of slabs.
        bodies: the bodies with contacts in the order of the search, shape (n_touched,).
        chunks: positions in ``bodies`` of both bodies of each contact, or ``n_touched`` for the idle chunk, shape
            (2 · n_contacts,).
    """

    positions: Any
    first_batch: IntArray
    first_slab: IntArray
    bodies: IntArray
    chunks: IntArray

    @property
    def n_batches(self) -> int:
        """Number of batches."""
        return int(self.first_batch[-1])

    def largest_speedup(self, threads: int) -> float:
        """Return an upper bound on the speedup of a sweep by several threads.

        A colour takes at least as long as its largest slab, and at least as long as an equal share of its batches for
        each thread.
        """
        batch_counts = np.diff(self.first_batch)
        colours = batch_counts[: self.first_slab[1]], batch_counts[self.first_slab[1] :]
        slowest = sum(max(colour.max(initial=0), colour.sum() / threads) for colour in colours)
        return float(batch_counts.sum() / slowest) if slowest > 0.0 else 1.0


def divide_into_slabs(pieces: Pieces) -> Slabs:
    """Return the slabs of the contacts of ``pieces``, which hold two chunks (one per body) for each contact.

    The idle chunk stands for a fixed body.
    """
    bodies, chunks, levels = _search_breadth_first(pieces.chunks, pieces.n_chunks)
    members = _sort_by_first_body(chunks, len(bodies))
    begins = _find_slab_starts(chunks, levels, members, MIN_SLAB)
    positions, first_batch = _fill_batches(chunks, len(bodies), members, begins)
    n_slabs = len(begins) - 1
    first_slab = np.array([0, n_slabs - n_slabs // 2, n_slabs])
    return Slabs(positions, first_batch, first_slab, bodies, chunks)


@njit(cache=True)
def _neighbours(chunks, idle):  # type: ignore[no-untyped-def]
    """Return the neighbours of all bodies in one array, after the index of the first neighbour of each body.

    The neighbours of a body are ``neighbours[starts[body]:starts[body + 1]]``.
    """
    one, starts = uint64(1), np.zeros(idle + 2, dtype=np.int32)
    for side in range(uint64(len(chunks))):
        if chunks[side] != idle and chunks[side ^ one] != idle:
            starts[uint64(chunks[side] + 2)] += 1
    for body in range(idle):
        starts[body + 2] += starts[body + 1]
    neighbours = np.empty(starts[idle + 1], dtype=np.int32)
    for side in range(uint64(len(chunks))):
        body, other = chunks[side], chunks[side ^ one]
        if body != idle and other != idle:
            place = uint64(body + 1)
            neighbours[uint64(starts[place])] = other
            starts[place] += 1
    return starts, neighbours


@njit(cache=True)
def _search_breadth_first(chunks, idle):  # type: ignore[no-untyped-def]
    """Assign levels by a breadth-first search; return bodies and chunks as in ``Slabs``, and the levels of the bodies.

    The search of a component starts at the body that an earlier search finds last.
    """
    starts, neighbours = _neighbours(chunks, idle)
    levels, queue = np.full(idle + 1, -1, dtype=np.int32), np.empty(idle + 1, dtype=np.int32)
    levels[idle] = n_visited = level = 0
    for side in range(uint64(len(chunks))):
        root = chunks[side]
        if levels[uint64(root)] >= 0:
            continue
        end = _visit(starts, neighbours, root, n_visited, level, levels, queue)
        farthest = np.int64(queue[end - 1])
        for k in range(n_visited, end):
            levels[queue[k]] = -1
        n_visited = _visit(starts, neighbours, farthest, n_visited, level, levels, queue)
        level = int(levels[queue[n_visited - 1]]) + 1
    bodies, positions = queue[:n_visited].astype(np.int64), np.full(idle + 1, n_visited, dtype=np.int64)
    for k in range(n_visited):
        positions[bodies[k]] = k
    places = np.empty(len(chunks), dtype=np.int64)
    for side in range(uint64(len(chunks))):
        places[side] = positions[uint64(chunks[side])]
    return bodies, places, levels[bodies]


@njit(cache=True)
def _visit(starts, neighbours, root, begin, level, levels, queue):  # type: ignore[no-untyped-def]
    """Write the levels of all bodies that are connected to ``root``, and queue them; return the end of the queue.

    Each neighbour is written after the end of the queue, which grows if it is new: a branch would often be
    mispredicted.
    """
    one = uint64(1)
    levels[root], queue[begin] = level, root
    queue_begin, queue_end = uint64(begin), uint64(begin + 1)
    while queue_begin < queue_end:
        body = uint64(queue[queue_begin])
        next_level = levels[body] + 1
        for k in range(uint64(starts[body]), uint64(starts[body + one])):
            other = uint64(neighbours[k])
            queue[queue_end] = other
            level_before = levels[other]
            levels[other] = next_level if level_before < 0 else level_before
            queue_end += uint64(level_before < 0)
        queue_begin += one
    return np.int64(queue_end)


@njit(cache=True)
def _sort_by_first_body(chunks, n_bodies):  # type: ignore[no-untyped-def]
    """Return the contacts in the order of the first of their bodies; contacts of the same body keep their order."""
    one, two, n_contacts = uint64(1), uint64(2), uint64(len(chunks)) // uint64(2)
    begins, members = np.zeros(n_bodies + 2, dtype=np.int32), np.empty(n_contacts, dtype=np.int32)
    for contact in range(n_contacts):
        begins[uint64(min(chunks[two * contact], chunks[two * contact + one]) + 1)] += 1  # the idle chunk is last
    for body in range(n_bodies + 1):
        begins[body + 1] += begins[body]
    for contact in range(n_contacts):
        body = uint64(min(chunks[two * contact], chunks[two * contact + one]))
        members[uint64(begins[body])] = contact
        begins[body] += 1
    return members


@njit(cache=True)
def _find_slab_starts(chunks, levels, members, min_size):  # type: ignore[no-untyped-def]
    """Return the position in ``members`` of the first contact of each slab, then the number of contacts."""
    begins, n_slabs = np.zeros(len(members) // min_size + 2, dtype=np.int64), 1
    for k in range(1, len(members)):
        previous, contact = members[k - 1], members[k]
        body = min(chunks[2 * contact], chunks[2 * contact + 1])
        if k - begins[n_slabs - 1] < min_size or body == len(levels):
            continue
        if levels[body] > levels[min(chunks[2 * previous], chunks[2 * previous + 1])]:
            begins[n_slabs] = k
            n_slabs += 1
    begins[n_slabs] = len(members)
    return begins[: n_slabs + 1]


@njit(cache=True)
def _fill_batches(chunks, idle, members, begins):  # type: ignore[no-untyped-def]
    """Return the position of each contact and the first batch of each slab.

    Each contact of a slab, in order, is assigned to the first open batch that has an empty lane and does not touch a
    body of the contact. ``full`` and ``touching`` have a bit for each open batch: for full ones, and for those that
    touch a body. The lowest bit that is not set is a power of two. Its number is the exponent of this power, which is
    read from a double.
    """
    positions, first_batch = np.empty(len(members), dtype=np.int64), np.empty(len(begins), dtype=np.int64)
    touching, n_lanes_used = np.zeros(idle + 1, dtype=np.uint64), np.zeros(OPEN_BATCHES, dtype=np.int64)
    n_batches, n_slabs = 0, len(begins) - 1
    n_even, zero, one, two = n_slabs - n_slabs // 2, uint64(0), uint64(1), uint64(2)
    for slab in range(n_slabs):
        position = 2 * slab if slab < n_even else 2 * (slab - n_even) + 1
        first_batch[slab] = first_open = n_batches
        first_member, full = begins[position], zero
        n_lanes_used[:] = 0
        for k in range(begins[position], begins[position + 1]):
            contact = uint64(members[k])
            a, b = uint64(chunks[two * contact]), uint64(chunks[two * contact + one])
            unavailable = full | touching[a] | touching[b]
            bit = ~unavailable & (unavailable + one)
            batch = int((np.float64(bit).view(np.int64) >> EXPONENT) - BIAS)
            if batch == OPEN_BATCHES:  # close all open batches
                _forget_bodies(chunks, members, first_member, k, touching)
                first_member, first_open, full, batch, bit = k, n_batches, zero, 0, one
                n_lanes_used[:] = 0
            touching[a] |= bit
            touching[b] |= bit
            touching[idle] = zero  # batches may touch a fixed body several times
            lane = n_lanes_used[batch]
            n_lanes_used[batch] = lane + 1
            full |= bit if lane + 1 == LANES else zero
            positions[contact] = LANES * (first_open + batch) + lane
            n_batches = max(n_batches, first_open + batch + 1)
        _forget_bodies(chunks, members, first_member, begins[position + 1], touching)
    first_batch[n_slabs] = n_batches
    return positions, first_batch


@njit(cache=True)
def _forget_bodies(chunks, members, begin, end, touching):  # type: ignore[no-untyped-def]
    """Clear the bits of all bodies of some members."""
    one, two = uint64(1), uint64(2)
    for k in range(begin, end):
        contact = uint64(members[k])
        touching[uint64(chunks[two * contact])] = touching[uint64(chunks[two * contact + one])] = uint64(0)
