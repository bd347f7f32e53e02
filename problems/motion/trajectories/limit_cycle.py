"""The limit cycle of the woodpecker: its periods in a motion, its incidents, and the error after one period.

Incidents are distinguished as in table 1 of Studer & Glocker (2005); a period is measured from section to section.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...arrays import FloatArray
from ..scenes.woodpecker import DESCENT, INCIDENTS, PERIOD, section_start
from ..state import State

RANGES = (0.01945, 0.47, 17.57)
"""What y [m], φ_S [rad] and its velocity [rad/s] range over in one period."""

SECTION = ("friction", 1, "stick", "slip")
"""What the section of the limit cycle is: the lower edge of the sleeve begins to slip."""


def section_error(state: State) -> float:
    """Return the largest error of y, φ_S and its velocity after one period, each over its range in the cycle."""
    start = section_start()
    errors = (
        state.position[0] - start.position[0] + DESCENT,
        state.position[2] - start.position[2],
        state.velocity[2] - start.velocity[2],
    )
    return max(abs(float(error)) / reach for error, reach in zip(errors, RANGES, strict=True))


@dataclass(frozen=True)
class Incident:
    """A switching point.

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

    @property
    def what(self) -> tuple[str, int, str, str]:
        """Everything but the time."""
        return self.law, self.contact, self.before, self.after


@dataclass(frozen=True)
class Cycle:
    """One period of the woodpecker, from the incident that is row 1 of the table to the one before the next row 1.

    Attributes:
        incidents: in order of time.
        section: time of the section in it [s].
        height: y in the section [m].
    """

    incidents: tuple[Incident, ...]
    section: float
    height: float

    @property
    def is_published(self) -> bool:
        """Whether these are the incidents of table 1, in its order."""
        return [incident.what for incident in self.incidents] == [row[1:] for row in INCIDENTS]

    @property
    def deviations(self) -> FloatArray:
        """Times after the section less those of the limit cycle [s], shape (12,); only where ``is_published``."""
        return np.array([incident.time - self.section for incident in self.incidents]) - [row[0] for row in INCIDENTS]


@dataclass(frozen=True)
class Cycles:
    """What a motion of the woodpecker repeats.

    Attributes:
        cycles: complete periods, in order.
        sections: times of all sections [s].
        heights: y in them [m].
    """

    cycles: list[Cycle]
    sections: FloatArray
    heights: FloatArray

    def mean_period(self, last: int) -> float:
        """Return the mean of the last periods [s]."""
        return float(np.diff(self.sections[-last - 1 :]).mean())

    def mean_descent(self, last: int) -> float:
        """Return the mean descent of the last periods [m]."""
        return float(-np.diff(self.heights[-last - 1 :]).mean())

    @property
    def count(self) -> int:
        """Number of periods from section to section."""
        return max(0, len(self.sections) - 1)


def cycles(found: Sequence[Incident], times: FloatArray, heights: FloatArray) -> Cycles:
    """Return the periods of a woodpecker's motion.

    Args:
        found: its switching points in order of time.
        times: of some of its states [s], those at switching points included, shape (n,).
        heights: y in them [m], shape (n,).
    """
    begins = [index for index, incident in enumerate(found) if incident.what == INCIDENTS[0][1:]]
    sections = [incident.time for incident in found if incident.what == SECTION]
    at = {time: float(heights[np.searchsorted(times, time)]) for time in sections}
    complete = []
    for first, last in pairwise(begins):
        inside = [incident.time for incident in found[first:last] if incident.what == SECTION]
        if inside:
            complete.append(Cycle(tuple(found[first:last]), inside[0], at[inside[0]]))
    return Cycles(complete, np.array(sections), np.array([at[time] for time in sections]))


def relative_deviations(motion: Cycles, last: int) -> tuple[float, float]:
    """Return how far the means of the last periods are from period and descent of the limit cycle, relatively."""
    return motion.mean_period(last) / PERIOD - 1.0, motion.mean_descent(last) / DESCENT - 1.0
