"""Points of the work–precision diagram: members gathered into an error with its spread, and a cost."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median, stdev

from .measuring import ERROR, Measured
from .plan import Case


@dataclass(frozen=True)
class Point:
    """What one case costs and how far off it is in one quantity.

    Attributes:
        part: part of the study.
        series: the curve.
        setting: stepper with its step size or options.
        solver: the solver.
        tolerance: of the solver.
        quantity: "error" of a trajectory, or an aggregate of a pour.
        error: median over the members, or the mean deviation from the reference, over the reference's mean.
        low: least error of a member, or the mean deviation less its standard error.
        high: largest error of a member, or the mean deviation and its standard error.
        wall: median wall time [s].
        solves: median of the one-step solves.
        members: how many members it is made of.
        failed: how many came to nothing.
        unsolved: steps of all members that the judge does not find solved.
    """

    part: str
    series: str
    setting: str
    solver: str
    tolerance: float
    quantity: str
    error: float
    low: float
    high: float
    wall: float
    solves: float
    members: int
    failed: int
    unsolved: int


def trajectory_point(case: Case, members: Mapping[float, Measured]) -> Point | None:
    """Return the median error of neighbouring trajectories, from their least to their largest; None without any."""
    good = [one for one in members.values() if not one.failure]
    if not good:
        return None
    errors = [one.values[ERROR] for one in good]
    return _point(case, ERROR, (median(errors), min(errors), max(errors)), good, len(members) - len(good))


def aggregate_points(case: Case, members: Mapping[float, Measured], reference: Mapping[float, Measured]) -> list[Point]:
    """Return for each aggregate how far its mean over seeds is from the reference's, with the standard error of that.

    The same seeds are compared, so that what they have in common cancels; two of them are needed.
    """
    good = {seed: one for seed, one in members.items() if not one.failure}
    both = [seed for seed in good if seed in reference and not reference[seed].failure]
    if len(both) < 2:
        return []
    points = []
    for quantity in reference[both[0]].values:
        scale = abs(fmean(reference[seed].values[quantity] for seed in both))
        off = [good[seed].values[quantity] - reference[seed].values[quantity] for seed in both]
        if not scale:
            continue
        error, spread = abs(fmean(off)) / scale, standard_error(off) / scale
        bounds = (error, max(0.0, error - spread), error + spread)
        points.append(_point(case, quantity, bounds, [good[seed] for seed in both], len(members) - len(good)))
    return points


def seed_spreads(reference: Mapping[float, Measured]) -> dict[str, tuple[float, float]]:
    """Return for each aggregate its mean over the seeds of the reference, and the standard error of that, relative."""
    good = [one for one in reference.values() if not one.failure]
    if len(good) < 2:
        return {}
    found = {}
    for quantity in good[0].values:
        values = [one.values[quantity] for one in good]
        mean = fmean(values)
        found[quantity] = (mean, standard_error(values) / abs(mean) if mean else math.nan)
    return found


def standard_error(values: Sequence[float]) -> float:
    """Return the standard error of the mean of two values or more."""
    return stdev(values) / math.sqrt(len(values))


def _point(
    case: Case, quantity: str, bounds: tuple[float, float, float], good: Sequence[Measured], failed: int
) -> Point:
    error, low, high = bounds
    return Point(
        part=case.part,
        series=case.series,
        setting=case.setting,
        solver=case.solver,
        tolerance=case.tolerance,
        quantity=quantity,
        error=error,
        low=low,
        high=high,
        wall=median(one.wall for one in good),
        solves=median(one.solves for one in good),
        members=len(good),
        failed=failed,
        unsolved=sum(one.unsolved for one in good),
    )
