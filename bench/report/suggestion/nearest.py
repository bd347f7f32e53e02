"""The solver that was fastest on the problems most like a given one, and what such suggestions cost.

The cost of a solver on a measured problem is log(t / t*), with the time t to the accuracy and the least one t* of all
solvers, and log ``UNSOLVED_FACTOR`` where it does not reach it. For a given problem the costs on the ``NEIGHBOURS``
measured problems that are closest in their features are averaged with weights 1 / (d + ``NEAR``)², d their distance,
and the solver of the least cost is taken.

What that costs is measured by leaving out: each measured problem gets a suggestion from all others, or from all others
of other families, and the cost of the suggested solver on it is its regret.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....problems.arrays import FloatArray
from .features import distances

NEIGHBOURS = 8
"""Measured problems that a suggestion goes by."""

NEAR = 0.25
"""Distance below which problems count almost the same."""

UNSOLVED_FACTOR = 100.0
"""Times the least time that not to solve a problem counts as."""


class Regret(NamedTuple):
    """What suggestions cost.

    Attributes:
        factor: geometric mean of the time over the least one, over the problems that are solved; NaN without any.
        unsolved: number of problems that the suggested solver does not solve while another one does.
        problems: number of problems that had a suggestion.
    """

    factor: float
    unsolved: int
    problems: int

    def __str__(self) -> str:
        return f"{self.factor:.2f} times the least time, {self.unsolved} of {self.problems} unsolved"


def costs(seconds: FloatArray) -> FloatArray:
    """Return the costs of solvers (columns) on problems (rows), each of which one of them solves, from times [s]."""
    ratios = np.log(seconds / np.nanmin(seconds, axis=1, keepdims=True))
    capped: FloatArray = np.minimum(np.nan_to_num(ratios, nan=np.inf), np.log(UNSOLVED_FACTOR))
    return capped


def nearest_weights(given: FloatArray, measured: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the weights of measured problems in a suggestion, and their distances, both of shape (n,)."""
    distance = distances(given, measured)
    weights = 1.0 / (distance + NEAR) ** 2
    weights[np.argsort(distance, kind="stable")[NEIGHBOURS:]] = 0.0
    return weights / weights.sum(), distance


def regret(costs: FloatArray, measured: FloatArray, groups: Sequence[str]) -> Regret:
    """Return the regret of suggestions for each problem from those of other groups."""
    found = []
    for place, others in _left_out(groups):
        weights, _ = nearest_weights(measured[place], measured[others])
        found.append(float(costs[place, np.argmin(weights @ costs[others])]))
    return _regret(found)


def regret_of_single_best(costs: FloatArray, groups: Sequence[str]) -> Regret:
    """Return the regret of taking, for each problem, the solver that is best on those of other groups."""
    return _regret([float(costs[place, np.argmin(costs[others].mean(axis=0))]) for place, others in _left_out(groups)])


def _left_out(groups: Sequence[str]) -> list[tuple[int, NDArray[np.bool_]]]:
    """Return the place of each problem, and which problems are of other groups, if there are any."""
    of_groups = np.array(groups)
    pairs = ((place, of_groups != group) for place, group in enumerate(of_groups))
    return [(place, others) for place, others in pairs if others.any()]


def _regret(found: Sequence[float]) -> Regret:
    solved = [cost for cost in found if cost < np.log(UNSOLVED_FACTOR)]
    factor = float(np.exp(np.mean(solved))) if solved else float("nan")
    return Regret(factor, len(found) - len(solved), len(found))
