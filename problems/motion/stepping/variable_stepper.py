"""Moreau's rule with a variable step (Studer & Glocker 2005, section 6).

Steps are long where the motion is smooth, and tiny at switching points. At a switching point a law changes its state
between two steps (``law_states``). A search chooses the lengths of the next trials until a minimal step contains the
switching point. This step is accepted without an error estimate. Between switching points, sequences of steps are
compared to estimate the error of each step. The step shrinks if the error is too large, and grows where the motion is
smooth. The relative error of a step is the largest of

    |Δq_i| / Q_i,   |Δu_i| / U_i,      U_i = √(M⁻¹)_ii max_j |u_j| / √(M⁻¹)_jj,   Q_i = max(range of q_i, U_i Δt_max)

over all coordinates j and all times so far. The range of q_i is its largest distance from the start. U_i is the speed
at which coordinate i has the largest kinetic energy that any coordinate has had. The error does not depend on units,
and U_i vanishes only if nothing moves. M⁻¹h Δt_max counts as a velocity at the start.
"""

from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from time import perf_counter

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError, error_text, suggestion
from ..bodies.system import System
from ..scenes.scene import Scene
from ..state import State
from .sequences import Attempt, StepCounter, UnsolvedStepError, take_sequence
from .step import AcceptedStep, LawStates, Step, StepError, SwitchingPoint, check_finite, law_states
from .stepper import MotionSetup, Stepper
from .switch_search import SEARCHES

SAFETY = 0.85
"""Ratio of the next step to the step that the error estimate allows."""

MAX_GROWTH = 50.0
"""Largest ratio of a step to the step before it, unless the number of sequences grows."""

MIN_SHRINKING = 0.1
"""Smallest ratio of a repeated step to the rejected step."""

MIN_ULPS = 64.0
"""Smallest ratio of the minimal step to the floating-point spacing of times."""

LENGTH_TOLERANCE = 1e-9
"""Relative difference up to which two lengths of steps count as equal."""


class VariableStepper(Stepper):
    """Base class of variable steppers; subclasses declare the attributes as options, and compare sequences of steps.

    They ignore the ``depth`` of a scene: positions are not projected.

    Attributes:
        tolerance: relative error of one smooth step, between 0 and 1.
        min_step: Δt_min [s], the accuracy of switching points. A contact that closes with velocity v keeps the depth
            v Δt_min/2. If errors of the solver and rounding exceed this depth, the contact opens and closes repeatedly.
        max_step: Δt_max [s]; that of the scene if None.
        search: method that locates switching points: "anticipating", "nested" or "last".
        max_levels: largest number of sequences of 1, 2, … steps to compare.

    Raises:
        ProblemError: if the search is unknown; the message suggests the nearest name.
    """

    tolerance: float
    min_step: float
    max_step: float | None
    search: str

    def __post_init__(self) -> None:
        if self.search not in SEARCHES:
            raise ProblemError(f"there is no search {self.search!r}{suggestion(self.search, SEARCHES)}")

    @property
    @abstractmethod
    def max_levels(self) -> int:
        """Largest number of sequences of 1, 2, … steps to compare."""

    @abstractmethod
    def compute_row(self, row: list[FloatArray], first: FloatArray, system: System) -> list[FloatArray]:
        """Compute row n of the table of results from row n−1 and T_{n,1}; its last two entries differ by the error.

        An entry is (q, u) at the end of the step; T_{n,1} is the result of a sequence of n steps.
        """

    @abstractmethod
    def error_order(self, levels: int, system: System) -> int:
        """Return the order of the error estimate of ``levels`` sequences, as a power of the step."""

    def complete_attempt(self, sequence: Attempt, last: FloatArray, time: float) -> Attempt:
        """Complete the attempt of ``sequence``, which gave T_{n,1}; its row ends with ``last`` at ``time`` [s]."""
        return sequence

    def shortest_step(self, scene: Scene) -> float:
        """Return Δt_min [s]."""
        return self.min_step

    def longest_step(self, scene: Scene) -> float:
        """Return Δt_max [s]."""
        return scene.longest_step if self.max_step is None else self.max_step

    def check(self, scene: Scene, begin: float, until: float) -> None:
        """Check the options and times, and that Δt_min separates floating-point times.

        Raises:
            ProblemError: if an option or a time is out of range, or Δt_min is too short.
        """
        longest = self.longest_step(scene)
        if not 0.0 < self.tolerance < 1.0:
            raise ProblemError(f"tolerance must be between 0 and 1, got {self.tolerance}.")
        if not 0.0 < self.min_step < np.inf:
            raise ProblemError(f"min_step must be positive, got {self.min_step}.")
        if not self.min_step <= longest < np.inf:
            raise ProblemError(f"max_step must be finite and at least min_step = {self.min_step}, got {longest}.")
        if not begin < until < np.inf:
            raise ProblemError(f"until = {until} s must be finite and after the start at {begin} s.")
        shortest = MIN_ULPS * float(np.spacing(max(abs(begin), abs(until))))
        if self.min_step < shortest:
            raise ProblemError(
                f"min_step = {self.min_step} s is too short to separate times up to {until} s; choose at least "
                f"{shortest:.1g} s."
            )

    def follow(self, setup: MotionSetup) -> Iterator[AcceptedStep]:
        """Yield the accepted steps of a motion.

        Raises:
            ProblemError: as ``check`` does.
            StepError: if an inclusion cannot be solved even over the minimal step, or the motion is no longer finite.
        """
        start = setup.start
        self.check(setup.scene, start.time, setup.until)
        try:
            control = _StepControl(self, setup)
        except Exception as failure:
            reason = error_text(failure)
            raise StepError(f"the motion cannot start at t = {start.time:.9g} s: {reason}.", start) from failure
        return _with_step_costs(control.steps())

    def attempt(
        self,
        counter: StepCounter,
        state: State,
        length: float,
        states: LawStates | None,
        *,
        relative_error: Callable[[FloatArray], float],
        levels: int,
    ) -> Attempt:
        """Try one step of ``length`` [s] in which no law leaves ``states``.

        Args:
            counter: takes the steps and counts them.
            state: state at the beginning of the step.
            length: length of the step [s].
            states: states of the laws in the step before; None permits all states.
            relative_error: difference of (q, u) ↦ relative error.
            levels: largest number of sequences.

        Returns:
            The attempt; its ``end`` is None if a law switches within the step.

        Raises:
            UnsolvedStepError: if the solver does not solve the inclusion of a step.
        """
        row: list[FloatArray] = []
        errors: list[float] = []
        for n in range(1, min(self.max_levels, levels) + 1):
            sequence = take_sequence(counter, state, length, n, states)
            if sequence.end is None:
                return sequence
            states = sequence.states
            row = self.compute_row(row, np.concatenate([sequence.end.position, sequence.end.velocity]), counter.system)
            if n > 1:
                errors.append(relative_error(row[-1] - row[-2]))
                if errors[-1] <= self.tolerance:
                    break
        return self.complete_attempt(replace(sequence, errors=errors), row[-1], state.time + length)


class _StepControl:
    """Controller of the step lengths of one motion."""

    def __init__(self, stepper: VariableStepper, setup: MotionSetup) -> None:
        system = setup.scene.system
        self._stepper, self._counter = stepper, StepCounter(system, setup.solver, setup.stop)
        self._min_step, self._max_step = stepper.min_step, stepper.longest_step(setup.scene)
        self._search = SEARCHES[stepper.search](system, self._min_step, self._max_step)
        self._state, self._until = setup.start, setup.until
        self._states = self._states_before = setup.states
        self._scale = _Scale(system, self._max_step, setup.start)
        self._length = min(self._max_step, max(self._min_step, 1e-3 * self._max_step))
        self._trial_length = self._length
        self._levels = 2
        self._rejected = 0
        self._seconds = self._trial_start = 0.0
        self._saw_switch = False

    def steps(self) -> Iterator[AcceptedStep]:
        """Yield accepted steps with the costs since the start, except steps that a search withdraws."""
        pending: AcceptedStep | None = None  # accepted, but a search may still withdraw it
        while self._until - self._state.time > 1e-3 * self._min_step:
            try:
                accepted = self._try_timed()
            except StepError:
                if pending is not None:
                    yield pending
                raise
            if accepted is None:
                if pending is not None and self._saw_switch and self._search.withdraws_last_step:
                    # the switch may also lie in the step before the rejected one
                    self._state, self._states, pending = pending.begin, self._states_before, None
                    self._rejected += 1
                continue
            if pending is not None:
                yield pending
            pending = accepted
            if accepted.switches:
                yield pending
                pending = None
        if pending is not None:
            yield pending

    def _try_timed(self) -> AcceptedStep | None:
        """Try one step and time it; errors name the time at which the step begins."""
        self._trial_start = perf_counter()
        try:
            return self._try_step()
        except StepError:
            raise
        except (Exception, SystemExit) as failure:
            reason, time = error_text(failure), self._state.time
            raise StepError(
                f"a step of {self._trial_length:.3g} s from t = {time:.9g} s failed: {reason}.", self._state
            ) from failure
        finally:
            self._seconds += perf_counter() - self._trial_start

    def _try_step(self) -> AcceptedStep | None:
        """Try one step; return it if it is accepted."""
        stepper, state = self._stepper, self._state
        self._saw_switch = False
        remaining = self._until - state.time
        length = min(self._search.limited_length(state.time, min(self._length, self._max_step)), remaining)
        self._trial_length = length
        is_minimal = length <= self._min_step * (1.0 + LENGTH_TOLERANCE)
        try:
            attempt = stepper.attempt(
                self._counter,
                state,
                length,
                self._states,
                relative_error=self._scale.relative_error,
                levels=self._levels + 1,
            )
        except UnsolvedStepError as failure:
            self._reject_unsolved(length, is_minimal, str(failure))
            return None
        if attempt.end is None:
            if is_minimal:
                return self._take_switching_step(length)
            self._search_switch(length, attempt)
            return None
        check_finite(state, attempt.end)
        error = attempt.errors[-1]
        if error > stepper.tolerance and not is_minimal:
            self._rejected += 1
            order = stepper.error_order(attempt.levels, self._counter.system)
            factor = SAFETY * (stepper.tolerance / error) ** (1.0 / order)
            self._length = max(self._min_step, length * max(MIN_SHRINKING, factor))
            self._levels = min(self._levels, attempt.levels)
            return None
        if not is_minimal and self._search.has_passed_switch(state, attempt.end, attempt):
            self._search_switch(length, attempt)
            return None
        self._choose_next(length, attempt)
        return self._accept(attempt.end, error, attempt.states, tuple(attempt.substeps), ())

    def _search_switch(self, length: float, attempt: Attempt) -> None:
        """Reject an attempt of ``length`` because a law switches in it."""
        self._saw_switch = True
        self._rejected += 1
        self._length = self._search.length_after_switch(self._state.time, length, attempt)

    def _take_switching_step(self, length: float) -> AcceptedStep | None:
        """Take the minimal step that contains a switching point, without an error estimate."""
        begin = self._state
        try:
            step = self._counter.take(begin, length)
        except UnsolvedStepError as failure:
            self._reject_unsolved(length, True, str(failure))
            return None
        check_finite(begin, step.state)
        states = law_states(step)
        states_before = states if self._states is None else self._states
        switches = states.switches_since(states_before, begin.time, step.state.time)
        self._levels = 2
        # after a switch, the last impulses are a poor start for the next solve
        end = State(step.state.time, step.state.position, step.state.velocity) if switches else step.state
        accepted = self._accept(end, 0.0, states, ((step, length),), switches)
        if switches:
            self._length = 4.0 * length
            self._search.record_switch(end)
        return accepted

    def _reject_unsolved(self, length: float, is_minimal: bool, status: str) -> None:
        """Shorten the next trial after an unsolved inclusion, or raise ``StepError`` if the step was minimal."""
        if is_minimal:
            raise StepError(
                f"the inclusion of the shortest step, {length:.3g} s from t = {self._state.time:.9g} s, is not solved: "
                f"the solver returned {status!r}; allow more iterations or a looser tolerance, or change the solver.",
                self._state,
            )
        self._rejected += 1
        self._length = max(self._min_step, MIN_SHRINKING * length)

    def _accept(
        self,
        end: State,
        error: float,
        states: LawStates,
        substeps: tuple[tuple[Step, float], ...],
        switches: tuple[SwitchingPoint, ...],
    ) -> AcceptedStep:
        """Advance to ``end``, and return the step with the costs since the start."""
        begin = self._state
        self._search.record_step(substeps, states)
        self._states_before = self._states
        self._state, self._states = end, states
        self._scale.update(end)
        seconds = self._seconds + perf_counter() - self._trial_start
        counts = (self._counter.solves, self._counter.iterations, self._rejected)
        return AcceptedStep(begin, end, substeps, error, states, switches, *counts, seconds)

    def _choose_next(self, length: float, attempt: Attempt) -> None:
        """Choose the length and number of sequences with the least expected work per unit of time (Deuflhard 1983)."""
        n, errors = attempt.levels, attempt.errors
        lengths = {k: self._promising_length(length, errors[k - 2], k) for k in range(2, n + 1)}
        work = {k: 0.5 * k * (k + 1) / lengths[k] for k in lengths}
        chosen, next_length = n, lengths[n]
        if n > 2 and work[n - 1] < 0.8 * work[n]:
            chosen, next_length = n - 1, lengths[n - 1]
        elif n < self._stepper.max_levels and (n == 2 or work[n] < 0.9 * work[n - 1]):
            chosen, next_length = n + 1, lengths[n] * (n + 2) / n
        self._levels = chosen
        self._length = max(self._min_step, self._search.length_after_step(self._state.time, length, next_length))

    def _promising_length(self, length: float, error: float, levels: int) -> float:
        """Return the next length for ``levels`` sequences, whose error in a step of ``length`` is ``error``."""
        order = self._stepper.error_order(levels, self._counter.system)
        factor: float = SAFETY * (self._stepper.tolerance / max(error, 1e-300)) ** (1.0 / order)
        return length * min(MAX_GROWTH, max(MIN_SHRINKING, factor))


def _with_step_costs(steps: Iterator[AcceptedStep]) -> Iterator[AcceptedStep]:
    """Convert the costs since the start, which ``steps`` contain, to the costs of each step."""
    solves, iterations, rejected, seconds = 0, 0, 0, 0.0
    for step in steps:
        yield replace(
            step,
            solves=step.solves - solves,
            iterations=step.iterations - iterations,
            rejected=step.rejected - rejected,
            seconds=step.seconds - seconds,
        )
        solves, iterations, rejected, seconds = step.solves, step.iterations, step.rejected, step.seconds


class _Scale:
    """The scales Q of positions and U of velocities; see the module docstring."""

    def __init__(self, system: System, max_step: float, start: State) -> None:
        assembly = system.assemble(start.position, start.velocity, max_step)
        self._mobility = np.sqrt(assembly.inverse_mass.matrix.diagonal())
        self._system, self._max_step, self._start_position = system, max_step, start.position
        self._momentum = 0.0
        self._range = np.zeros(len(start.position))
        self._update_velocity(start.velocity)
        self._update_velocity(assembly.free_motion - start.velocity)

    def update(self, state: State) -> None:
        """Update the scales with a state of the motion."""
        self._update_velocity(state.velocity)
        self._range = np.maximum(self._range, np.abs(state.position - self._start_position))

    def relative_error(self, difference: FloatArray) -> float:
        """Return the relative error of a difference of (q, u); 0/0 is 0."""
        speed = self._momentum * self._mobility
        travel = np.abs(self._system.move(self._start_position, speed, self._max_step) - self._start_position)
        scale = np.concatenate([np.maximum(self._range, travel), speed])
        size = np.abs(difference)
        relative_error = np.divide(size, scale, out=np.where(size > 0.0, np.inf, 0.0), where=scale > 0.0)
        return float(relative_error.max(initial=0.0))

    def _update_velocity(self, velocity: FloatArray) -> None:
        self._momentum = max(self._momentum, float((np.abs(velocity) / self._mobility).max(initial=0.0)))
