"""Trajectory problems, on which steppers with solvers are measured: a scene, a duration, members, and a measure.

One simulation is not representative if its error varies erratically with the number of steps, or its motion is chaotic.
A problem therefore has several members. These are factors of the steps or tolerances of a stepper, whose median error
is taken, or seeds of a scene of balls, which are compared with the same seeds of a reference.
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
        low: smallest error of a member, or the mean deviation minus its standard error, at least 0.
        high: largest error of a member, or the mean deviation plus its standard error.
    """

    error: float
    low: float
    high: float


class Measure(ABC):
    """Computation of the error of a simulation."""

    @property
    @abstractmethod
    def names(self) -> Collection[str]:
        """Names of the values from which the error is computed; none before the reference is known."""

    @property
    def numbers(self) -> dict[str, object]:
        """The numbers that enter the digest of a problem."""
        return vars(self)

    @abstractmethod
    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the results of a simulation of ``duration`` [s], from the states in ``recorder``."""

    @abstractmethod
    def estimates(self, members: Mapping[float, Values]) -> dict[str, Estimate]:
        """Return the error in each quantity, from the values of members; empty if there are too few."""


class _TrajectoryMeasure(Measure):
    """Base class of measures in which each member has an error."""

    @abstractmethod
    def error(self, values: Values) -> float:
        """Return the error of one simulation."""

    def estimates(self, members: Mapping[float, Values]) -> dict[str, Estimate]:
        """Return the median, smallest and largest error."""
        errors = [self.error(values) for values in members.values()]
        return {ERROR: Estimate(median(errors), min(errors), max(errors))} if errors else {}


@dataclass(frozen=True)
class LimitCycle(_TrajectoryMeasure):
    """The error of the state one period after the section of the known limit cycle of a scene.

    Attributes:
        known: the limit cycle.
        n_coordinates: number of coordinates, and of velocities.
    """

    known: KnownCycle
    n_coordinates: int

    @property
    def names(self) -> Collection[str]:
        """Names q0, q1, … and u0, u1, … of the coordinates of q and u."""
        return [f"{name}{index}" for name in "qu" for index in range(self.n_coordinates)]

    @property
    def numbers(self) -> dict[str, object]:
        """No numbers, because the scene defines them."""
        return {}

    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the last position and velocity, with the names q0, q1, … and u0, u1, … as keys."""
        velocity = {f"u{index}": float(value) for index, value in enumerate(recorder.last.velocity)}
        return {**_coordinates(recorder), **velocity}

    def error(self, values: Values) -> float:
        """Return the largest relative error at the section."""
        numbers = np.array([values[name] for name in self.names])
        return self.known.section_error(State(0.0, *np.split(numbers, 2)))


@dataclass(frozen=True)
class EndPosition(_TrajectoryMeasure):
    """The last position compared with a known one, in closed form or from a finer simulation.

    Velocities are not compared: an impact that is one step late would count as an error of 100 %.

    Attributes:
        known: coordinates of the known position, as q0, q1, …
        scale: reference length of differences [m]: the largest displacement of a coordinate from the start to the end,
            at least the length of the scene.
    """

    known: Values = field(default_factory=dict)
    scale: float = 1.0

    @property
    def names(self) -> Collection[str]:
        """Names of the known position."""
        return self.known.keys()

    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the last position, with the names q0, q1, … as keys."""
        return _coordinates(recorder)

    def error(self, values: Values) -> float:
        """Return the largest difference of a coordinate, relative to ``scale``."""
        return max(abs(values[name] - known) for name, known in self.known.items()) / self.scale


@dataclass(frozen=True)
class Aggregates(Measure):
    """Flow rate, mean height and lost energy of a pour, compared with a simulation with a finer step.

    Attributes:
        reference: values of the reference by seed.
    """

    reference: Mapping[float, Values] = field(default_factory=dict)

    @property
    def names(self) -> Collection[str]:
        """Names of the aggregates of the reference."""
        return next(iter(self.reference.values()), {}).keys()

    def values(self, recorder: MotionRecorder, duration: float) -> Values:
        """Return the aggregates."""
        return recorder.aggregates(duration)

    def estimates(self, members: Mapping[float, Values]) -> dict[str, Estimate]:
        """Return the deviation of the mean of each aggregate from the reference, with its standard error.

        The same seeds are compared, so that common deviations cancel; at least two are needed.
        """
        seeds = [seed for seed in members if seed in self.reference]
        if len(seeds) < 2:
            return {}
        estimates = {}
        for name in self.reference[seeds[0]]:
            scale = abs(fmean(self.reference[seed][name] for seed in seeds))
            if scale:
                differences = [members[seed][name] - self.reference[seed][name] for seed in seeds]
                error, spread = abs(fmean(differences)) / scale, standard_error(differences) / scale
                estimates[name] = Estimate(error, max(0.0, error - spread), error + spread)
        return estimates

    def spreads(self) -> dict[str, tuple[float, float]]:
        """Return for each aggregate its mean over the seeds of the reference, and its relative standard error.

        The result is empty if there are fewer than two seeds.
        """
        if len(self.reference) < 2:
            return {}
        spreads = {}
        for name in next(iter(self.reference.values())):
            values = [results[name] for results in self.reference.values()]
            mean = fmean(values)
            spreads[name] = (mean, standard_error(values) / abs(mean) if mean else math.nan)
        return spreads


@dataclass(frozen=True)
class TrajectoryProblem:
    """A problem for steppers with solvers.

    Attributes:
        name: the scene, ``Name(option=value)``.
        duration: simulated time [s].
        members: seeds of the scene if ``measure`` is ``Aggregates``, else factors of steps or tolerances.
        measure: the measure of the error.
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
        """SHA-256 of its name and its numbers; results of problems with different digests are not comparable."""
        measure = [type(self.measure).__name__, self.measure.numbers]
        numbers = [self.name, float(self.duration), [*map(float, self.members)], measure]
        return hashlib.sha256(json.dumps(numbers, sort_keys=True).encode()).hexdigest()


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of the mean of two or more values."""
    return stdev(values) / math.sqrt(len(values))


def _coordinates(recorder: MotionRecorder) -> Values:
    return {f"q{index}": float(value) for index, value in enumerate(recorder.last.position)}
