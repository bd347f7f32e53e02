"""The known limit cycle of a scene, and comparison of the periods of a motion with it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...arrays import FloatArray
from ..state import State


@dataclass(frozen=True)
class Incident:
    """A switching point, with the middle of its interval as its time.

    Attributes:
        time: middle of the interval in which it lies [s].
        law: "unilateral" or "friction".
        contact: key of the contact.
        before: state of the law before.
        after: state of the law after.
    """

    time: float
    law: str
    contact: int
    before: str
    after: str

    def is_like(self, other: "Incident") -> bool:
        """Whether it is the same switch at another time."""
        return replace(self, time=0.0) == replace(other, time=0.0)


@dataclass(frozen=True)
class KnownCycle:
    """The known limit cycle of a scene, whose periods are counted from section to section.

    Attributes:
        period: its duration [s].
        descent: decrease of the first coordinate in one period.
        incidents: its switching points, with times after the section.
        section: index of the incident that is the section.
        section_error: largest relative error as a function of the state one period after the section.
        source: publication of ``incidents``, for users.
        transient: number of periods after which a motion counts as being on the limit cycle.
        is_of_scene: whether it belongs to the options of the scene; if not, only the order of incidents is comparable.
    """

    period: float
    descent: float
    incidents: tuple[Incident, ...]
    section: int
    section_error: Callable[[State], float]
    source: str
    transient: int
    is_of_scene: bool = True


@dataclass(frozen=True)
class Cycle:
    """One period of a motion, from the first incident of the limit cycle to the last one before it recurs.

    Attributes:
        known: the limit cycle.
        incidents: in order of time.
        section: time of the section in it [s].
        height: first coordinate in the section.
    """

    known: KnownCycle
    incidents: tuple[Incident, ...]
    section: float
    height: float

    @property
    def is_published(self) -> bool:
        """Whether the incidents are those of the limit cycle, in its order."""
        known = self.known.incidents
        return len(self.incidents) == len(known) and all(map(Incident.is_like, self.incidents, known))

    @property
    def deviations(self) -> FloatArray:
        """Times after the section minus those of the limit cycle [s], shape (n_incidents,), if ``is_published``."""
        known = [incident.time for incident in self.known.incidents]
        return np.array([incident.time - self.section for incident in self.incidents]) - known


@dataclass(frozen=True)
class Cycles:
    """The periods of a motion.

    Attributes:
        known: the limit cycle.
        cycles: complete periods, in order.
        sections: times of all sections [s].
        heights: first coordinate in them.
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
        """Number of complete periods with the incidents of the limit cycle."""
        return sum(cycle.is_published for cycle in self.cycles)

    def mean_period(self, last: int) -> float:
        """Return the mean of the last periods [s]."""
        return float(np.diff(self.sections[-last - 1 :]).mean())

    def mean_descent(self, last: int) -> float:
        """Return the mean descent of the last periods."""
        return float(-np.diff(self.heights[-last - 1 :]).mean())

    def relative_deviations(self, last: int) -> tuple[float, float]:
        """Return the relative deviations of the means of the last periods from the known period and descent."""
        return self.mean_period(last) / self.known.period - 1.0, self.mean_descent(last) / self.known.descent - 1.0


def find_cycles(known: KnownCycle, found: Sequence[Incident], times: FloatArray, heights: FloatArray) -> Cycles:
    """Return the periods of a motion.

    Args:
        known: the limit cycle of its scene.
        found: its switching points in order of time.
        times: times of some of its states [s], including those at switching points, shape (n,).
        heights: first coordinate at these times, shape (n,).
    """
    begins = [index for index, incident in enumerate(found) if incident.is_like(known.incidents[0])]
    section = known.incidents[known.section]
    sections = [incident.time for incident in found if incident.is_like(section)]
    at = {time: float(heights[np.searchsorted(times, time)]) for time in sections}
    complete = []
    for first, last in pairwise(begins):
        inside = [incident.time for incident in found[first:last] if incident.is_like(section)]
        if inside:
            complete.append(Cycle(known, tuple(found[first:last]), inside[0], at[inside[0]]))
    return Cycles(known, complete, np.array(sections), np.array([at[time] for time in sections]))
