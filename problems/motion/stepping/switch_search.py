"""Searches for switching points: the length of the next trial after a law has switched, or before it switches.

``NestedIntervals`` is the search of Studer & Glocker (2005). The switch may lie in *either* of two successive steps
whose laws differ, so both are repeated with half the length, down to the minimal step (figure 3). ``LastStepOnly``
repeats only the second step. Its error does not converge, because a gap may have closed in the second half of the first
step, after the last evaluation. ``Anticipating`` approaches the switch from before, and needs four steps instead of
forty. It extrapolates the margins of all laws: a margin is positive while a law keeps its state, and zero when the law
switches.
    open contact      g                    the gap closes
    closed contact    Λ_N / Δt             the force vanishes
    sticking          (b − ‖Λ_T‖) / Δt     the friction force reaches its bound
    slipping          ‖γ_T‖                the sliding velocity vanishes

Forces belong to the middle of a step, gaps and velocities to its end. Each margin is extrapolated by polynomials
through its last few values; the difference between two degrees estimates the error of the root.
"""

from abc import ABC, abstractmethod
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence

import numpy as np

from ...arrays import FloatArray
from ..bodies.system import System
from ..state import State
from .sequences import Attempt
from .step import LawStates, Step, contact_lanes

APPROACH = 0.45
"""Length of the next trial as a fraction of the smooth part of a step in which a law switched."""

BLIND_CUT = 0.1
"""Length of the next trial as a fraction of the step in which a law switched, if no part of it was smooth."""

MEMORY = 5
"""Number of values of a margin to keep, one more than the degree of the polynomial through them."""

ROUNDING = 1e-9
"""Fraction of the largest force in a step that counts as no force."""

REACH = 2.0
"""Gaps are recorded if they could close within this multiple of the longest step."""

FORCES = ("force", "slack")
"""Names of the margins that are forces."""

MarginKey = tuple[str, int]
"""Name of a margin, and its contact."""

Substeps = Sequence[tuple[Step, float]]
"""Steps, each with its length [s]."""


class Search(ABC):
    """A search for switching points; the methods of this class use only the states of the laws.

    Args:
        system: the mechanical system.
        min_step: Δt_min [s].
        max_step: Δt_max [s].
    """

    withdraws_last_step = False
    """Whether the accepted step before the one with a switch is withdrawn as well."""

    def __init__(self, system: System, min_step: float, max_step: float) -> None:
        self._min_step = min_step

    def limited_length(self, now: float, length: float) -> float:
        """Return the length to try instead of ``length``."""
        return length

    @abstractmethod
    def length_after_switch(self, now: float, length: float, attempt: Attempt) -> float:
        """Return the length to try after an attempt of ``length`` in which a law switched."""

    def has_passed_switch(self, begin: State, end: State, attempt: Attempt) -> bool:
        """Return whether an apparently smooth attempt has passed a switch."""
        return False

    def length_after_step(self, now: float, length: float, wanted: float) -> float:
        """Return the next length after an accepted step, if the error alone would allow ``wanted``."""
        return wanted

    def record_step(self, substeps: Substeps, states: LawStates) -> None:  # noqa: B027
        """Record an accepted step."""

    @abstractmethod
    def record_switch(self, state: State) -> None:
        """Record that a switching point was passed."""


class NestedIntervals(Search):
    """Search that halves the step, and repeats both steps whose laws differ."""

    withdraws_last_step = True

    def __init__(self, system: System, min_step: float, max_step: float) -> None:
        super().__init__(system, min_step, max_step)
        self._switch_bound = float("inf")

    def length_after_switch(self, now: float, length: float, attempt: Attempt) -> float:
        """Return half the length, and record that the switch precedes the end of the attempt."""
        self._switch_bound = min(self._switch_bound, now + length)
        return max(self._min_step, 0.5 * length)

    def length_after_step(self, now: float, length: float, wanted: float) -> float:
        """Let the step grow at most twofold, and not while a switch is being located."""
        if now + length > self._switch_bound:
            self._switch_bound = float("inf")
        return min(2.0 * length if self._switch_bound == float("inf") else length, wanted)

    def record_switch(self, state: State) -> None:
        """Record that the switch is located."""
        self._switch_bound = float("inf")


class LastStepOnly(NestedIntervals):
    """Search that halves the step, and repeats only the second of two steps whose laws differ; the error stagnates."""

    withdraws_last_step = False


class Anticipating(Search):
    """Search that steps to just before the next switching point, which the margins of the laws predict."""

    def __init__(self, system: System, min_step: float, max_step: float) -> None:
        super().__init__(system, min_step, max_step)
        self._margins = Margins(system, max_step)
        self._n_minimal_steps = 0

    def limited_length(self, now: float, length: float) -> float:
        """Return ``length``, or the time to just before the next switching point if that is shorter."""
        switch_time, uncertainty = self._margins.next_switch(now)
        if not switch_time < now + 1.2 * length:
            self._n_minimal_steps = 0
            return length
        approach = switch_time - now - max(2.0 * uncertainty, 0.5 * self._min_step)
        if approach < 0.3 * (switch_time - now):
            approach = 0.5 * (switch_time - now)
        if approach > self._min_step:
            return min(length, approach)
        self._n_minimal_steps += 1
        # a wrong margin must not slow the motion indefinitely
        return min(length, self._min_step * 2.0 ** min(max(0, self._n_minimal_steps - 4), 60))

    def length_after_switch(self, now: float, length: float, attempt: Attempt) -> float:
        """Return a fraction of the smooth part of the attempt."""
        smooth = sum(part for _, part in attempt.substeps)
        factor = APPROACH * smooth / length if smooth < length and smooth > 0.0 else BLIND_CUT
        if attempt.end is not None:
            factor = APPROACH
        return max(self._min_step, factor * length)

    def has_passed_switch(self, begin: State, end: State, attempt: Attempt) -> bool:
        """Return whether a gap has closed within the step, or a force has vanished after its last evaluation."""
        return self._margins.penetrates(begin, end) or self._margins.has_ended_force(attempt.substeps, attempt.states)

    def record_step(self, substeps: Substeps, states: LawStates) -> None:
        """Record the margins of all laws."""
        for step, length in substeps:
            self._margins.record(step, length, states)

    def record_switch(self, state: State) -> None:
        """Restart after a switching point."""
        self._margins.forget()
        self._margins.record_gaps(state)
        self._n_minimal_steps = 0


class Margins:
    """Margins of all laws since the last switching point.

    Args:
        system: the mechanical system.
        horizon: time ahead for which switches are predicted [s].
    """

    def __init__(self, system: System, horizon: float) -> None:
        self._system = system
        self._horizon = horizon
        self._values: dict[MarginKey, deque[tuple[float, float]]] = {}

    def forget(self) -> None:
        """Discard all margins after a switching point."""
        self._values.clear()

    def record(self, step: Step, length: float, states: LawStates) -> None:
        """Record the margins in one step of ``length`` [s] with the laws in ``states``."""
        for key, time, value in _law_margins(step, length, states):
            self._add(key, time, value)
        self.record_gaps(step.state)

    def record_gaps(self, state: State) -> None:
        """Record the gaps of open contacts in a state."""
        reach = REACH * self._horizon * self._speed(state)
        keys, gaps = self._system.gaps_below(state.position, reach)
        for contact, gap in zip(keys.tolist(), gaps.tolist(), strict=True):
            if gap > 0.0:
                self._add(("gap", contact), state.time, gap)

    def penetrates(self, before: State, after: State) -> bool:
        """Return whether a gap is open in the state ``before`` and closed in the state ``after``."""
        closed = self._system.gaps_below(after.position, 0.0)[0]
        return not np.isin(closed, self._system.gaps_below(before.position, 0.0)[0], assume_unique=True).all()

    def has_ended_force(self, substeps: Substeps, states: LawStates) -> bool:
        """Return whether a force has vanished in the second half of the last of several equal steps.

        Laws are evaluated at the middle of each step, m_k = (k + 1/2)/n for k = 0 … n − 1. The polynomial through the
        n values is evaluated at the end of the interval, 1.
        """
        middles = (np.arange(len(substeps)) + 0.5) / len(substeps)
        weights = np.linalg.solve(np.vander(middles, increasing=True).T, np.ones(len(substeps)))
        end_values: dict[MarginKey, float] = defaultdict(float)
        largest = 0.0
        for weight, (step, length) in zip(weights.tolist(), substeps, strict=True):
            for key, _, value in _law_margins(step, length, states):
                if key[0] in FORCES:
                    end_values[key] += weight * value
                    largest = max(largest, value)
        return min(end_values.values(), default=0.0) < -ROUNDING * largest

    def next_switch(self, now: float) -> tuple[float, float]:
        """Return the time of the next switching point [s], inf if none is predicted, and its uncertainty [s]."""
        by_length: dict[int, list[list[tuple[float, float]]]] = defaultdict(list)
        for values in self._values.values():
            if len(values) > 1:
                by_length[len(values)].append(list(values))
        return min((_earliest_root(np.array(group), now) for group in by_length.values()), default=(np.inf, np.inf))

    def _speed(self, state: State) -> float:
        """Return a bound on the rate of gaps [m/s]: twice the largest rate of a coordinate."""
        displacement = self._system.move(state.position, state.velocity, 1.0) - state.position
        return 2.0 * float(np.abs(displacement).max(initial=0.0))

    def _add(self, key: MarginKey, time: float, value: float) -> None:
        self._values.setdefault(key, deque(maxlen=MEMORY)).append((time, value))


def _law_margins(step: Step, length: float, states: LawStates) -> Iterator[tuple[MarginKey, float, float]]:
    """Yield the key, time and value of each margin."""
    if step.contacts is None or step.problem is None:
        return
    lanes, end = contact_lanes(step.problem, step.impulses, step.contacts), step.state.time
    impulses, velocity = lanes.impulses, lanes.velocity
    bound = lanes.fixed_bound + lanes.friction_coefficient * impulses[:, 0]
    friction = np.linalg.norm(impulses[:, 1:], axis=1)
    sliding = np.linalg.norm(velocity[:, 1:], axis=1)
    for row, contact in enumerate(lanes.keys.tolist()):
        if contact not in states.closed:
            continue
        yield ("force", contact), end - 0.5 * length, float(impulses[row, 0]) / length
        if contact in states.sticking:
            yield ("slack", contact), end - 0.5 * length, float(bound[row] - friction[row]) / length
        elif contact in states.slips:
            yield ("sliding", contact), end, float(sliding[row])


def _earliest_root(values: FloatArray, now: float) -> tuple[float, float]:
    """Return the earliest root after ``now``, and its change at a lower degree; ``values`` are times and margins."""
    origin = values[:, -1:, 0]
    span = np.maximum(origin - values[:, :1, 0], np.finfo(float).tiny)
    last = values[:, -1:, 1]
    x = (values[:, :, 0] - origin) / span
    y = values[:, :, 1] / np.where(last == 0.0, 1.0, last)
    after = ((now - origin) / span)[:, 0]
    root = _first_roots(x, y, after)
    first = int(np.argmin(origin[:, 0] + span[:, 0] * root))
    if not np.isfinite(root[first]):
        return np.inf, np.inf
    begin, width = float(origin[first, 0]), float(span[first, 0])
    coarse_root = _first_roots(x[first : first + 1, 1:], y[first : first + 1, 1:], after[first : first + 1])[0]
    time = begin + width * float(root[first])
    uncertainty = width * abs(float(root[first] - coarse_root)) if np.isfinite(coarse_root) else 0.5 * (time - now)
    return time, uncertainty


def _first_roots(x: FloatArray, y: FloatArray, after: FloatArray) -> FloatArray:
    """Return the first real root ≥ ``after`` − 1e-3 of the polynomial through each row of x and y, or inf."""
    n_points = x.shape[1]
    if n_points < 2:
        return np.full(len(x), np.inf)
    coefficients = np.linalg.solve(x[:, :, None] ** np.arange(n_points), y[:, :, None])[:, :, 0]
    largest = np.abs(coefficients).max(axis=1, initial=0.0)
    degree = n_points - 1
    leading = coefficients[:, degree]
    # a leading coefficient within rounding gives a root at infinity, which the eigenvalues tolerate
    leading = np.where(np.abs(leading) < 1e-300 + 1e-14 * largest, 1e-14 * np.maximum(largest, 1e-300), leading)
    companion = np.zeros((len(x), degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[:, :, -1] = -coefficients[:, :degree] / leading[:, None]
    roots = np.linalg.eigvals(companion)
    is_real = np.abs(roots.imag) <= 1e-9 * np.maximum(1.0, np.abs(roots))
    candidates = np.where(is_real & (roots.real >= after[:, None] - 1e-3), roots.real, np.inf)
    first: FloatArray = candidates.min(axis=1, initial=np.inf)
    return first


SEARCHES: dict[str, type[Search]] = {"anticipating": Anticipating, "nested": NestedIntervals, "last": LastStepOnly}
"""Searches for switching points by name."""
