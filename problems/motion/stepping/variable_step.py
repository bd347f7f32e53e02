"""Moreau's rule with a variable step (Studer & Glocker 2005, section 6): long where smooth, tiny at switching points.

A switching point is a law that projects in one step and not in the next (``law_states``). It is located to the minimal
step by a search, which decides what is tried next, and the one minimal step that contains it is taken as it is. Between
switching points a scheme (``extrapolation``) estimates the error of each step; the step is cut where that is too large,
and grows where the motion is smooth. The relative error of a step is the largest of

    |Δq_i| / Q_i,   |Δu_i| / U_i,      U_i = √(M⁻¹)_ii max_j |u_j| / √(M⁻¹)_jj,   Q_i = max(range of q_i, U_i Δt_max)

over all coordinates j, and all times so far: as fast as i would move with the energy of the fastest coordinate, so that
it depends on no unit and vanishes only where nothing moves. M⁻¹h Δt_max counts as a velocity at the start.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError, error_text
from ..bodies.system import System
from ..state import State
from .accepted_step import AcceptedStep
from .contact_states import LawStates, SwitchingPoint, law_states
from .extrapolation import Acceptance, Attempt, Extrapolation, OneStep, Scheme, UnsolvedStepError
from .moreau import ContactSolver, Step, StepError, check_finite
from .switching import Anticipating, Search

SAFETY = 0.85
"""Share that is tried of the step which the error estimate allows."""

MOST_GROWTH = 50.0
"""A step is at most this many times the one before."""

LEAST_SHRINKING = 0.1
"""A step that was too inaccurate is tried again with at least this fraction of its length."""

LEAST_ULPS = 64.0
"""The minimal step is at least this many times the spacing of the numbers that times are."""

SLACK = 1.0 + 1e-9
"""Lengths that differ by less are equal."""


@dataclass(frozen=True)
class VariableStep:
    """The variable step.

    Attributes:
        system: what moves.
        solver: any solver of the framework.
        stop: the stop criterion handed to the solver at each one-step inclusion.
        tolerance: relative error of one smooth step.
        min_step: Δt_min [s], to which switching points are located. A contact that closes with the velocity v is left
            v Δt_min / 2 deep: where solver tolerance and rounding move it by more until it opens, it flickers.
        max_step: Δt_max [s].
        scheme: how smooth steps are taken.
        search: makes the search for switching points.

    Raises:
        ProblemError: if a number is out of range.
    """

    system: System
    solver: ContactSolver
    stop: Any
    tolerance: float = 1e-6
    min_step: float = 1e-8
    max_step: float = 1e-2
    scheme: Scheme = field(default_factory=Extrapolation)
    search: type[Search] = Anticipating

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise ProblemError(f"tolerance must be between 0 and 1, got {self.tolerance}.")
        if not 0.0 < self.min_step < np.inf:
            raise ProblemError(f"min_step must be positive, got {self.min_step}.")
        if not self.min_step <= self.max_step < np.inf:
            raise ProblemError(f"max_step must be finite and at least min_step = {self.min_step}, got {self.max_step}.")

    def check_times(self, begin: float, until: float) -> None:
        """Check that there is a motion from ``begin`` to ``until`` [s].

        Raises:
            ProblemError: if ``until`` is not after ``begin``, or the minimal step too short to separate times.
        """
        if not begin < until < np.inf:
            raise ProblemError(f"until = {until} s must be finite and after the start at {begin} s.")
        shortest = LEAST_ULPS * float(np.spacing(max(abs(begin), abs(until))))
        if self.min_step < shortest:
            raise ProblemError(
                f"min_step = {self.min_step} s is too short to separate times up to {until} s; choose at least "
                f"{shortest:.1g} s."
            )

    def steps(self, start: State, until: float, states: LawStates | None = None) -> Iterator[AcceptedStep]:
        """Yield the accepted steps from ``start`` to the time ``until`` [s].

        Args:
            start: where the motion begins.
            until: when it ends [s].
            states: states of the laws in the step that led to ``start``, if there was one.

        Raises:
            ProblemError: if ``until`` is not after the start, or the minimal step too short to separate times.
            StepError: if an inclusion cannot be solved even over the minimal step, or the motion is no longer finite.
        """
        self.check_times(start.time, until)
        try:
            course = _Course(self, start, until, states)
        except Exception as failure:
            what = error_text(failure)
            raise StepError(f"the motion cannot begin at t = {start.time:.9g} s: {what}.", start) from failure
        return _with_own_costs(course.steps())


class _Course:
    """One motion under way."""

    def __init__(self, plan: VariableStep, start: State, until: float, states: LawStates | None) -> None:
        self._plan, self._until = plan, until
        self._rule = OneStep(plan.system, plan.solver, plan.stop)
        self._search = plan.search(plan.system, plan.min_step, plan.max_step)
        self._state = start
        self._states = self._states_before = states
        self._scale = _Scale(plan, start)
        self._length = min(plan.max_step, max(plan.min_step, 1e-3 * plan.max_step))
        self._trying = self._length
        self._levels = 2
        self._rejected = 0
        self._spent = self._began = 0.0
        self._saw_switch = False

    def steps(self) -> Iterator[AcceptedStep]:
        """Yield accepted steps, with their costs since the start; those that a search takes back are never shown."""
        held: AcceptedStep | None = None  # accepted, but a search may still take it back
        while self._until - self._state.time > 1e-3 * self._plan.min_step:
            try:
                taken = self._tried()
            except StepError:
                if held is not None:
                    yield held
                raise
            if taken is None:
                if held is not None and self._takes_back(held):
                    self._state, self._states, held = held.begin, self._states_before, None
                    self._rejected += 1
                continue
            if held is not None:
                yield held
            held = taken
            if taken.switches:
                yield held
                held = None
        if held is not None:
            yield held

    def _takes_back(self, held: AcceptedStep) -> bool:
        """Whether the step before a rejected one has to be redone too: it is as suspect, and can still be shortened."""
        is_longer = held.end.time - held.begin.time > self._plan.min_step * SLACK
        return self._saw_switch and self._search.takes_back and is_longer

    def _tried(self) -> AcceptedStep | None:
        """Try one step; say when it was, whatever fails in it."""
        self._began = perf_counter()
        try:
            return self._next()
        except StepError:
            raise
        except (Exception, SystemExit) as failure:
            what, time = error_text(failure), self._state.time
            raise StepError(
                f"a step of {self._trying:.3g} s from t = {time:.9g} s failed: {what}.", self._state
            ) from failure
        finally:
            self._spent += perf_counter() - self._began

    def _next(self) -> AcceptedStep | None:
        """Try one step; return it if it was accepted."""
        plan, state = self._plan, self._state
        self._saw_switch = False
        left = self._until - state.time
        length = min(self._search.limited(state.time, min(self._length, plan.max_step)), left)
        self._trying = length
        is_minimal = length <= plan.min_step * SLACK
        accept = Acceptance(plan.tolerance, self._scale.relative, self._levels + 1)
        try:
            attempt = plan.scheme.attempt(self._rule, state, length, self._states, accept)
        except UnsolvedStepError as failure:
            self._unsolved(length, is_minimal, str(failure))
            return None
        if attempt.end is None:
            if is_minimal:
                return self._switched(length)
            self._search_on(length, attempt)
            return None
        check_finite(state, attempt.end)
        error = attempt.errors[-1]
        if error > plan.tolerance and not is_minimal:
            self._rejected += 1
            factor = SAFETY * (plan.tolerance / error) ** (1.0 / plan.scheme.order(attempt.levels, plan.system))
            self._length = max(plan.min_step, length * max(LEAST_SHRINKING, factor))
            self._levels = min(self._levels, attempt.levels)
            return None
        if not is_minimal and self._search.oversteps(state, attempt.end, attempt):
            self._search_on(length, attempt)
            return None
        self._choose_next(length, attempt)
        return self._accepted(attempt.end, error, attempt.states, tuple(attempt.substeps), ())

    def _search_on(self, length: float, attempt: Attempt) -> None:
        """Reject an attempt of ``length`` because a law switches in it."""
        self._saw_switch = True
        self._rejected += 1
        self._length = self._search.after_switch(self._state.time, length, attempt)

    def _switched(self, length: float) -> AcceptedStep | None:
        """Take the minimal step that contains a switching point as it is."""
        begin = self._state
        try:
            step = self._rule.take(begin, length)
        except UnsolvedStepError as failure:
            self._unsolved(length, True, str(failure))
            return None
        check_finite(begin, step.state)
        found = law_states(step)
        known = self._states if self._states is not None else found
        switches = found.switches_since(known, begin.time, step.state.time)
        self._levels = 2
        # a force that lasts is no guess for the next step where a law has switched
        end = State(step.state.time, step.state.position, step.state.velocity) if switches else step.state
        taken = self._accepted(end, 0.0, found, ((step, length),), switches)
        if switches:
            self._length = 4.0 * length
            self._search.forget(end)
        return taken

    def _unsolved(self, length: float, is_minimal: bool, status: str) -> None:
        if is_minimal:
            raise StepError(
                f"the inclusion of the shortest step, {length:.3g} s from t = {self._state.time:.9g} s, is not solved: "
                f"the solver ended with {status!r}; allow it more iterations or a looser tolerance, or choose another.",
                self._state,
            )
        self._rejected += 1
        self._length = max(self._plan.min_step, LEAST_SHRINKING * length)

    def _accepted(
        self,
        end: State,
        error: float,
        states: LawStates,
        substeps: tuple[tuple[Step, float], ...],
        switches: tuple[SwitchingPoint, ...],
    ) -> AcceptedStep:
        begin = self._state
        self._search.passed(substeps, states)
        self._states_before = self._states
        self._state, self._states = end, states
        self._scale.note(end)
        seconds = self._spent + perf_counter() - self._began
        return AcceptedStep(begin, end, substeps, error, states, switches, self._rule.solves, self._rejected, seconds)

    def _choose_next(self, length: float, attempt: Attempt) -> None:
        """Choose length and number of sequences that promise the least work for a unit of time (Deuflhard 1983)."""
        n, errors = attempt.levels, attempt.errors
        lengths = {k: self._promising(length, errors[k - 2], k) for k in range(2, n + 1)}
        work = {k: 0.5 * k * (k + 1) / lengths[k] for k in lengths}
        chosen, next_length = n, lengths[n]
        if n > 2 and work[n - 1] < 0.8 * work[n]:
            chosen, next_length = n - 1, lengths[n - 1]
        elif n < self._plan.scheme.levels and (n == 2 or work[n] < 0.9 * work[n - 1]):
            chosen, next_length = n + 1, lengths[n] * (n + 2) / n
        self._levels = chosen
        self._length = max(self._plan.min_step, self._search.grown(self._state.time, length, next_length))

    def _promising(self, length: float, error: float, levels: int) -> float:
        order = self._plan.scheme.order(levels, self._plan.system)
        wanted: float = SAFETY * (self._plan.tolerance / max(error, 1e-300)) ** (1.0 / order)
        return length * min(MOST_GROWTH, max(LEAST_SHRINKING, wanted))


def _with_own_costs(steps: Iterator[AcceptedStep]) -> Iterator[AcceptedStep]:
    """Yield steps that hold their costs since the start with what each of them cost."""
    solves, rejected, seconds = 0, 0, 0.0
    for step in steps:
        own = (step.solves - solves, step.rejected - rejected, step.seconds - seconds)
        solves, rejected, seconds = step.solves, step.rejected, step.seconds
        yield replace(step, solves=own[0], rejected=own[1], seconds=own[2])


class _Scale:
    """What differences of positions and velocities are related to, see above."""

    def __init__(self, plan: VariableStep, start: State) -> None:
        assembly = plan.system.assemble(start.position, start.velocity, plan.max_step)
        self._mobility = np.sqrt(assembly.inverse_mass.matrix.diagonal())
        self._system, self._max_step, self._first = plan.system, plan.max_step, start.position
        self._momentum = 0.0
        self._range = np.zeros(len(start.position))
        self._note_velocity(start.velocity)
        self._note_velocity(assembly.free_motion - start.velocity)

    def note(self, state: State) -> None:
        """Note how far and how fast the motion has come."""
        self._note_velocity(state.velocity)
        self._range = np.maximum(self._range, np.abs(state.position - self._first))

    def relative(self, difference: FloatArray) -> float:
        """Return the relative error of a difference of (q, u); 0/0 is 0."""
        speed = self._momentum * self._mobility
        travel = np.abs(self._system.move(self._first, speed, self._max_step) - self._first)
        scale = np.concatenate([np.maximum(self._range, travel), speed])
        size = np.abs(difference)
        relative = np.divide(size, scale, out=np.where(size > 0.0, np.inf, 0.0), where=scale > 0.0)
        return float(relative.max(initial=0.0))

    def _note_velocity(self, velocity: FloatArray) -> None:
        self._momentum = max(self._momentum, float((np.abs(velocity) / self._mobility).max(initial=0.0)))
