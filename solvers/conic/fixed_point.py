"""Coulomb friction by De Saxcé's fixed point over cone programs (De Saxcé & Feng 1998; Acary & Cadoux 2013).

Coulomb's law is the associated law for the velocity whose normal part is raised by s = μ‖ξ_T‖ (and by μ_r‖ξ_R‖ more
where there is rolling friction),

    −(ξ + s e_N) ∈ N_K(Λ),      s = μ ‖ξ_T‖      for every contact,

so each outer iteration solves one cone program with c_N + s and takes s from the velocity that results: s ← F(s). The
plain iteration converges linearly, and slowly on many contacts; Anderson acceleration of s ≥ 0 shortens it. Where
mixing lets the residual rise far above its best value, the pairs are forgotten and the plain iteration goes on.

F exists where the cone program has a solution, that is on D = {s : some velocity WᵀM⁻¹… + c + s e_N lies in K*}, a
convex set that holds every s' ≥ s with s. Theory (Acary, Cadoux, Lemaréchal & Malick 2011) has a fixed point where
0 ∈ D, and the iteration stays in D then. Elsewhere F may lead out of D although there is a fixed point, and even in D
nothing makes F a contraction. So where it ends without one, a proximal iteration follows (nonsmooth proximal point
algorithm, Acary, Brémond & Huber 2018): with w_i = εα_i and (s, Λ) from the iterate before,

    Λ ← argmin { ½ yᵀGy + (c + s e_N)ᵀy + ½ (y − Λ)ᵀ diag(w) (y − Λ) : y ∈ K },      s ← μ ‖ξ_T‖.

G + diag(w) is positive definite: the program always has one solution, which depends continuously on (s, Λ). A fixed
point solves the problem itself; small ε goes far in a step, large ε damps what oscillates.

Iterates may be corrected by another method (``iteration.correction``), and the iteration goes on from there. No
decision depends on the tolerance: a solve to a tighter one begins with the same iterates, and ends no worse.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.coupling import row_lengths
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, Status, Stop
from ..iteration.anderson import Anderson
from ..iteration.clock import Clock
from ..iteration.correction import BeginCorrection, Correction, NoCorrection
from ..iteration.loop import first_impulses, refuted
from ..iteration.method import Method, check_option
from ..iteration.stopping import ROUNDING
from .programs import ConicProgram, ConicResult, Ended, largest_curvatures

LOOSEST = 1e-8
"""The largest tolerance of a cone program: its solution has an error of about the root of it."""

TIGHTEST = 1e-13
"""A conic solver's tolerance below which its factorisations begin to fail."""

INNER = 1e-2
"""Error that a cone program may have, relative to the best residual so far."""

LOOSENING = 100.0
"""Factor on the least tolerance when the conic solver gives up and its result is no progress either."""

PROGRESS = 0.95
"""A residual below this fraction of the best one is progress."""

RISE = 10.0
"""The pairs of the acceleration are forgotten when the residual exceeds its best value by this factor."""

INNER_ITERATIONS = 1_000_000
"""Limit of iterations of one cone program, which each conic solver lowers to what makes sense for it."""

JUMP = 0.1
"""The iteration goes on from a corrected iterate whose residual is below this share of what it was."""


@dataclass(frozen=True)
class Phase:
    """One way to iterate, with ε (0 for De Saxcé's iteration as it is), for so long without progress."""

    weight: float
    patience: int


PHASES = (Phase(0.0, 25), Phase(0.01, 50), Phase(0.1, 50), Phase(1.0, 50))
"""One after the other; each but the first begins at Λ = 0. The last goes on to the limits, unless nothing moves."""


def check_memory(memory: int) -> None:
    """Raise ``SolverError`` unless ``memory`` is a number of pairs."""
    check_option("memory", memory, isinstance(memory, int) and memory >= 0, "a whole number, 0 or more")


class FixedPointMethod(Method, ABC):
    """A solver by the fixed point over cone programs, whose iterates may be corrected (``iteration.correction``)."""

    memory: int

    @abstractmethod
    def program(self, problem: ContactProblem) -> ConicProgram:
        """Return the program of ``problem``, set up once for all outer iterations."""

    def prepare(self, problem: ContactProblem) -> "PreparedFixedPoint":
        """Set the program up."""
        return self.prepare_corrected(problem, NoCorrection)

    def prepare_corrected(self, problem: ContactProblem, begin: BeginCorrection) -> "PreparedFixedPoint":
        """Do the same; the iterates of each solve are corrected by what ``begin`` returns for it."""
        self.check_supports(problem)
        return PreparedFixedPoint(problem, Residual(problem), self.program(problem), self.memory, begin)


@dataclass(frozen=True)
class PreparedFixedPoint:
    """The outer iteration over the cone program of one problem."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    program: ConicProgram = field(repr=False)
    memory: int
    correction: BeginCorrection = NoCorrection

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Iterate to the judge's residual; ``iterations`` counts cone programs, and ``start`` gives the first s."""
        first = first_impulses(self.problem, self.residual, start)
        if self.residual.infeasible:
            return refuted(self.problem)
        velocity = self.problem.relative_velocity(first)
        shift = np.zeros(self.problem.n_contacts) if start is None else lift(self.problem, velocity)
        outer = _Outer(self, stop, observe, first, self.residual.judged(self.problem, first))
        if outer.lowest <= stop.tolerance:
            return Solution(first, Status.SOLVED, 0)
        for phase in PHASES:
            ended = outer.follow(phase, shift, first)
            if ended is not None:
                break
            first = np.zeros(self.problem.n_rows)
            shift = lift(self.problem, self.problem.free_velocity)
        status, reason = ended or (Status.STALLED, outer.stalled)
        return Solution(outer.best, status, outer.iteration, reason)


def lift(problem: ContactProblem, velocity: FloatArray) -> FloatArray:
    """Return s = μ‖ξ_T‖ + μ_r‖ξ_R‖ [m/s] of each block, shape (n_blocks,), from ξ over rows."""
    layout, lanes = problem.layout, problem.layout.pad(velocity)
    first = 1 + layout.sliding
    lifted: FloatArray = layout.friction_coefficient * np.sqrt((lanes[:, 1:first] ** 2).sum(axis=1))
    if layout.rolling:
        lifted += layout.rolling_coefficient * np.sqrt((lanes[:, first:] ** 2).sum(axis=1))
    return lifted


def raised(problem: ContactProblem, shift: FloatArray) -> FloatArray:
    """Return c + s e_N over rows [m/s] from s, shape (n_blocks,)."""
    lanes = problem.layout.pad(problem.free_velocity)
    lanes[:, 0] += shift
    velocity: FloatArray = problem.layout.unpad(lanes)
    return velocity


@dataclass
class _Outer:
    """The outer iteration of one solve: ``lowest`` is the residual of ``best``, ``iteration`` counts cone programs."""

    prepared: PreparedFixedPoint
    stop: Stop
    observe: Observer | None
    best: FloatArray
    lowest: float
    iteration: int = 0
    stalled: str = ""
    _inner: int = 0
    clock: Clock = field(init=False)
    correction: Correction = field(init=False)

    def __post_init__(self) -> None:
        self.clock = Clock(self.stop.max_seconds)
        self.correction = self.prepared.correction(self.clock, self.stop.tolerance)

    def follow(self, phase: Phase, shift: FloatArray, impulses: FloatArray) -> tuple[Status, str] | None:
        """Iterate from s and Λ; return status and reason if the solve is over, None if only the phase is."""
        problem, program, memory = self.prepared.problem, self.prepared.program, self.prepared.memory
        alpha, weight = _alpha(problem), np.zeros(problem.n_rows)
        if phase.weight > 0.0:
            weight = phase.weight * alpha
            program = program.regularised(weight)
        anderson = Anderson(memory)
        self.correction.begin_phase()
        lowest, floor, waited, previous = 1.0, TIGHTEST, 0, self.best
        while self.iteration < self.stop.max_iterations:
            accuracy = min(max((INNER * lowest) ** 2, floor), LOOSEST)
            vector = raised(problem, shift) - weight * impulses
            result = program.run(vector, accuracy, INNER_ITERATIONS, self.clock.left)
            self.iteration, self._inner = self.iteration + 1, self._inner + result.iterations
            self.stalled = f"the residual stays at {self.lowest:.1e}; the conic solver ended with {result.ended}"
            if result.ended is Ended.UNBOUNDED or not np.isfinite(result.impulses).all():
                self.stalled = f"the conic solver ended with {result.ended} at residual {self.lowest:.1e}"
                self._note(self.best, self.lowest)  # an iteration that found nothing is one all the same
                return self._late(result)
            velocity = problem.relative_velocity(result.impulses)
            residual = self.prepared.residual.judged(problem, result.impulses)
            if result.ended is Ended.GAVE_UP and residual > PROGRESS * lowest and floor < LOOSEST:
                floor *= LOOSENING
            waited = 0 if residual < PROGRESS * lowest else waited + 1
            found, reached = self.correction.corrected(result.impulses, residual, waited == phase.patience)
            self._note(found, reached)
            if self.lowest <= self.stop.tolerance:
                return Status.SOLVED, ""
            late = self._late(result)
            is_over = waited >= phase.patience and (phase is not PHASES[-1] or self._repeats(result.impulses, previous))
            if late is not None or is_over:
                return late
            previous = result.impulses
            lowest = min(lowest, residual)
            if reached < JUMP * residual:
                impulses, shift = found, lift(problem, problem.relative_velocity(found))
                anderson.forget()
                continue
            if residual > RISE * lowest:
                anderson.forget()
            point, image = [shift], [lift(problem, velocity)]
            if phase.weight > 0.0:
                point, image = [*point, alpha * impulses], [*image, alpha * result.impulses]
            mixed = anderson.next(np.concatenate(point), np.concatenate(image))
            shift = np.maximum(mixed[: len(shift)], 0.0)
            impulses = mixed[len(shift) :] / alpha if phase.weight > 0.0 else impulses
        return Status.ITERATION_LIMIT, self._so_far()

    def _note(self, impulses: FloatArray, residual: float) -> None:
        """Keep the best Λ, and show this one."""
        if residual < self.lowest:
            self.best, self.lowest = impulses, residual
        self.clock.show(self.observe, self.iteration, impulses)

    def _repeats(self, newest: FloatArray, previous: FloatArray) -> bool:
        """Whether cone programs repeat their impulses, or rounding is all that the best residual is made of."""
        repeats = np.abs(newest - previous) <= ROUNDING * np.abs(newest)
        return bool(repeats.all()) or self.lowest <= self.prepared.residual.rounding(self.best)

    def _late(self, result: ConicResult) -> tuple[Status, str] | None:
        """Return the time limit if it is over, by this clock or by the conic solver's own."""
        if result.ended is Ended.TIME_LIMIT or self.clock.is_up:
            return Status.TIME_LIMIT, self._so_far()
        return None

    def _so_far(self) -> str:
        programs = "cone program" if self.iteration == 1 else "cone programs"
        return f"residual {self.lowest:.1e} after {self.iteration} {programs} of {self._inner} steps"


def _alpha(problem: ContactProblem) -> FloatArray:
    """Return the largest diagonal entry of each row's block of G [1/kg], that of all where it has none."""
    alpha = problem.layout.unpad(np.repeat(largest_curvatures(problem), problem.layout.width))
    return alpha / row_lengths(problem) ** 2 if problem.layout.rolling else alpha
