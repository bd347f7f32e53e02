"""SemismoothNewton: Newton's method on the projection equations, led near the solution by sweeps.

Sweeps find quickly which contacts are open, stick and slip, but settle the impulses slowly where masses differ or many
contacts hang together; Newton's method does the reverse. So sweeps come first, and Newton's method is tried when they
are slow. What it finds is kept only where the judge's residual has fallen.

Newton's method converges from nearby alone, and sweeps of high friction may lead away for ever. Where they stall, the
solve begins anew with other predictors (block Gauss–Seidel, then the first sweeps): Newton's method is tried from
their 0th, 1st, 2nd, 4th, 8th, … iterate, with two dampings, with and without a search along its steps (``steps``). Such
restarts are what there is of globalisation where the equations have neither a potential nor a monotone map: no merit
function is free of local minima then (Acary, Brémond & Huber 2018).

No decision depends on the tolerance: a solve to a tighter one begins with the same iterates, and ends no worse.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...problems.contact import ContactProblem
from ...problems.judge import Residual
from ...problems.laws import FloatArray
from ...problems.model import Model
from ..interface import Observer, Solution, Status, Stop, described
from ..prox.block_gauss_seidel import BlockIterates, BlockSweep
from ..prox.delassus_sweep import DelassusSweep
from ..prox.iteration import Advance, Iterates, confirmed, first_impulses, rounding
from ..prox.monitor import Monitor, sweeps_to_next_look
from ..prox.safeguarded import SafeguardedIterates
from ..prox.step_size import check_relaxation, diagonal_step_sizes
from .linearised import Equations
from .steps import DAMPED, SHARP, THOROUGH, Attempt, newton_steps

SWEEPS_BEFORE = 200
"""Sweeps before Newton's method is thought of, and between two measurements of how fast they converge."""

SLOW = 500
"""Newton's method is tried where the sweeps take more than this for a digit: a few of its steps cost as much as a few
thousand sweeps, on ten contacts as on a thousand."""

IN_TURN = (SHARP, DAMPED, *THOROUGH)
"""What successive attempts try between sweeps."""

SUCCESS = 0.1
"""After an attempt that lowers the residual to this fraction the next follows at once; after others, sweeps do."""

RESTART_SWEEPS = 128
"""Sweeps of one predictor after a restart."""

RESTART_STEPS = 1000
"""Iterations after which restarts are given up."""

RESTART_WORK = 30_000
"""Rows times iterations after which they are given up too: a Newton step costs in proportion to the rows, or more."""


STUCK = (Status.STALLED, Status.DIVERGED, Status.OSCILLATING)
"""Where sweeps lead nowhere, and other predictors may."""


@dataclass(frozen=True)
class SemismoothNewton:
    """Newton's method on the projection equations Λ_i = prox(Λ_i − ξ_i/α_i), with safeguarded sweeps in between.

    One iteration is a sweep or a Newton step.

    Attributes:
        relaxation: ω of the sweeps, see ``SafeguardedSORprox``.

    Raises:
        SolverError: for an option out of range.
    """

    relaxation: float = 1.5

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> "PreparedNewton":
        """Assemble G, and the first step sizes of the sweeps."""
        residual = Residual(problem)
        sizes = diagonal_step_sizes(problem, self.relaxation)
        sweep = DelassusSweep.over(problem, problem.delassus_blocks(), sizes)
        return PreparedNewton(problem, residual, sweep, Equations(problem, residual))


@dataclass(frozen=True, eq=False)
class PreparedNewton:
    """Sweeps and Newton's equations of one problem."""

    problem: ContactProblem
    residual: Residual
    sweep: DelassusSweep
    equations: Equations

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep, and try Newton's method where that is slow; see ``Prepared.solve``."""
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return Solution(first, Status.INFEASIBLE, 0, "a unilateral law has G_ii = 0 and c_i < 0")
        monitor = Monitor(stop)
        iterates = SafeguardedIterates(self.sweep, first)
        advance = Advance(iterates, monitor, observe)
        pace, wait, attempts = Pace(), SWEEPS_BEFORE, 0
        while True:
            impulses = iterates.impulses()
            residual = self.residual(impulses, iterates.relative_velocity())
            if residual <= stop.tolerance:
                residual = confirmed(self.problem, self.residual, impulses, residual, stop.tolerance)
            ended = monitor.look(advance.iteration, residual, impulses)
            if ended is None and monitor.suspects_cycle and advance.iteration + 2 <= stop.max_iterations:
                ended = advance.cycle(impulses)
            if ended is not None and ended[0] in STUCK and not self._is_rounding(monitor):
                ended = self._restarted(advance, first, stop) or ended
            if ended is not None:
                return monitor.solution(ended, advance.iteration, self.problem.n_rows)
            if pace.sweeps >= wait and pace.sweeps_a_digit(residual) > SLOW:
                attempt = IN_TURN[attempts % len(IN_TURN)]
                found, lowest = self._tried(attempt, impulses, residual, stop, advance)
                if lowest < residual:
                    iterates.move_to(found)
                if lowest > SUCCESS * residual:
                    attempts, wait = attempts + 1, 2 * wait
                    pace = Pace()
                continue
            count = min(stop.max_iterations - advance.iteration, sweeps_to_next_look(advance.iteration))
            advance.by(count)
            pace.note(count, residual)

    def _restarted(self, advance: Advance, first: FloatArray, stop: Stop) -> tuple[Status, str] | None:
        """Try Newton's method from the iterates of other predictors; return how that ended, None if it did not help.

        Every iterate counts and is shown, those of the predictors included; the monitor keeps the best.
        """
        monitor, began = advance.monitor, advance.iteration
        most = min(RESTART_STEPS, RESTART_WORK // max(self.problem.n_rows, 1))
        predictors: tuple[Callable[[FloatArray], Iterates], ...] = (
            lambda start: BlockIterates(BlockSweep.over(self.problem, 1.0, True), start),
            lambda start: SafeguardedIterates(self.sweep, start),
        )
        for predictor in predictors:
            iterates, done = predictor(first), 0
            advance.iterates = iterates
            while done <= RESTART_SWEEPS and advance.iteration - began < most:
                impulses = iterates.impulses()
                residual = self._judged(impulses)
                if not np.isfinite(residual):
                    break
                candidates = [(impulses, residual)]
                for attempt in THOROUGH:
                    candidates.append(self._tried(attempt, impulses, residual, stop, advance))
                    if candidates[-1][1] <= stop.tolerance:
                        break
                best, lowest = min(candidates, key=lambda candidate: candidate[1])
                if lowest < monitor.best_residual:
                    monitor.best_residual, monitor.best_impulses = lowest, best
                if lowest <= stop.tolerance:
                    return Status.SOLVED, ""
                if monitor.clock.is_up or advance.iteration >= stop.max_iterations:
                    limit = Status.TIME_LIMIT if monitor.clock.is_up else Status.ITERATION_LIMIT
                    return limit, f"residual {monitor.best_residual:.1e} after {advance.iteration} iterations"
                count = min(max(done, 1), stop.max_iterations - advance.iteration)
                advance.by(count)
                done += count
        return None

    def _is_rounding(self, monitor: Monitor) -> bool:
        """Whether the best residual is what rounding may leave, and nothing else would find less."""
        impulses = monitor.best_impulses
        return impulses is not None and monitor.best_residual <= rounding(self.problem, self.residual, impulses)

    def _tried(
        self, attempt: Attempt, impulses: FloatArray, residual: float, stop: Stop, advance: Advance
    ) -> tuple[FloatArray, float]:
        """Return the best Λ of an attempt and its residual."""
        if advance.iteration >= stop.max_iterations or advance.monitor.clock.is_up:
            return impulses, residual

        def goes_on(reached: FloatArray) -> bool:
            advance.arrive(reached)
            return advance.iteration < stop.max_iterations and not advance.monitor.clock.is_up

        return newton_steps(self.equations, self._judged, impulses, residual, attempt, stop.tolerance, goes_on)

    def _judged(self, impulses: FloatArray) -> float:
        return self.residual(impulses, self.problem.relative_velocity(impulses))


class Pace:
    """How fast sweeps converge.

    Attributes:
        sweeps: sweeps noted so far.
    """

    def __init__(self) -> None:
        self.sweeps = 0
        self._marks: list[tuple[int, float]] = []

    def note(self, count: int, residual: float) -> None:
        """Note that ``count`` sweeps began with ``residual``."""
        self._marks.append((self.sweeps, residual))
        self.sweeps += count

    def sweeps_a_digit(self, residual: float) -> float:
        """Return the sweeps to a tenth of the residual at the rate of the last ``SWEEPS_BEFORE`` or more."""
        earlier = [mark for mark in self._marks if mark[0] <= self.sweeps - SWEEPS_BEFORE]
        if not earlier or not residual < earlier[-1][1]:
            return np.inf
        since, before = earlier[-1]
        return float((self.sweeps - since) / np.log10(before / residual)) if residual > 0.0 else 0.0
