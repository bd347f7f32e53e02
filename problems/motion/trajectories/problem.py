"""Trajectory problems, on which steppers with solvers are measured: a scene, a duration, members, and a measure.

One simulation says little where its error is erratic in the number of steps, or its motion chaotic. A problem therefore
has members: factors on the steps or tolerances of a stepper, of whose errors the median counts, or seeds of a scene of
balls, which are compared one by one with the same seeds of a reference.
"""

import hashlib
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean, median, stdev

import numpy as np

from ..state import State
from .limit_cycle import KnownCycle
from .pour import MotionRecorder

ERROR = "error"
"""Name of the error of a single trajectory among the quantities of a problem."""

Values = Mapping[str, float]
"""Results of one simulation by name."""


@dataclass(frozen=True)
class Estimate:
    """An error over the members of a problem.

    Attributes:
        error: median over the members, or the mean deviation from the reference, relative to the mean of the reference.
        low: least error of a member, or the mean deviation less its standard error.
        high: largest error of a member, or the mean deviation and its standard error.
    """

    error: float
    low: float
    high: float


class Measure(ABC):
    """How the error of a simulation is computed."""

    @property
    @abstractmethod
    def names(self) -> Collection[str]:
        """Names of the values that the error is computed of; none before the reference is known."""

    @property
    def numbers(self) -> dict[str, object]:
        """The numbers that the digest of a problem is made of."""
        return vars(self)

    @abstractmethod
    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the results of a simulation of ``duration`` [s], from the states that ``recorder`` noted."""

    @abstractmethod
    def estimates(self, members: Mapping[float, Values]) -> dict[str, Estimate]:
        """Return the error in each quantity, from the values of members; empty where there are too few."""


class _OfOneTrajectory(Measure):
    """Each member has an error of its own."""

    @abstractmethod
    def error(self, values: Values) -> float:
        """Return the error of one simulation."""

    def estimates(self, members: Mapping[float, Values]) -> dict[str, Estimate]:
        """Return the median error, from the least to the largest."""
        errors = [self.error(values) for values in members.values()]
        return {ERROR: Estimate(median(errors), min(errors), max(errors))} if errors else {}


@dataclass(frozen=True)
class LimitCycle(_OfOneTrajectory):
    """The state after one period from the section of a known limit cycle, whose name the scene has.

    Attributes:
        known: the limit cycle.
        n_coordinates: number of coordinates, and of velocities.
    """

    known: KnownCycle
    n_coordinates: int

    @property
    def names(self) -> Collection[str]:
        """Names of q and u: q0, q1, … and u0, u1, … by number."""
        return [f"{name}{index}" for name in "qu" for index in range(self.n_coordinates)]

    @property
    def numbers(self) -> dict[str, object]:
        """None: the scene has them all."""
        return {}

    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the last position and velocity, as q0, q1, …, u0, u1, … by name."""
        velocity = {f"u{index}": float(value) for index, value in enumerate(recorder.last.velocity)}
        return {**_coordinates(recorder), **velocity}

    def error(self, values: Values) -> float:
        """Return the largest relative error in the section."""
        numbers = np.array([values[name] for name in self.names])
        return self.known.section_error(State(0.0, *np.split(numbers, 2)))


@dataclass(frozen=True)
class EndPosition(_OfOneTrajectory):
    """The last position against a known one, in closed form or of a finer simulation.

    Velocities are left out: an impact that is one step late would count as an error of 100 %.

    Attributes:
        known: coordinates of the known position, as q0, q1, …
        scale: length over which differences are given [m]: the longest way of a coordinate, or the scene's length.
    """

    known: Values = field(default_factory=dict)
    scale: float = 1.0

    @property
    def names(self) -> Collection[str]:
        """Those of the known position."""
        return self.known.keys()

    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the last position, as q0, q1, … by name."""
        return _coordinates(recorder)

    def error(self, values: Values) -> float:
        """Return the largest difference of a coordinate, relative to ``scale``."""
        return max(abs(values[name] - known) for name, known in self.known.items()) / self.scale


@dataclass(frozen=True)
class Aggregates(Measure):
    """A pour by its flow rate, mean height and energy lost, against a simulation with a finer step.

    Attributes:
        reference: values of the reference by seed.
    """

    reference: Mapping[float, Values] = field(default_factory=dict)

    @property
    def names(self) -> Collection[str]:
        """Those of the reference."""
        return next(iter(self.reference.values()), {}).keys()

    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the aggregates."""
        return recorder.aggregates(duration)

    def estimates(self, members: Mapping[float, Values]) -> dict[str, Estimate]:
        """Return how far the mean of each aggregate is from the reference's, with the standard error of that.

        The same seeds are compared, so that what they have in common cancels; two of them are needed.
        """
        both = [seed for seed in members if seed in self.reference]
        if len(both) < 2:
            return {}
        found = {}
        for name in self.reference[both[0]]:
            scale = abs(fmean(self.reference[seed][name] for seed in both))
            if scale:
                off = [members[seed][name] - self.reference[seed][name] for seed in both]
                error, spread = abs(fmean(off)) / scale, standard_error(off) / scale
                found[name] = Estimate(error, max(0.0, error - spread), error + spread)
        return found

    def spreads(self) -> dict[str, tuple[float, float]]:
        """Return for each aggregate its mean over the seeds of the reference, and the standard error of that, relative.

        Empty with fewer than two seeds.
        """
        if len(self.reference) < 2:
            return {}
        found = {}
        for name in next(iter(self.reference.values())):
            values = [one[name] for one in self.reference.values()]
            mean = fmean(values)
            found[name] = (mean, standard_error(values) / abs(mean) if mean else math.nan)
        return found


@dataclass(frozen=True)
class TrajectoryProblem:
    """A problem for steppers with solvers.

    Attributes:
        name: the scene, ``Name(option=value)``.
        duration: simulated time [s].
        members: seeds of the scene where ``measure`` is of ``Aggregates``, else factors on steps or tolerances.
        measure: how the error is computed.
    """

    name: str
    duration: float
    members: tuple[float, ...]
    measure: Measure

    @property
    def varies_seeds(self) -> bool:
        """Whether members are seeds of the scene."""
        return isinstance(self.measure, Aggregates)

    @property
    def digest(self) -> str:
        """SHA-256 of its name and its numbers; results of problems with different digests do not compare."""
        measure = [type(self.measure).__name__, self.measure.numbers]
        numbers = [self.name, float(self.duration), [*map(float, self.members)], measure]
        return hashlib.sha256(json.dumps(numbers, sort_keys=True).encode()).hexdigest()


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of the mean of two values or more."""
    return stdev(values) / math.sqrt(len(values))


def _coordinates(recorder: MotionRecorder) -> Values:
    return {f"q{index}": float(value) for index, value in enumerate(recorder.last.position)}
