"""Gauss–Seidel sweeps over slabs of contacts in two colours, which several threads share.

The slabs of a colour share no movable body (``slabs``). Each slab is swept in the batches of ``sweeps.batches``: those
of balls from records of a normal, others from pieces of W̃. Threads run windows of sweeps and checks (``window``).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.blocks import BlockLayout
from ....problems.contact.matrices.pieces import Pieces
from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ...iteration.loop import Window, WindowedIterates
from ...iteration.momentum import MomentumState
from ...sweeps.batches.ball_kernels import WEIGHTS, write_impulses, write_rows
from ...sweeps.batches.balls import balls_of, can_compare_squares, write_weights
from ...sweeps.batches.lanes import LANES, aligned_copy
from ...sweeps.batches.pieces import Batches, batch_arguments, slots_in_batches
from ...sweeps.factors import own_coupling
from .ball_tasks import BallBatches
from .pairs import in_pairs
from .slabs import Slabs, divide_into_slabs
from .team import Team
from .window import MAX_CHECKS, PIECE_LENGTH, run_windows

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


class ColouredIterates(MomentumState, WindowedIterates):
    """Λ or P, in the order of the batches, and v of an iteration with momentum β; ``start`` has shape (n_rows,)."""

    def __init__(self, sweep: ColouredSweep, start: FloatArray, momentum: float, delay: float = 0.0) -> None:
        MomentumState.__init__(self, momentum, delay)
        self._sweep, self._start = sweep, start.copy()
        self._scaled_velocity = sweep.motion(start)
        self._previous_velocity = aligned_copy(self._scaled_velocity)
        slabs, balls = sweep.slabs, sweep.ball_batches
        size, n_slabs = 3 * LANES * slabs.n_batches, len(slabs.first_batch) - 1
        (self._impulses, self._change), self._velocity = np.zeros((2, size)), np.empty(size)
        n_pieces = -(-len(self._scaled_velocity) // PIECE_LENGTH) if momentum > 0.0 else 0
        stages = np.concatenate([[0], n_pieces + slabs.first_slab])
        self._plan, self._counts = np.zeros(3, dtype=np.int64), np.zeros(MAX_CHECKS, dtype=np.int64)
        self._momenta, self._limits = np.zeros(3), np.zeros(3)
        self._weights = np.zeros(WEIGHTS * LANES * slabs.n_batches if balls is not None else 0)
        self._rows, self._residuals = np.empty(len(start)), np.empty(MAX_CHECKS)
        self._copies = np.empty((2, size if balls is not None else 0))
        self._n_completed = np.zeros(1, dtype=np.int64)
        self._team = Team(
            sweep.threads,
            run_windows,
            self._plan,
            self._counts,
            self._momenta,
            self._limits,
            (stages, slabs.first_batch),
            sweep.piece_batches,
            balls,
            (self._impulses, self._scaled_velocity, self._change, self._previous_velocity, self._velocity),
            (self._weights, sweep.slots, self._rows, np.empty((MAX_CHECKS, n_slabs)), self._residuals, self._copies),
            np.zeros((2, n_slabs)),
            np.zeros(int(stages[-1]) + n_slabs, dtype=np.int64),
            self._n_completed,
        )
        self._team.start()
        self._residual: Residual | None = None
        self._n_passes, self._last_residual = 0, np.inf
        self._has_velocity = self._has_residual = False
        if start.any():
            self._begin_at(start)

    def _begin_at(self, start: FloatArray) -> None:
        sweep = self._sweep
        if sweep.ball_batches is not None:
            write_impulses(sweep.ball_batches.normals, sweep.slots, start, self._impulses)
        else:
            self._impulses[sweep.slots] = sweep.layout.pad(start).reshape(-1)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps, and measure the residual if it is known, or else compute ξ."""
        self._run([count], self._residual)
        self._sweeps += count

    def has_windows(self, residual: Residual) -> bool:
        """Return whether ``run_window`` applies to a residual."""
        return self._sweep.ball_batches is not None and can_compare_squares(residual)

    def run_window(self, counts: Sequence[int], residual: Residual, limits: tuple[float, float]) -> Window:
        """Sweep and measure up to ``MAX_CHECKS`` times; see ``WindowedIterates``."""
        n_checks, best = self._run(counts[:MAX_CHECKS], residual, limits)
        residuals = self._residuals[:n_checks].copy()
        self.count_window(counts[:n_checks], residuals[:-1])
        return Window(residuals, partial(self._over_rows, self._copies[best].copy()))

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        if not self._sweeps:
            return self._start.copy()
        return self._rows.copy() if self._has_residual else self._over_rows(self._impulses)

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        if not self._has_velocity:
            self._run([0], None)
        return self._sweep.layout.rows_of(self._velocity[self._sweep.slots])

    def impulses_and_residual(self, residual: Residual) -> tuple[FloatArray, float]:
        """Return Λ over rows and its residual."""
        if not self.has_windows(residual):
            impulses = self.impulses()
            return impulses, residual(impulses, self.relative_velocity())
        if not self._has_residual or residual is not self._residual:
            self._run([0], residual)
        return self.impulses(), self._last_residual

    def _over_rows(self, impulses: FloatArray) -> FloatArray:
        """Return Λ over rows from its array in the order of the batches."""
        slots, balls = self._sweep.slots, self._sweep.ball_batches
        if balls is None:
            return self._sweep.layout.unpad(impulses[slots])
        rows = np.empty(len(slots))
        write_rows(balls.normals, balls.friction, slots, impulses, 0, len(slots) // 3, rows)
        return rows

    def _run(
        self, counts: Sequence[int], residual: Residual | None, limits: tuple[float, float] = (-np.inf, np.inf)
    ) -> tuple[int, int]:
        """Run a window with a check of ``residual`` after each number of sweeps, or with one number and then ξ.

        Return the number of checks and the number of the best copy.
        """
        n_checks = 0
        if residual is not None:
            if residual is not self._residual:
                write_weights(residual.alpha, residual.ratios, self._sweep.slots, self._weights)
                self._residual = residual
            self._limits[:] = *limits, residual.scale
            n_checks = len(counts)
        self._n_completed[0] = 0
        self._plan[:] = self._sweeps, self._n_passes, n_checks
        self._counts[: len(counts)] = counts
        self._momenta[:] = self._momentum, self._delay, self._beta
        self._beta, n_checks, best = self._team.run()
        self._n_passes += n_checks + 1
        self._has_velocity, self._has_residual = residual is None, residual is not None
        if residual is not None:
            last = float(self._residuals[n_checks - 1])
            self._last_residual = np.inf if np.isnan(last) else last
        return n_checks, best
