"""Coulomb friction by De Saxcé's fixed point over cone programs (De Saxcé & Feng 1998; Acary & Cadoux 2013).

Coulomb's law is the associated law for the velocity whose normal part is raised by s = μ‖ξ_T‖ (plus μ_r‖ξ_R‖ with
rolling friction),

    −(ξ + s e_N) ∈ N_K(Λ),      s = μ ‖ξ_T‖      for every contact.

Each outer iteration solves one cone program with c_N + s and computes s from the resulting velocity: s ← F(s). The
plain iteration converges linearly, and slowly on many contacts; Anderson acceleration of s ≥ 0 makes it faster. If the
residual rises far above its best value, the acceleration restarts.

F(s) exists if the cone program has a solution, that is, on D = {s : W̃ᵀv + c + s e_N ∈ K* for some v} with G = W̃ᵀW̃. D
is convex, and if it contains s, it contains every s' ≥ s. If 0 ∈ D, a fixed point exists (Acary, Cadoux, Lemaréchal &
Malick 2011), and the iteration stays in D. Otherwise F may lead out of D although a fixed point exists, and even in D
it need not be a contraction. If the iteration fails, a proximal iteration follows (nonsmooth proximal point algorithm,
Acary, Brémond & Huber 2018). With w_i = εα_i, α_i the largest diagonal entry of the block of row i in G, and (s, Λ)
from the previous iterate, it computes

    Λ ← argmin { ½ yᵀGy + (c + s e_N)ᵀy + ½ (y − Λ)ᵀ diag(w) (y − Λ) : y ∈ K },      s ← μ ‖ξ_T‖.

G + diag(w) is positive definite. The program therefore has exactly one solution, which depends continuously on (s, Λ).
A fixed point solves the original problem. Small ε allow long steps; large ε damp oscillations.

Another method may correct the iterates (``Correction``); the iteration continues from the result. No decision depends
on the tolerance. A solve to a smaller tolerance therefore begins with the same iterates, and its residual is not
larger.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.coupling import row_lengths
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop, check_stop
from ..iteration.anderson import Anderson
from ..iteration.loop import infeasible_solution, initial_impulses
from ..iteration.method import Method, check_option
from ..iteration.stopping import ROUNDING, Clock, Outcome
from .programs import ConicProgram, ConicResult, ConicStatus, largest_curvatures

MAX_TOLERANCE = 1e-8
"""The largest tolerance of a cone program. The error of a solution is about the square root of the tolerance."""

MIN_TOLERANCE = 1e-13
"""Tolerance below which the factorisations of conic solvers begin to fail."""

INNER_ERROR = 1e-2
"""Intended error of the solution of a cone program, relative to the best residual so far."""

TOLERANCE_GROWTH = 100.0
"""Factor by which the smallest tolerance grows when the conic solver gives up without progress."""

PROGRESS = 0.95
"""A residual below this fraction of the best one counts as progress."""

RESTART_GROWTH = 10.0
"""The acceleration restarts when the residual exceeds this multiple of its best value."""

INNER_ITERATIONS = 1_000_000
"""Iteration limit of one cone program; each conic solver applies its own lower limit."""

CORRECTION_SUCCESS = 0.1
"""The iteration continues from a corrected iterate whose residual is below this fraction of the uncorrected one."""


@dataclass(frozen=True)
class Phase:
    """A phase of the iteration.

    Attributes:
        weight: ε, 0 for De Saxcé's iteration.
        patience: the phase ends after this many iterations without progress.
        progress: a residual below this fraction of the best one counts as progress.
    """

    weight: float
    patience: int
    progress: float = PROGRESS


PHASES = (Phase(0.0, 25), Phase(0.01, 50), Phase(0.1, 50), Phase(1.0, 50))
"""The phases. All but the first begin at Λ = 0. The last one continues to the limits unless the iterates repeat or
rounding explains the residual."""

FAST_PHASE = Phase(0.0, 1, progress=0.1)
"""De Saxcé's iteration as long as each cone program reduces the residual tenfold."""


def check_memory(memory: int) -> None:
    """Raise ``SolverError`` unless ``memory`` is a valid number of pairs."""
    check_option("memory", memory, type(memory) is int and memory >= 0, "a whole number, 0 or more")


class Correction:
    """Correction of the iterates of one solve. This base class leaves them unchanged."""

    def __init__(self, clock: Clock, tolerance: float) -> None:
        """Store the clock and the tolerance of the solve."""
        self.clock, self.tolerance = clock, tolerance

    def begin_phase(self) -> None:
        """Begin a phase of the iteration."""

    def correct(self, impulses: FloatArray, residual: float, is_last: bool) -> tuple[FloatArray, float]:
        """Return better impulses [N s], shape (n_rows,), and their residual, or the given ones.

        ``is_last`` means that the phase ends with this iterate unless it is corrected.
        """
        return impulses, residual


class FixedPointMethod(Method, ABC):
    """A fixed-point iteration over cone programs, whose iterates can be corrected."""

    memory: int

    @abstractmethod
    def program(self, problem: ContactProblem) -> ConicProgram:
        """Return the program of ``problem``, set up once for all outer iterations."""

    def prepare(self, problem: ContactProblem) -> "PreparedFixedPoint":
        """Set up the program."""
        self.check_supports(problem)
        return PreparedFixedPoint(problem, Residual(problem), self.program(problem), self.memory)


@dataclass(frozen=True)
class FastFixedPoint(Method):
    """A fixed-point iteration that ends when a program gains less than a digit. It has the name of its method.

    If bodies stay at rest, s = 0 is the solution, and the first program finds it. The more slowly contacts slip, the
    faster the iteration converges. Where it converges slowly, other methods are faster.
    """

    method: FixedPointMethod

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.method.name

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return self.method.supports(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedFixedPoint":
        """Set up the program."""
        return replace(self.method.prepare(problem), phases=(FAST_PHASE,))


@dataclass(frozen=True)
class PreparedFixedPoint:
    """The outer iteration over the cone program of one problem.

    Attributes:
        problem: the problem.
        residual: its residual.
        program: its cone program.
        memory: number of pairs of the Anderson acceleration.
        correction: function that creates the correction of each solve.
        phases: the phases of each solve.
    """

    problem: ContactProblem
    residual: Residual = field(repr=False)
    program: ConicProgram = field(repr=False)
    memory: int
    correction: Callable[[Clock, float], Correction] = Correction
    phases: tuple[Phase, ...] = field(default=PHASES, repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Iterate until the residual reaches the tolerance, from the s of ``start``; iterations are cone programs."""
        check_stop(stop)
        first = initial_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return infeasible_solution(self.problem)
        velocity = self.problem.relative_velocity(first)
        shift = np.zeros(self.problem.n_contacts) if start is None else lift(self.problem, velocity)
        outer = _Outer(self, stop, observe, first, self.residual.judged(self.problem, first))
        if outer.lowest <= stop.tolerance:
            return Solution(first, Status.SOLVED, 0)
        for phase in self.phases:
            outcome = outer.run(phase, shift, first)
            if outcome is not None:
                break
            first = np.zeros(self.problem.n_rows)
            shift = lift(self.problem, self.problem.free_velocity)
        status, reason = outcome or Outcome(Status.STALLED, outer.stall_reason)
        return Solution(outer.best, status, outer.iteration, reason)


def lift(problem: ContactProblem, velocity: FloatArray) -> FloatArray:
    """Return s = μ‖ξ_T‖ + μ_r‖ξ_R‖ [m/s] of each block, shape (n_blocks,), from ξ over rows."""
    layout, lanes = problem.layout, problem.layout.pad(velocity)
    first = 1 + layout.sliding
    lifted: FloatArray = layout.friction_coefficient * np.sqrt((lanes[:, 1:first] ** 2).sum(axis=1))
    if layout.rolling:
        lifted += layout.rolling_coefficient * np.sqrt((lanes[:, first:] ** 2).sum(axis=1))
    return lifted


def shifted_velocity(problem: ContactProblem, shift: FloatArray) -> FloatArray:
    """Return c + s e_N over rows [m/s] from s, shape (n_blocks,)."""
    lanes = problem.layout.pad(problem.free_velocity)
    lanes[:, 0] += shift
    velocity: FloatArray = problem.layout.unpad(lanes)
    return velocity


@dataclass
class _Outer:
    """The outer iteration of one solve; ``lowest`` is the residual of ``best``; ``iteration`` counts cone programs."""

    prepared: PreparedFixedPoint
    stop: Stop
    observe: Observer | None
    best: FloatArray
    lowest: float
    iteration: int = 0
    stall_reason: str = ""
    _inner_iterations: int = 0
    clock: Clock = field(init=False)
    correction: Correction = field(init=False)

    def __post_init__(self) -> None:
        self.clock = Clock(self.stop.max_seconds)
        self.correction = self.prepared.correction(self.clock, self.stop.tolerance)

    def run(self, phase: Phase, shift: FloatArray, impulses: FloatArray) -> Outcome | None:
        """Iterate from s and Λ; return the outcome if the solve is over, or None if only the phase is over."""
        problem, program, memory = self.prepared.problem, self.prepared.program, self.prepared.memory
        alpha, weight = _alpha(problem), np.zeros(problem.n_rows)
        if phase.weight > 0.0:
            weight = phase.weight * alpha
            program = program.regularised(weight)
        anderson = Anderson(memory)
        self.correction.begin_phase()
        lowest, floor, n_stale, previous = 1.0, MIN_TOLERANCE, 0, self.best
        while self.iteration < self.stop.max_iterations:
            accuracy = min(max((INNER_ERROR * lowest) ** 2, floor), MAX_TOLERANCE)
            vector = shifted_velocity(problem, shift) - weight * impulses
            result = program.run(vector, accuracy, INNER_ITERATIONS, self.clock.remaining)
            self.iteration, self._inner_iterations = self.iteration + 1, self._inner_iterations + result.iterations
            self.stall_reason = f"the residual stays at {self.lowest:.1e}; the conic solver {result.status}"
            if result.status is ConicStatus.UNBOUNDED or not np.isfinite(result.impulses).all():
                self.stall_reason = f"the conic solver {result.status} at residual {self.lowest:.1e}"
                self._record(self.best, self.lowest)  # the observer receives one Λ per iteration, even after a failure
                return self._time_limit(result)
            velocity = problem.relative_velocity(result.impulses)
            residual = self.prepared.residual.judged(problem, result.impulses)
            if result.status is ConicStatus.GAVE_UP and residual > PROGRESS * lowest and floor < MAX_TOLERANCE:
                floor *= TOLERANCE_GROWTH
            n_stale = 0 if residual < phase.progress * lowest else n_stale + 1
            corrected, corrected_residual = self.correction.correct(
                result.impulses, residual, n_stale == phase.patience
            )
            self._record(corrected, corrected_residual)
            if self.lowest <= self.stop.tolerance:
                return Outcome(Status.SOLVED, "")
            limit = self._time_limit(result)
            is_over = n_stale >= phase.patience and (
                phase is not PHASES[-1] or self._repeats(result.impulses, previous)
            )
            if limit is not None or is_over:
                return limit
            previous = result.impulses
            lowest = min(lowest, residual)
            if corrected_residual < CORRECTION_SUCCESS * residual:
                impulses, shift = corrected, lift(problem, problem.relative_velocity(corrected))
                anderson.restart()
                continue
            if residual > RESTART_GROWTH * lowest:
                anderson.restart()
            point, image = [shift], [lift(problem, velocity)]
            if phase.weight > 0.0:
                point, image = [*point, alpha * impulses], [*image, alpha * result.impulses]
            mixed = anderson.next(np.concatenate(point), np.concatenate(image))
            shift = np.maximum(mixed[: len(shift)], 0.0)
            impulses = mixed[len(shift) :] / alpha if phase.weight > 0.0 else impulses
        return Outcome(Status.ITERATION_LIMIT, self._progress_text())

    def _record(self, impulses: FloatArray, residual: float) -> None:
        """Keep Λ if it is the best so far, and pass it to the observer."""
        if residual < self.lowest:
            self.best, self.lowest = impulses, residual
        self.clock.show(self.observe, self.iteration, impulses)

    def _repeats(self, newest_impulses: FloatArray, previous_impulses: FloatArray) -> bool:
        """Whether cone programs repeat their impulses, or rounding explains the best residual."""
        repeats = np.abs(newest_impulses - previous_impulses) <= ROUNDING * np.abs(newest_impulses)
        return bool(repeats.all()) or self.lowest <= self.prepared.residual.rounding(self.best)

    def _time_limit(self, result: ConicResult) -> Outcome | None:
        """Return the time limit as the outcome if it has passed by this clock or by that of the conic solver."""
        if result.status is ConicStatus.TIME_LIMIT or self.clock.has_expired:
            return Outcome(Status.TIME_LIMIT, self._progress_text())
        return None

    def _progress_text(self) -> str:
        programs = "cone program" if self.iteration == 1 else "cone programs"
        return (
            f"residual {self.lowest:.1e} after {self.iteration} {programs} with {self._inner_iterations} steps in all"
        )


def _alpha(problem: ContactProblem) -> FloatArray:
    """Return the largest diagonal entry of each row's block of G [1/kg] or, if that is zero, of all blocks."""
    alpha = problem.layout.unpad(np.repeat(largest_curvatures(problem), problem.layout.width))
    return alpha / row_lengths(problem) ** 2 if problem.layout.rolling else alpha
