"""When the next switching point is due: margins of all laws over the last steps, extrapolated to zero.

The margin of a law is positive as long as it stays in its state, and vanishes where it switches:

    open contact      g                    a gap that closes
    closed contact    Λ_N / Δt             a force that ends
    sticking          (b − ‖Λ_T‖) / Δt     a friction force that reaches its bound
    slipping          ‖γ_T‖                a sliding velocity that ends

Forces are those in the middle of a step, gaps and velocities those at its end. Each margin is continued by the
polynomials through its last few values; the difference between two degrees says how far the root can be trusted.
"""

from collections import defaultdict, deque
from collections.abc import Iterator, Sequence

import numpy as np

from ...arrays import FloatArray
from ..bodies.system import System
from ..state import State
from .contact_states import LawStates
from .moreau import Step

MEMORY = 5
"""Values of a margin that are kept, and one more than the degree of the polynomial through them."""

ROUNDING = 1e-9
"""Part of the largest force in a step that counts as no force."""

REACH = 2.0
"""Gaps are followed that could close within this many longest steps."""

FORCES = ("force", "slack")
"""Margins of forces."""

Key = tuple[str, int]

Substeps = Sequence[tuple[Step, float]]
"""Steps, each with its length [s]."""


class Margins:
    """Margins of all laws since the last switching point.

    Args:
        system: what moves.
        horizon: how far ahead switches are needed [s].
    """

    def __init__(self, system: System, horizon: float) -> None:
        self._system = system
        self._horizon = horizon
        self._values: dict[Key, deque[tuple[float, float]]] = {}

    def forget(self) -> None:
        """Forget everything: a switching point was passed."""
        self._values.clear()

    def note(self, step: Step, length: float, states: LawStates) -> None:
        """Note the margins in one step of ``length`` [s] with the laws in ``states``."""
        for key, time, value in _law_margins(step, length, states):
            self._add(key, time, value)
        self.note_gaps(step.state)

    def note_gaps(self, state: State) -> None:
        """Note the gaps of open contacts in a state."""
        reach = REACH * self._horizon * self._speed(state)
        keys, gaps = self._system.gaps_below(state.position, reach)
        for contact, gap in zip(keys.tolist(), gaps.tolist(), strict=True):
            if gap > 0.0:
                self._add(("gap", contact), state.time, gap)

    def penetrates(self, before: State, after: State) -> bool:
        """Whether a gap that was open in one state is not open in the other."""
        closed = self._system.gaps_below(after.position, 0.0)[0]
        return not np.isin(closed, self._system.gaps_below(before.position, 0.0)[0], assume_unique=True).all()

    def outlasts(self, substeps: Substeps, states: LawStates) -> bool:
        """Whether a force ends after the middle of the last of some equal steps, and before their end.

        The laws look at the middle of a step, m_k = (k + 1/2)/n for k = 0 … n − 1. The polynomial through the n values
        there says what is left of a margin at the end, at 1.
        """
        middles = (np.arange(len(substeps)) + 0.5) / len(substeps)
        weights = np.linalg.solve(np.vander(middles, increasing=True).T, np.ones(len(substeps)))
        left: dict[Key, float] = defaultdict(float)
        largest = 0.0
        for weight, (step, length) in zip(weights.tolist(), substeps, strict=True):
            for key, _, value in _law_margins(step, length, states):
                if key[0] in FORCES:
                    left[key] += weight * value
                    largest = max(largest, value)
        return min(left.values(), default=0.0) < -ROUNDING * largest

    def next_switch(self, now: float) -> tuple[float, float]:
        """Return the time of the next switching point [s], inf if none is in sight, and its uncertainty [s]."""
        by_length: dict[int, list[list[tuple[float, float]]]] = defaultdict(list)
        for values in self._values.values():
            if len(values) > 1:
                by_length[len(values)].append(list(values))
        return min((_earliest_root(np.array(group), now) for group in by_length.values()), default=(np.inf, np.inf))

    def _speed(self, state: State) -> float:
        """Return how fast a gap may change [m/s]: twice as fast as anything moves, whatever the coordinates are."""
        moved = self._system.move(state.position, state.velocity, 1.0) - state.position
        return 2.0 * float(np.abs(moved).max(initial=0.0))

    def _add(self, key: Key, time: float, value: float) -> None:
        self._values.setdefault(key, deque(maxlen=MEMORY)).append((time, value))


def _law_margins(step: Step, length: float, states: LawStates) -> Iterator[tuple[Key, float, float]]:
    """Yield which margin it is, its time and its value."""
    if step.contacts is None or step.problem is None:
        return
    layout, end = step.problem.layout, step.state.time
    impulses = layout.pad(step.impulses)
    velocity = layout.pad(step.problem.relative_velocity(step.impulses))
    bound = layout.fixed_bound + layout.friction_coefficient * impulses[:, 0]
    friction = np.linalg.norm(impulses[:, 1:], axis=1)
    sliding = np.linalg.norm(velocity[:, 1:], axis=1)
    for row, contact in enumerate(step.contacts.keys.tolist()):
        if contact not in states.closed:
            continue
        yield ("force", contact), end - 0.5 * length, float(impulses[row, 0]) / length
        if contact in states.sticking:
            yield ("slack", contact), end - 0.5 * length, float(bound[row] - friction[row]) / length
        elif layout.width > 1:
            yield ("sliding", contact), end, float(sliding[row])


def _earliest_root(values: FloatArray, now: float) -> tuple[float, float]:
    """Return the earliest root after ``now``, and how much a lower degree differs; ``values`` are times and margins."""
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
    coarser = _first_roots(x[first : first + 1, 1:], y[first : first + 1, 1:], after[first : first + 1])[0]
    time = begin + width * float(root[first])
    doubt = width * abs(float(root[first] - coarser)) if np.isfinite(coarser) else 0.5 * (time - now)
    return time, doubt


def _first_roots(x: FloatArray, y: FloatArray, after: FloatArray) -> FloatArray:
    """Return the first real root at or after ``after`` of the polynomial through each row of x and y; else inf."""
    n_points = x.shape[1]
    if n_points < 2:
        return np.full(len(x), np.inf)
    rising = np.linalg.solve(x[:, :, None] ** np.arange(n_points), y[:, :, None])[:, :, 0]
    largest = np.abs(rising).max(axis=1, initial=0.0)
    degree = n_points - 1
    leading = rising[:, degree]
    # a leading coefficient that is all rounding gives one root at infinity, which the eigenvalues bear
    leading = np.where(np.abs(leading) < 1e-300 + 1e-14 * largest, 1e-14 * np.maximum(largest, 1e-300), leading)
    companion = np.zeros((len(x), degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[:, :, -1] = -rising[:, :degree] / leading[:, None]
    roots = np.linalg.eigvals(companion)
    is_real = np.abs(roots.imag) <= 1e-9 * np.maximum(1.0, np.abs(roots))
    candidates = np.where(is_real & (roots.real >= after[:, None] - 1e-3), roots.real, np.inf)
    first: FloatArray = candidates.min(axis=1, initial=np.inf)
    return first
