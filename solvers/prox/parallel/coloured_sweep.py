"""Gauss–Seidel sweeps over slabs of contacts in two colours, which several threads share.

The slabs of a colour share no movable body (``slabs``). Each slab is swept in the batches of ``sweeps.batches``: those
of balls from records of a normal, others from pieces of W̃. A sweep is a sequence of three stages: the momentum of v,
the even slabs, and the odd slabs. A task of a stage (a piece of v, or a slab) writes numbers that no other task of the
stage reads or writes. A stage begins when the previous one is complete.

The thread that claims a task first does it. The arithmetic of a task does not depend on the thread, and sums over tasks
are taken in the order of the tasks. The result is therefore identical for any number of threads. Each thread begins
with its own share of a stage, whose data are then in the cache of its core: v is in the order of the levels, so that
the shares of all stages concern the same bodies. Other threads do the tasks of a late thread.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numba import njit

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.answer import ratio
from ....problems.contact.blocks import BlockLayout
from ....problems.contact.matrices.pieces import Pieces
from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ...iteration.loop import SinglePassIterates
from ...iteration.momentum import MomentumState, extrapolate, momentum_after
from ...sweeps.batches.ball_kernels import SCRATCH, WEIGHTS, largest_of_lanes, write_impulses, write_rows
from ...sweeps.batches.balls import balls_of, can_compare_squares, write_weights
from ...sweeps.batches.lanes import BALL_LENGTH, LANES, aligned_copy
from ...sweeps.batches.pieces import Batches, batch_arguments, slots_in_batches
from ...sweeps.factors import own_coupling
from .atomic import add, swap_if_equal, wait_for
from .ball_tasks import BallBatches, raise_to_violations, update_ball_batch, write_ball_velocities
from .pairs import in_pairs
from .piece_tasks import update_pieces, write_piece_velocities
from .slabs import Slabs, divide_into_slabs
from .team import Team, joins_call, leave_call

PIECE_LENGTH = 512
"""Number of entries of v, 4 kB, that one task extrapolates."""

MIN_CONTACTS_PER_THREAD = 2000
"""Minimum number of contacts per thread; with fewer, whole solves in two threads save little or no time."""

MIN_EFFICIENCY = 0.75
"""Minimum of the largest possible speed-up per thread. The speed-up is small if few slabs hold most contacts."""


@dataclass(frozen=True, eq=False)
class ColouredSweep:
    """The constant data of a sweep.

    Attributes:
        layout: the padded blocks.
        piece_batches: the constant arguments of a sweep over pieces, see ``batch_arguments``; None over balls.
        ball_batches: the constant data of a sweep over balls; None over pieces.
        motion: maps Λ, shape (n_rows,), to v of all bodies with contacts and of the idle one, flat.
        slabs: the slabs of contacts.
        slots: position of each entry of padded Λ, or of the vectors P of balls, in the order of the batches.
        threads: number of threads; fewer than requested if there are few contacts, or few slabs hold most of them.
    """

    layout: BlockLayout
    piece_batches: tuple[Any, ...] | None
    ball_batches: BallBatches | None
    motion: Callable[[FloatArray], FloatArray]
    slabs: Slabs
    slots: IntArray
    threads: int

    @staticmethod
    def over(problem: ContactProblem, step_sizes: FloatArray, threads: int) -> "ColouredSweep":
        """Return the sweep of a problem with factors whose contacts touch at most two bodies each.

        ``step_sizes`` are those of ``compute_step_sizes`` [kg], shape (n_blocks, 2); ``threads`` is the largest number
        of threads.
        """
        layout, balls = problem.layout, balls_of(problem)
        pairs = in_pairs(problem.factor_pieces()) if balls is None else balls.directions
        slabs = divide_into_slabs(pairs)
        n_threads = _useful_threads(slabs, layout.n_blocks, threads)
        if balls is None:
            pairs = Pieces(pairs.starts, slabs.chunks, pairs.values, len(slabs.bodies))
            return ColouredSweep._over_pieces(problem, step_sizes, pairs, slabs, n_threads)
        renumbered = balls.renumbered(slabs.bodies, slabs.chunks)
        bodies, records, slots = renumbered.pack(problem, step_sizes, slabs.positions, slabs.n_batches)
        contacts = balls.contacts.normals, layout.friction_coefficient
        data = BallBatches(bodies, records, balls.spin_ratio, *contacts)
        return ColouredSweep(layout, None, data, renumbered.motion, slabs, slots, n_threads)

    @staticmethod
    def _over_pieces(
        problem: ContactProblem, step_sizes: FloatArray, pairs: Pieces, slabs: Slabs, threads: int
    ) -> "ColouredSweep":
        layout = problem.layout
        free_velocity = np.zeros((layout.n_blocks, 3))
        free_velocity[:, : layout.width] = layout.pad(problem.free_velocity)
        laws = step_sizes.reshape(-1), layout.friction_coefficient, layout.fixed_bound
        coupling = own_coupling(pairs.starts, pairs.values).reshape(-1)
        batches = Batches(slabs.positions, slabs.n_batches)
        data = batch_arguments(pairs, batches, free_velocity.reshape(-1), laws, coupling)
        slots = slots_in_batches(slabs.positions).reshape(-1, 3)[:, : layout.width].flatten()
        return ColouredSweep(layout, data, None, partial(_motion, layout, pairs), slabs, slots, threads)


def _useful_threads(slabs: Slabs, n_contacts: int, threads: int) -> int:
    """Return the largest number of threads, at most ``threads``, that has enough contacts and saves enough time."""
    for count in range(min(threads, n_contacts // MIN_CONTACTS_PER_THREAD), 1, -1):
        if slabs.largest_speedup(count) >= MIN_EFFICIENCY * count:
            return count
    return 1


def _motion(layout: BlockLayout, pairs: Pieces, impulses: FloatArray) -> FloatArray:
    """Return v = W̃ Λ, with zeros for the idle chunk, which is last."""
    padded = np.zeros((layout.n_blocks, 3))
    padded[:, : layout.width] = layout.pad(impulses)
    return np.append(pairs.times(padded), np.zeros(pairs.length))


class ColouredIterates(MomentumState, SinglePassIterates):
    """Λ or P, in the order of the batches, and v of an iteration with momentum β; ``start`` has shape (n_rows,)."""

    def __init__(self, sweep: ColouredSweep, start: FloatArray, momentum: float, delay: float = 0.0) -> None:
        MomentumState.__init__(self, momentum, delay)
        self._sweep, self._start = sweep, start.copy()
        self._scaled_velocity = sweep.motion(start)
        self._previous_velocity = aligned_copy(self._scaled_velocity)
        self._impulses, self._change, self._velocity = np.zeros((3, 3 * LANES * sweep.slabs.n_batches))
        if sweep.ball_batches is not None:
            write_impulses(sweep.ball_batches.normals, sweep.slots, start, self._impulses)
        elif start.any():
            self._impulses[sweep.slots] = sweep.layout.pad(start).reshape(-1)
        n_pieces = -(-len(self._scaled_velocity) // PIECE_LENGTH) if momentum > 0.0 else 0
        first_batch, n_slabs = sweep.slabs.first_batch, len(sweep.slabs.first_batch) - 1
        stages = np.concatenate([[0], n_pieces + sweep.slabs.first_slab])
        n_tasks = int(stages[-1]) + n_slabs  # ξ or the violations of each slab come last
        self._claims, self._n_completed = np.zeros(n_tasks, dtype=np.int64), np.zeros(1, dtype=np.int64)
        self._turns = np.zeros((2, n_slabs))
        self._counters, self._momenta = np.zeros(4, dtype=np.int64), np.zeros(3)
        self._residual: Residual | None = None
        self._weights = np.zeros(WEIGHTS * LANES * int(first_batch[-1]) if sweep.ball_batches is not None else 0)
        self._violations, self._rows = np.zeros(n_slabs), np.empty(len(start))
        arguments = (
            self._counters,
            self._momenta,
            stages,
            first_batch,
            sweep.piece_batches,
            sweep.ball_batches,
            (self._impulses, self._scaled_velocity, self._change, self._previous_velocity, self._velocity),
            (self._weights, self._violations, sweep.slots, self._rows),
            self._turns,
            self._claims,
            self._n_completed,
        )
        self._team = Team(sweep.threads, _run_windows, *arguments)
        self._alone = Team(1, _run_windows, *arguments)
        self._windows = 0
        self._has_velocity = self._has_violations = False

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, and compute the violations if the residual is known, or else ξ."""
        self._run(count, self._residual is not None)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        if not self._sweeps:
            return self._start.copy()
        if self._has_violations:
            return self._rows.copy()
        slots, balls = self._sweep.slots, self._sweep.ball_batches
        if balls is None:
            return self._sweep.layout.unpad(self._impulses[slots])
        rows = np.empty(len(slots))
        write_rows(balls.normals, balls.friction, slots, self._impulses, 0, len(slots) // 3, rows)
        return rows

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        if not self._has_velocity:
            self._run(0, False)
        return self._sweep.layout.rows_of(self._velocity[self._sweep.slots])

    def impulses_and_residual(self, residual: Residual) -> tuple[FloatArray, float]:
        """Return Λ over rows and its residual."""
        if self._sweep.ball_batches is None or not can_compare_squares(residual):
            impulses = self.impulses()
            return impulses, residual(impulses, self.relative_velocity())
        if residual is not self._residual:
            self._residual = residual
            write_weights(residual.alpha, residual.ratios, self._sweep.slots, self._weights)
            self._has_violations = False
        if not self._has_violations:
            self._run(0, True)
        return self.impulses(), ratio(float(np.sqrt(self._violations.max())), residual.scale)

    def _run(self, count: int, writes_violations: bool) -> None:
        self._n_completed[0] = 0
        self._counters[:] = self._sweeps, self._windows, count, writes_violations
        self._momenta[:] = self._momentum, self._delay, self._beta
        self._beta = (self._team if count else self._alone).run()
        self._sweeps += count
        self._windows += 1
        self._has_velocity, self._has_violations = not writes_violations, writes_violations


@njit(cache=True, nogil=True)
def _run_windows(thread, threads, calls, states, *arguments):  # type: ignore[no-untyped-def]
    """Do the part of the calling thread (number 0) in one window, or of another thread in each window; see ``Team``."""
    if thread == 0:
        return _run_window(thread, threads, *arguments)
    while joins_call(calls, states, thread):
        _run_window(thread, threads, *arguments)
        leave_call(states, thread)
    return 0.0


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _run_window(  # type: ignore[no-untyped-def]
    thread,
    threads,
    counters,
    momenta,
    stages,
    first_batch,
    pieces,
    balls,
    arrays,
    violations,
    turns,
    claims,
    n_completed,
):
    """Do the share of one thread in a window of sweeps and ξ or violations; return β of the sweep after these.

    One of ``pieces`` and ``balls`` is None. Λ (P of balls), v, the last change of Λ, v before the last sweep and ξ are
    in ``arrays``. ``counters`` holds the numbers of earlier sweeps and windows, of sweeps in this window, and whether
    violations and Λ over rows are written in place of ξ; ``violations`` holds weights, the largest violation of each
    slab, the slot of each row, and Λ over rows.
    ``momenta`` holds the bound and delay of ``MomentumState`` and β of the next sweep. ``turns`` holds the part of each
    slab in the product that is positive if the iterates turn back (``iteration.momentum``), for even and odd sweeps.
    ``claims`` counts how often each task was claimed, and ``n_completed`` the completed tasks of the window.
    """
    sweeps, windows, count = counters[0], counters[1], counters[2]
    impulses, scaled_velocity, change, previous_velocity, velocity = arrays
    momentum, delay, beta = momenta[0], momenta[1], momenta[2]
    length = BALL_LENGTH
    if pieces is not None:
        length = len(pieces[0])
    work, second_work, turn = np.empty(2 * LANES * length), np.empty(2 * LANES * length), np.empty(LANES)
    n_stages, n_required = len(stages) - 1, 0
    for sweep in range(sweeps, sweeps + count):
        for stage in range(n_stages):
            begin, size, completed = stages[stage], stages[stage + 1] - stages[stage], 0
            wait_for(n_completed, 0, n_required)
            for k in range(threads):
                share = (thread + k) % threads
                for task in range(begin + size * share // threads, begin + size * (share + 1) // threads):
                    if claims[task] != sweep or not swap_if_equal(claims, task, sweep, sweep + 1):
                        continue
                    completed += 1
                    if stage == 0:
                        first = PIECE_LENGTH * task
                        extrapolate(
                            scaled_velocity,
                            previous_velocity,
                            beta,
                            first,
                            min(first + PIECE_LENGTH, len(scaled_velocity)),
                        )
                        continue
                    slab = task - stages[1]
                    turn[:] = 0.0
                    for batch in range(first_batch[slab], first_batch[slab + 1]):
                        if balls is not None:
                            update_ball_batch(
                                balls, batch, scaled_velocity, impulses, change, beta, turn, work, second_work
                            )
                        if pieces is not None:
                            update_pieces(
                                pieces, batch, scaled_velocity, impulses, change, beta, turn, work, second_work
                            )
                    turns[sweep % 2, slab] = turn.sum()
            if completed:
                add(n_completed, 0, completed)
            n_required += size
        wait_for(n_completed, 0, n_required)
        beta = 0.0 if turns[sweep % 2].sum() > 0.0 else momentum_after(sweep + 1, momentum, delay)
    wait_for(n_completed, 0, n_required)
    data = (windows, stages[n_stages], stages[2] - stages[1], first_batch, balls, scaled_velocity)
    if counters[3] and balls is not None:
        completed = _write_violations(thread, threads, *data, impulses, violations, claims)
    else:
        completed = _write_xi(thread, threads, *data, pieces, velocity, claims)
    if completed:
        add(n_completed, 0, completed)
    wait_for(n_completed, 0, n_required + turns.shape[1])
    return beta


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _write_xi(  # type: ignore[no-untyped-def]
    thread, threads, windows, first_task, n_even, first_batch, balls, scaled_velocity, pieces, velocity, claims
):
    """Do the share of one thread in ξ, by tasks from ``first_task`` on, and return the number of completed tasks."""
    length, n_slabs = BALL_LENGTH, len(first_batch) - 1
    if pieces is not None:
        length = len(pieces[0])
    work, completed = np.empty(2 * LANES * length), 0
    for k in range(threads):
        share = (thread + k) % threads
        for position in range(n_slabs * share // threads, n_slabs * (share + 1) // threads):
            task, slab = first_task + position, _slab_at(position, n_even)
            if claims[task] == windows and swap_if_equal(claims, task, windows, windows + 1):
                for batch in range(first_batch[slab], first_batch[slab + 1]):
                    if balls is not None:
                        write_ball_velocities(balls, batch, scaled_velocity, work, velocity)
                    if pieces is not None:
                        write_piece_velocities(pieces, batch, scaled_velocity, work, velocity)
                completed += 1
    return completed


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _write_violations(  # type: ignore[no-untyped-def]
    thread, threads, windows, first_task, n_even, first_batch, balls, scaled_velocity, impulses, violations, claims
):
    """Do the share of one thread in the violations and in Λ over rows; see ``_write_xi``."""
    weights, squares, slots, rows = violations
    moves, scratch, largest, completed = np.empty(6 * LANES), np.empty(SCRATCH * LANES), np.empty(LANES), 0
    for k in range(threads):
        share = (thread + k) % threads
        for position in range(len(squares) * share // threads, len(squares) * (share + 1) // threads):
            task, slab = first_task + position, _slab_at(position, n_even)
            if claims[task] == windows and swap_if_equal(claims, task, windows, windows + 1):
                largest[:] = 0.0
                for batch in range(first_batch[slab], first_batch[slab + 1]):
                    raise_to_violations(balls, batch, scaled_velocity, impulses, weights, moves, scratch, largest)
                squares[slab] = largest_of_lanes(largest)
                n_contacts, n_slabs = len(slots) // 3, len(squares)
                begin, end = n_contacts * position // n_slabs, n_contacts * (position + 1) // n_slabs
                write_rows(balls.normals, balls.friction, slots, impulses, begin, end, rows)
                completed += 1
    return completed


@njit(inline="always")
def _slab_at(position, n_even):  # type: ignore[no-untyped-def]
    """Return the slab at a position in the order of the levels, in which even and odd slabs alternate."""
    return position // 2 + n_even * (position % 2)
