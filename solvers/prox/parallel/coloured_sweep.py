"""Gauss–Seidel sweeps colour by colour over the factors, which several threads share.

The contacts of a colour share no movable body, and are swept in the batches of ``sweeps.batches.pieces``. A sweep is a
sequence of stages: the momentum of v, and one stage for each colour. The tasks of a stage (pieces of v, or batches)
write different numbers and read none that another task of the stage writes. A stage begins when the previous one is
complete.

The thread that claims a task first does it. The arithmetic of a task does not depend on the thread, and sums over tasks
are taken in the order of the tasks, so that the result is identical for any number of threads. Each thread begins with
its own share of a stage, whose data are then in the cache of its core. Other threads do the tasks of a late thread.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, uint64

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.blocks import BlockLayout
from ....problems.contact.matrices.pieces import Pieces
from ....problems.contact.problem import ContactProblem
from ...iteration.momentum import MomentumState, momentum_after
from ...sweeps.batches.pieces import LANES, Batches, batch_arguments, slots_in_batches, update_batch
from ...sweeps.factors import own_coupling
from .atomic import add, swap_if_equal, wait_for
from .colouring import colour_contacts, order_by_colour
from .pairs import in_pairs
from .team import Team

PIECE_LENGTH = 512
"""Length of the pieces of v that tasks extrapolate, 4 kB."""

MIN_CONTACTS_PER_THREAD = 250
"""Minimum number of contacts per colour and thread, which take about 8 µs; with fewer, waiting costs more time than
another thread saves."""


@dataclass(frozen=True, eq=False)
class ColouredSweep:
    """The constant data of a sweep.

    Attributes:
        layout: the padded blocks.
        pieces: W̃ in pairs of pieces, of width 3.
        batches: the constant arguments of a sweep; see ``batch_arguments``.
        first_batch: first batch of each colour, then the number of batches, shape (n_colours + 1,).
        slots: position of each entry of padded Λ in the order of the batches.
        threads: number of threads, fewer than requested if the colours are small.
    """

    layout: BlockLayout
    pieces: Pieces
    batches: tuple[Any, ...]
    first_batch: IntArray
    slots: IntArray
    threads: int

    @staticmethod
    def over(problem: ContactProblem, sizes: FloatArray, threads: int) -> "ColouredSweep":
        """Return the sweep of a problem with factors whose contacts touch at most two bodies each.

        ``sizes`` are the step sizes [kg] of ``step_sizes``, shape (n_blocks, 2); ``threads`` is the largest number of
        threads.
        """
        layout, pieces = problem.layout, in_pairs(problem.factor_pieces())
        places, first_batch = order_by_colour(colour_contacts(pieces), LANES)
        free = np.zeros((layout.n_blocks, 3))
        free[:, : layout.width] = layout.pad(problem.free_velocity)
        laws = sizes.reshape(-1), layout.friction_coefficient, layout.fixed_bound
        coupling = own_coupling(pieces.starts, pieces.values).reshape(-1)
        batches = Batches(places, int(first_batch[-1]))
        arguments = batch_arguments(pieces, batches, free.reshape(-1), laws, coupling)
        slots = slots_in_batches(places).reshape(-1, 3)[:, : layout.width].reshape(-1)
        useful = layout.n_blocks // (MIN_CONTACTS_PER_THREAD * max(len(first_batch) - 1, 1))
        return ColouredSweep(layout, pieces, arguments, first_batch, slots, max(1, min(threads, useful)))

    @property
    def n_colours(self) -> int:
        """Number of colours."""
        return len(self.first_batch) - 1

    @property
    def n_batches(self) -> int:
        """Number of batches."""
        return int(self.first_batch[-1])


class ColouredIterates(MomentumState):
    """Λ, in the order of the batches, and v = W̃ Λ of an iteration with momentum β; ``start`` has shape (n_rows,)."""

    def __init__(self, sweep: ColouredSweep, start: FloatArray, momentum: float, delay: float = 0.0) -> None:
        super().__init__(momentum, delay)
        self._sweep, pieces, n_lanes = sweep, sweep.pieces, LANES * sweep.n_batches
        padded = np.zeros((pieces.n_blocks, 3))
        padded[:, : sweep.layout.width] = sweep.layout.pad(start)
        self._scaled = np.append(pieces.times(padded), np.zeros(pieces.length))  # the idle chunk is last
        self._before = self._scaled.copy()
        self._held, self._change, self._velocity = np.zeros((3, 3 * n_lanes))
        self._held[sweep.slots] = padded[:, : sweep.layout.width].reshape(-1)
        n_pieces = -(-len(self._scaled) // PIECE_LENGTH) if momentum > 0.0 else 0
        self._stages = np.concatenate([[0], n_pieces + sweep.first_batch])
        n_tasks = int(self._stages[-1]) + sweep.n_batches  # ξ of each batch comes last
        self._claims, self._done = np.zeros(n_tasks, dtype=np.int64), np.zeros(1, dtype=np.int64)
        self._turns = np.zeros((2, sweep.n_batches))
        self._windows = 0
        self._is_measured, self._team = False, Team()

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, and compute ξ."""
        own = self._sweep
        self._done[0] = 0
        self._present = self._team.run(
            own.threads if count else 1,
            _run_window,
            (self._sweeps, self._windows),
            count,
            self._stages,
            *own.batches,
            (self._held, self._scaled, self._change, self._before, self._velocity),
            (self._momentum, self._delay, self._present),
            self._turns,
            self._claims,
            self._done,
        )
        self._sweeps += count
        self._windows += 1
        self._is_measured = True

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._sweep.layout.unpad(self._held[self._sweep.slots])

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        if not self._is_measured:
            self.sweep(0)
        return self._sweep.layout.rows_of(self._velocity[self._sweep.slots])


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _run_window(  # type: ignore[no-untyped-def]
    thread, threads, past, count, stages, axes, bodies, records, arrays, momenta, turns, claims, done
):
    """Do the share of one thread in ``count`` sweeps and ξ; return β of the sweep after these.

    Λ, v, the last change of Λ, v before the last sweep and ξ are in ``arrays``. There were ``past`` sweeps and windows
    before. ``momenta`` are bound and delay of ``MomentumState``, and β of the coming sweep. ``turns`` holds the part of
    each batch in the product that is positive if the iterates turn back (``iteration.momentum``), for even and odd
    sweeps. ``claims`` counts how often each task was claimed, and ``done`` the completed tasks of the window.
    """
    sweeps, windows = past
    held, scaled, change, before, velocity = arrays
    momentum, delay, present = momenta
    lanes, length = uint64(LANES), uint64(len(axes))
    own, others, turn = np.empty(2 * lanes * length), np.empty(2 * lanes * length), np.empty(lanes)
    n_stages, n_batches = len(stages) - 1, turns.shape[1]
    needed = 0
    for sweep in range(sweeps, sweeps + count):
        for stage in range(n_stages):
            begin, size, completed = stages[stage], stages[stage + 1] - stages[stage], 0
            wait_for(done, 0, needed)
            for k in range(threads):
                share = (thread + k) % threads
                for task in range(begin + size * share // threads, begin + size * (share + 1) // threads):
                    if claims[task] != sweep or not swap_if_equal(claims, task, sweep, sweep + 1):
                        continue
                    if stage == 0:
                        _extrapolate(scaled, before, present, PIECE_LENGTH * task)
                    else:
                        batch = task - stages[1]
                        _gather(axes, bodies, batch, scaled, own)
                        turn[:] = 0.0
                        begin_record = uint64(batch) * (uint64(6) * lanes * length + uint64(9) * lanes)
                        at = uint64(3) * lanes * uint64(batch)
                        update_batch(axes, records, begin_record, held, change, at, present, turn, own, others)
                        _scatter(axes, bodies, batch, others, scaled)
                        turns[sweep % 2, batch] = turn.sum()
                    completed += 1
            if completed:
                add(done, 0, completed)
            needed += size
        wait_for(done, 0, needed)
        present = 0.0 if turns[sweep % 2].sum() > 0.0 else momentum_after(sweep + 1, momentum, delay)
    wait_for(done, 0, needed)
    completed = 0
    for k in range(threads):
        share = (thread + k) % threads
        for batch in range(n_batches * share // threads, n_batches * (share + 1) // threads):
            task = stages[n_stages] + batch
            if claims[task] == windows and swap_if_equal(claims, task, windows, windows + 1):
                _gather(axes, bodies, batch, scaled, own)
                _velocity_of_batch(axes, records, batch, own, velocity)
                completed += 1
    if completed:
        add(done, 0, completed)
    wait_for(done, 0, needed + n_batches)
    return present


@njit(cache=True, fastmath={"contract"}, inline="always")
def _extrapolate(scaled, before, present, begin):  # type: ignore[no-untyped-def]
    """Move a piece of v along its last change."""
    for k in range(uint64(begin), uint64(min(begin + PIECE_LENGTH, len(scaled)))):
        v = scaled[k]
        scaled[k] = v + present * (v - before[k])
        before[k] = v


@njit(cache=True, inline="always")
def _gather(axes, bodies, batch, scaled, own):  # type: ignore[no-untyped-def]
    """Copy v of both bodies of each contact of a batch."""
    lanes, length = uint64(LANES), uint64(len(axes))
    pair = uint64(2) * lanes * uint64(batch)
    for lane in range(lanes):
        a, b = bodies[pair + lane], bodies[pair + lanes + lane]
        for x in range(length):
            own[lanes * x + lane] = scaled[a + x]
            own[lanes * (length + x) + lane] = scaled[b + x]


@njit(cache=True, inline="always")
def _scatter(axes, bodies, batch, others, scaled):  # type: ignore[no-untyped-def]
    """Copy v back, except for the idle chunk: it is last and stays zero, and all threads read it."""
    lanes, length = uint64(LANES), uint64(len(axes))
    pair, idle = uint64(2) * lanes * uint64(batch), uint64(len(scaled)) - length
    for lane in range(lanes):
        a, b = bodies[pair + lane], bodies[pair + lanes + lane]
        if a != idle:
            for x in range(length):
                scaled[a + x] = others[lanes * x + lane]
        if b != idle:
            for x in range(length):
                scaled[b + x] = others[lanes * (length + x) + lane]


@njit(cache=True, fastmath={"contract"}, inline="always")
def _velocity_of_batch(axes, records, batch, own, velocity):  # type: ignore[no-untyped-def]
    """Write ξ = W̃ᵀ v + c of a batch in the order of Λ."""
    two, three, lanes, length = uint64(2), uint64(3), uint64(LANES), uint64(len(axes))
    row, at = lanes * length, three * lanes * uint64(batch)
    begin = uint64(batch) * (uint64(6) * row + uint64(9) * lanes)
    for lane in range(lanes):
        a, c, n = begin + lane, begin + uint64(6) * row + lane, at + lane
        b = a + three * row
        normal, first, second = records[c], records[c + lanes], records[c + two * lanes]
        for x in range(length):
            v_a, v_b = own[lanes * x + lane], own[lanes * (length + x) + lane]
            normal += records[a + lanes * x] * v_a + records[b + lanes * x] * v_b
            first += records[a + row + lanes * x] * v_a + records[b + row + lanes * x] * v_b
            second += records[a + two * row + lanes * x] * v_a + records[b + two * row + lanes * x] * v_b
        velocity[n], velocity[n + lanes], velocity[n + two * lanes] = normal, first, second
