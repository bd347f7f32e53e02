"""The known limit cycle of a scene, and the comparison of a motion with it, period by period."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...arrays import FloatArray
from ..state import State


@dataclass(frozen=True)
class SwitchEvent:
    """A switching point as an event at the middle of its interval.

    Attributes:
        time: middle of the interval [s].
        law: "unilateral" or "friction".
        contact: key of the contact.
        before: state of the law before the switch.
        after: state of the law after the switch.
    """

    time: float
    law: str
    contact: int
    before: str
    after: str

    def is_same_switch(self, other: "SwitchEvent") -> bool:
        """Return whether both events are the same switch, apart from their times."""
        return replace(self, time=0.0) == replace(other, time=0.0)


@dataclass(frozen=True)
class KnownCycle:
    """The known limit cycle of a scene, whose periods are counted from section to section.

    Attributes:
        period: duration of one period [s].
        descent: decrease of the first coordinate, a height, in one period [m].
        switch_events: its switching points, with times relative to the Poincaré section [s].
        section: index of the event at which a motion crosses the Poincaré section.
        section_error: function that returns the largest relative error of a state one period after the section.
        source: publication of ``switch_events``, for users.
        transient: number of periods after which a motion counts as being on the limit cycle.
        matches_scene_options: whether the cycle was computed with the options of the scene; if not, only the order of
            ``switch_events`` is comparable.
    """

    period: float
    descent: float
    switch_events: tuple[SwitchEvent, ...]
    section: int
    section_error: Callable[[State], float]
    source: str
    transient: int
    matches_scene_options: bool = True


@dataclass(frozen=True)
class Cycle:
    """One period of a motion, from the first event of the limit cycle to the last event before the first one recurs.

    Attributes:
        known: the limit cycle.
        switch_events: the switching points of this period, in order of time.
        section: time at which the motion crosses the Poincaré section [s].
        height: first coordinate at that time [m].
    """

    known: KnownCycle
    switch_events: tuple[SwitchEvent, ...]
    section: float
    height: float

    @property
    def is_published(self) -> bool:
        """Whether the switching points are those of the limit cycle, in its order."""
        known = self.known.switch_events
        return len(self.switch_events) == len(known) and all(map(SwitchEvent.is_same_switch, self.switch_events, known))

    @property
    def deviations(self) -> FloatArray:
        """Times after the section minus those of the limit cycle [s], shape (n_switch_events,), if ``is_published``."""
        known = [event.time for event in self.known.switch_events]
        return np.array([event.time - self.section for event in self.switch_events]) - known


@dataclass(frozen=True)
class CycleSequence:
    """The periods of a motion.

    Attributes:
        known: the limit cycle.
        cycles: complete periods, in order.
        sections: times at which the motion crosses the section [s], shape (n,).
        heights: first coordinate at these times [m], shape (n,).
    """

    known: KnownCycle
    cycles: list[Cycle]
    sections: FloatArray
    heights: FloatArray

    @property
    def count(self) -> int:
        """Number of periods from section to section."""
        return max(0, len(self.sections) - 1)

    @property
    def published_count(self) -> int:
        """Number of complete periods with the switching points of the limit cycle."""
        return sum(cycle.is_published for cycle in self.cycles)

    def mean_period(self, last: int) -> float:
        """Return the mean duration of the last ``last`` periods [s]."""
        return float(np.diff(self.sections[-last - 1 :]).mean())

    def mean_descent(self, last: int) -> float:
        """Return the mean descent in the last ``last`` periods [m]."""
        return float(-np.diff(self.heights[-last - 1 :]).mean())

    def relative_deviations(self, last: int) -> tuple[float, float]:
        """Return the relative deviations of mean period and mean descent, over the last ``last`` periods."""
        return self.mean_period(last) / self.known.period - 1.0, self.mean_descent(last) / self.known.descent - 1.0


def find_cycles(
    known: KnownCycle, events: Sequence[SwitchEvent], times: FloatArray, heights: FloatArray
) -> CycleSequence:
    """Return the periods of a motion, found by its switching points.

    Args:
        known: the limit cycle of the scene.
        events: switching points of the motion in order of time.
        times: times of states of the motion [s], including those at switching points, shape (n,).
        heights: first coordinate at these times [m], shape (n,).
    """
    begins = [index for index, event in enumerate(events) if event.is_same_switch(known.switch_events[0])]
    section = known.switch_events[known.section]
    sections = [event.time for event in events if event.is_same_switch(section)]
    height_at = {time: float(heights[np.searchsorted(times, time)]) for time in sections}
    complete = []
    for first, last in pairwise(begins):
        section_times = [event.time for event in events[first:last] if event.is_same_switch(section)]
        if section_times:
            complete.append(Cycle(known, tuple(events[first:last]), section_times[0], height_at[section_times[0]]))
    return CycleSequence(known, complete, np.array(sections), np.array([height_at[time] for time in sections]))
