"""How switching points are located: what step is tried when a law switches, or is about to.

``NestedIntervals`` is the paper's: the switch lies somewhere in *both* of two successive steps whose laws differ, so
both are taken back and redone with half the step, down to the minimal one (figure 3). ``LastStepOnly`` redoes the
second alone; its error stalls, because a gap may have closed after the middle of the first, where nothing is evaluated.
``Anticipating`` approaches the switch from before, by the margins of the laws, and needs four steps instead of forty.
"""

from abc import ABC, abstractmethod

from ..bodies.system import System
from ..state import State
from .contact_states import LawStates
from .extrapolation import Attempt
from .moreau import Step
from .switch_prediction import Margins


class Search(ABC):
    """A search for switching points; what subclasses leave as it is looks at the laws alone.

    Args:
        system: what moves.
        min_step: Δt_min [s].
        max_step: Δt_max [s].
    """

    takes_back = False
    """Whether the accepted step before a switch is taken back as well."""

    def __init__(self, system: System, min_step: float, max_step: float) -> None:
        self._min_step = min_step

    def limited(self, now: float, length: float) -> float:
        """Return the length to try instead of ``length``."""
        return length

    @abstractmethod
    def after_switch(self, now: float, length: float, attempt: Attempt) -> float:
        """Return the length to try after an attempt of ``length`` in which a law switched."""

    def oversteps(self, begin: State, end: State, attempt: Attempt) -> bool:
        """Whether an attempt that looks smooth has passed a switch all the same."""
        return False

    def grown(self, now: float, length: float, wanted: float) -> float:
        """Return the next length after an accepted step, where the error alone would allow ``wanted``."""
        return wanted

    def passed(self, substeps: tuple[tuple[Step, float], ...], states: LawStates) -> None:  # noqa: B027
        """Note an accepted step."""

    @abstractmethod
    def forget(self, state: State) -> None:
        """A switching point was passed."""


class NestedIntervals(Search):
    """Halve the step, and redo both steps between which the laws differ."""

    takes_back = True

    def __init__(self, system: System, min_step: float, max_step: float) -> None:
        super().__init__(system, min_step, max_step)
        self._seen_before = float("inf")

    def after_switch(self, now: float, length: float, attempt: Attempt) -> float:
        """Return half the length, and remember that the switch comes before the end of the attempt."""
        self._seen_before = min(self._seen_before, now + length)
        return max(self._min_step, 0.5 * length)

    def grown(self, now: float, length: float, wanted: float) -> float:
        """Let the step grow, at most twofold, but not while a switch is being located."""
        if now + length > self._seen_before:
            self._seen_before = float("inf")
        return min(2.0 * length if self._seen_before == float("inf") else length, wanted)

    def forget(self, state: State) -> None:
        """The switch is located."""
        self._seen_before = float("inf")


class LastStepOnly(NestedIntervals):
    """Halve the step, and redo only the step in which the laws differ from those before: this stalls."""

    takes_back = False


APPROACH = 0.45
"""A step in which a law switched is tried again with this share of the part that was still smooth."""

BLIND_CUT = 0.1
"""The same where the law switched at once, and nothing is known."""


class Anticipating(Search):
    """Step to just before the next switching point that the margins of the laws announce."""

    def __init__(self, system: System, min_step: float, max_step: float) -> None:
        super().__init__(system, min_step, max_step)
        self._margins = Margins(system, max_step)
        self._waited = 0

    def limited(self, now: float, length: float) -> float:
        """Return ``length``, or the way to just before the next switching point if that is shorter."""
        due, doubt = self._margins.next_switch(now)
        if not due < now + 1.2 * length:
            self._waited = 0
            return length
        way = due - now - max(2.0 * doubt, 0.5 * self._min_step)
        if way < 0.3 * (due - now):
            way = 0.5 * (due - now)
        if way > self._min_step:
            return min(length, way)
        self._waited += 1
        # a margin that was wrong must not make the motion creep for ever
        return min(length, self._min_step * 2.0 ** min(max(0, self._waited - 4), 60))

    def after_switch(self, now: float, length: float, attempt: Attempt) -> float:
        """Return a part of what was smooth."""
        smooth = sum(part for _, part in attempt.substeps)
        factor = APPROACH * smooth / length if smooth < length and smooth > 0.0 else BLIND_CUT
        if attempt.end is not None:
            factor = APPROACH
        return max(self._min_step, factor * length)

    def oversteps(self, begin: State, end: State, attempt: Attempt) -> bool:
        """Whether a gap has closed within the step, or a force has ended after the last look at it."""
        return self._margins.penetrates(begin, end) or self._margins.outlasts(attempt.substeps, attempt.states)

    def passed(self, substeps: tuple[tuple[Step, float], ...], states: LawStates) -> None:
        """Note the margins of all laws."""
        for step, length in substeps:
            self._margins.note(step, length, states)

    def forget(self, state: State) -> None:
        """Begin again behind a switching point."""
        self._margins.forget()
        self._margins.note_gaps(state)
        self._waited = 0
