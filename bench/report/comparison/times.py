"""Ratios of the times of two runs, per point, case and solver, with confidence intervals.

A pass is one observation, because its rounds run in the same processes. Its time is the shortest of its rounds, because
a disturbance can only lengthen a round. All times are compared by their logarithms. The difference at a point (solver,
problem, accuracy) is that of the medians of the passes of both runs. The difference of a case is the mean over its
points, and that of a solver is the mean over its cases. The sources of variance are

    passes     The interval of a point follows from ``bootstrap_ratio`` of its passes. The two to five passes of a case
               are too few to resample. Its variance is σ² (1/n + 1/m) for n and m passes, where σ² is the larger of
               the variance of its own passes and the median variance of all cases. Medians of three or more passes
               have ``MEDIAN_VARIANCE`` times this variance.
    problems   The interval of a solver follows from ``bootstrap_ratio`` of its cases, with its problems as clusters.
    runs       All times of a run may shift by ``RUN_SPREAD``. This variance is added if the shift cannot be
               distinguished from a change of the solvers.

Ratios are relative to a scale, the median over the yardsticks: solvers that are the same program in both runs. If the
program has changed, no solver is known to be the same. The scale is then the median of all solvers or, if its logarithm
exceeds ``MAX_DRIFT`` in absolute value, 1.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from ....problems.arrays import FloatArray
from ...store.frames import CASE, RunFrames
from ...store.ratios import MIN_PAIRS, MIN_ROUNDS, bootstrap_ratio, counted_rounds, reaching
from .pairing import Pairing

RUN_SPREAD = 0.04
"""Standard deviation of the common shift in the logarithms of the times of two runs of the same program."""

MAX_DRIFT = 2.0 * RUN_SPREAD
"""Largest logarithm of the scale if no solver is known to be the same program in both runs."""

MIN_YARDSTICKS = 3
"""Smallest number of yardsticks that determine a scale."""

DEGREES_OF_FREEDOM = 10
"""Degrees of freedom of Student's t in intervals of cases; few, because one disturbance may affect all passes."""

MEDIAN_VARIANCE = np.pi / 2.0
"""Variance of the median of many normally distributed numbers, relative to that of their mean."""

ONE_SIDED_CONFIDENCE = 0.95
"""Probability that the true ratio lies above the lower end of an interval, and that it lies below the upper end."""

HALF_WIDTH = float(special.ndtri(ONE_SIDED_CONFIDENCE))
"""Half width of an interval in standard deviations."""

POINTS = [*CASE, "accuracy", "before", "after", "ratio", "low", "high"]
CASES = [*CASE, "before", "after", "ratio", "low", "high"]
SOLVERS = ["solver", "problems", "before", "after", "ratio", "low", "high"]
"""Columns of the frames: times [s] (geometric means over several points), their ratio, and the ends of its interval.

Ratios of cases and solvers are divided by the scale; those of points are not.
"""


class Times(NamedTuple):
    """Differences in times.

    Attributes:
        points: one row per solver, problem and accuracy that both runs reach, columns ``POINTS``; not scaled.
        cases: one row per solver and problem, columns ``CASES``, with intervals that hold for all cases at once.
        solvers: one row per solver, columns ``SOLVERS``.
        scale: factor that divides the times of the second run.
    """

    points: pd.DataFrame
    cases: pd.DataFrame
    solvers: pd.DataFrame
    scale: float


def compare_times(pairing: Pairing) -> Times:
    """Return the ratios of the times of two runs, the second over the first."""
    passes, points = _reached_passes(pairing)
    cases = _with_noise(_cases(points), passes)
    solvers = _solvers(cases)
    scale, spread = _scale(solvers[solvers["solver"].isin(pairing.yardsticks)], pairing.is_same_software)
    corrected = 1.0 - (1.0 - ONE_SIDED_CONFIDENCE) / max(len(cases), 1)
    half_cases = float(special.stdtrit(DEGREES_OF_FREEDOM, corrected)) * np.hypot(cases["noise"], spread)
    half_solvers = HALF_WIDTH * np.hypot(solvers["noise"], spread)
    return Times(
        points[POINTS],
        _ratios(cases, scale, half_cases)[CASES],
        _ratios(solvers, scale, half_solvers)[SOLVERS],
        float(np.exp(scale)),
    )


def reaching_tolerances(run: RunFrames, accuracies: Sequence[float]) -> pd.DataFrame:
    """Return the coarsest tolerance that reaches each accuracy: columns problem, solver, accuracy, tolerance.

    Times at one tolerance measure the same work, while the fastest of several tolerances varies by chance.
    """
    limit, parts = run.info.plan.limits.solve_seconds, []
    for accuracy in accuracies:
        reached = reaching(run.points, accuracy, limit).sort_values("tolerance", ascending=False, kind="stable")
        parts.append(reached.drop_duplicates(CASE)[[*CASE, "tolerance"]].assign(accuracy=accuracy))
    return pd.concat(parts, ignore_index=True)


def _reached_passes(pairing: Pairing) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the passes of all points that both runs reach, and the points."""
    key, sides = [*CASE, "accuracy"], []
    for side, run in enumerate((pairing.before, pairing.after)):
        counted = counted_rounds(run.rounds).rename(columns={"logarithm": "log_time"})
        rounds_of_run = reaching_tolerances(run, pairing.accuracies).merge(counted, on=[*CASE, "tolerance"])
        sides.append(rounds_of_run.assign(side=side))
    rounds = pd.concat(sides, ignore_index=True)
    passes = rounds.groupby([*key, "side", "session", "number"], sort=False)["log_time"].min().reset_index()
    passes = passes[passes.groupby(key, sort=False)["side"].transform("nunique") == 2]
    samples = dict(iter(rounds.groupby(key, sort=False)))
    rows = []
    for name, point in passes.groupby(key, sort=False):
        log_times = _by_side(point)
        medians = [float(np.exp(np.median(side_log_times))) for side_log_times in log_times]
        if min(map(len, log_times)) < MIN_ROUNDS:
            log_times = _by_side(samples[name])
        interval = bootstrap_ratio(log_times[1], log_times[0])
        rows.append((*name, *medians, medians[1] / medians[0], interval.low, interval.high))
    return passes, pd.DataFrame(rows, columns=POINTS)


def _by_side(rows: pd.DataFrame) -> list[FloatArray]:
    """Return the logarithms of the times of the first and of the second run."""
    log_times, sides = rows["log_time"].to_numpy(), rows["side"].to_numpy()
    return [log_times[sides == side] for side in (0, 1)]


def _cases(points: pd.DataFrame) -> pd.DataFrame:
    """Return, for each case, the geometric means of its times, and the mean difference of their logarithms."""
    logarithms = points[CASE].assign(
        before=np.log(points["before"]), after=np.log(points["after"]), difference=np.log(points["ratio"])
    )
    cases = logarithms.groupby(CASE, sort=False).mean().reset_index()
    return cases.assign(before=np.exp(cases["before"]), after=np.exp(cases["after"]))


def _with_noise(cases: pd.DataFrame, passes: pd.DataFrame) -> pd.DataFrame:
    """Return the cases with a column "noise", the standard deviation that follows from their passes.

    It is infinite if no case has more than one pass of the same run.
    """
    centres = passes.groupby([*CASE, "accuracy", "side"])["log_time"].transform("mean")
    deviations = passes.assign(deviation=passes["log_time"] - centres)
    pass_deviations = deviations.groupby([*CASE, "side", "session", "number"])["deviation"].mean()
    sides = pass_deviations.groupby([*CASE, "side"])
    counts, squares = sides.size().unstack(), sides.agg(lambda deviation: float((deviation**2).sum())).unstack()
    degrees_of_freedom = (counts - 1).sum(axis=1)
    positive_degrees = degrees_of_freedom.where(degrees_of_freedom > 0)
    case_variance = squares.sum(axis=1) / positive_degrees
    typical = (case_variance * degrees_of_freedom / special.chdtri(positive_degrees, 0.5)).median()
    variance = np.maximum(case_variance.fillna(0.0), typical if np.isfinite(typical) else np.inf)
    efficiency = counts.map(lambda n: MEDIAN_VARIANCE if n > 2 else 1.0)
    noise = np.sqrt(variance * (efficiency / counts).sum(axis=1)).rename("noise")
    return cases.merge(noise.reset_index(), on=CASE, how="left")


def _solvers(cases: pd.DataFrame) -> pd.DataFrame:
    """Return, for each solver, geometric mean times, the mean difference, and its standard deviation (noise).

    The noise is that of a normal interval as wide as the bootstrap interval over problems. With few problems, it
    follows from the passes.
    """
    rows = []
    for solver, solver_cases in cases.groupby("solver", sort=False):
        n, differences = len(solver_cases), solver_cases["difference"].to_numpy()
        noise = np.sqrt((solver_cases["noise"] ** 2).sum()) / n
        if n >= MIN_PAIRS and np.isfinite(noise):
            interval = bootstrap_ratio(differences, confidence=2.0 * ONE_SIDED_CONFIDENCE - 1.0, statistic=np.mean)
            noise = np.log(interval.high / interval.low) / (2.0 * HALF_WIDTH)
        before, after = (float(np.exp(np.log(solver_cases[side]).mean())) for side in ("before", "after"))
        rows.append((solver, n, before, after, differences.mean(), noise))
    return pd.DataFrame(rows, columns=["solver", "problems", "before", "after", "difference", "noise"])


def _scale(yardsticks: pd.DataFrame, is_same_software: bool) -> tuple[float, float]:
    """Return the logarithm of the scale and its standard deviation, from the differences of the yardsticks."""
    if len(yardsticks) < MIN_YARDSTICKS:
        return 0.0, RUN_SPREAD
    scale = float(yardsticks["difference"].median())
    if not is_same_software and abs(scale) > MAX_DRIFT:
        return 0.0, RUN_SPREAD
    return scale, float(yardsticks["noise"].median() * np.sqrt(MEDIAN_VARIANCE / len(yardsticks)))


def _ratios(frame: pd.DataFrame, scale: float, half_width: FloatArray) -> pd.DataFrame:
    """Return a frame of differences with ratios over the scale, and intervals of ``half_width`` in logarithms."""
    centre = frame["difference"].to_numpy(dtype=np.float64) - scale
    return frame.assign(ratio=np.exp(centre), low=np.exp(centre - half_width), high=np.exp(centre + half_width))
