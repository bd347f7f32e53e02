"""How times of two runs differ: at each point, in each case, and of each solver, with intervals.

A pass is one observation, because its rounds share their processes: the least of their times, since what disturbs a
round makes it longer. Of all times the logarithms are compared. A point (solver, problem, accuracy) differs by the
difference of the medians of its passes, a case by the mean over its points, and a solver by the mean over its cases.
Times scatter by

    passes     σ² (1/n + 1/m) of a case with n and m passes, with the larger one of two variances σ²: that of its own
               passes, and the median over all cases. Medians of three passes or more scatter by EFFICIENCY times that.
    problems   Student's t of the cases of a solver, whose problems are the clusters
    runs       RUN_SPREAD of all times together, where nothing tells it apart from a change

Ratios are relative to the scale, the median over the yardsticks: solvers that are the same program in both runs. Where
the program has changed, no solver is known to be the same, and the median of all is taken for the machine's only up to
``LARGEST_DRIFT``.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from ....problems.arrays import FloatArray
from ...store.certainty import LEAST_ROUNDS, interval_of_two, reaching
from ...store.frames import RunFrames
from .pairing import CASE, Pairing

RUN_SPREAD = 0.04
"""Standard deviation by which the logarithms of all times of two runs of the same program differ together."""

LARGEST_DRIFT = 2.0 * RUN_SPREAD
"""Largest logarithm that is taken for the machine's, where no solver is known to be the same."""

LEAST_YARDSTICKS = 3
"""Yardsticks that a scale needs."""

LEAST_CLUSTERS = 3
"""Problems of which the spread over problems is estimated."""

TAILS = 10
"""Degrees of freedom of Student's t that intervals of cases have: a disturbance of minutes hits all passes of one."""

EFFICIENCY = np.pi / 2.0
"""Variance of the median over that of the mean of many normal numbers."""

ONE_SIDED = 0.95
"""Chance that the true ratio lies above the lower end of an interval, and that it lies below the upper one."""

NORMAL = float(special.ndtri(ONE_SIDED))
"""Standard deviations that half an interval has."""

POINTS = [*CASE, "accuracy", "before", "after", "ratio", "low", "high"]
CASES = [*CASE, "before", "after", "ratio", "low", "high"]
SOLVERS = ["solver", "problems", "before", "after", "ratio", "low", "high"]
"""Columns of the frames: times [s], geometric means where they are of several points, their ratio over the scale, and
the ends of its interval."""


class Times(NamedTuple):
    """How times differ.

    Attributes:
        points: one row a solver, problem and accuracy that both runs reach, columns ``POINTS``; not scaled.
        cases: one row a solver and problem, columns ``CASES``; their intervals hold together.
        solvers: one row a solver, columns ``SOLVERS``.
        scale: by which times of the second run are divided.
    """

    points: pd.DataFrame
    cases: pd.DataFrame
    solvers: pd.DataFrame
    scale: float


def compared_times(pairing: Pairing) -> Times:
    """Return how the times of two runs differ."""
    passes, points = _reached_passes(pairing)
    cases = _with_noise(_cases(points), passes)
    solvers = _solvers(cases)
    scale, spread = _scale(solvers[solvers["solver"].isin(pairing.yardsticks)], pairing.is_known)
    corrected = 1.0 - (1.0 - ONE_SIDED) / max(len(cases), 1)
    half_cases = float(special.stdtrit(TAILS, corrected)) * np.hypot(cases["noise"], spread)
    half_solvers = NORMAL * np.hypot(solvers["noise"], spread)
    return Times(
        points[POINTS],
        _ratios(cases, scale, half_cases)[CASES],
        _ratios(solvers, scale, half_solvers)[SOLVERS],
        float(np.exp(scale)),
    )


def reaching_tolerances(run: RunFrames, accuracies: Sequence[float]) -> pd.DataFrame:
    """Return the coarsest tolerance that reaches each accuracy: columns problem, solver, accuracy, tolerance.

    Times at one tolerance are those of the same work, while the fastest of several is another one by chance.
    """
    limit, parts = run.info.plan.limits.solve_seconds, []
    for accuracy in accuracies:
        reached = reaching(run.points, accuracy, limit).sort_values("tolerance", ascending=False, kind="stable")
        parts.append(reached.drop_duplicates(CASE)[[*CASE, "tolerance"]].assign(accuracy=accuracy))
    return pd.concat(parts, ignore_index=True)


def _reached_passes(pairing: Pairing) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the passes of all points that both runs reach, and the points."""
    key, parts, rounds = [*CASE, "accuracy"], [], []
    for side, run in enumerate((pairing.before, pairing.after)):
        kept = run.rounds[(run.rounds["total_seconds"] > 0.0) & (run.rounds["excluded"] == "")]
        own = reaching_tolerances(run, pairing.accuracies).merge(kept, on=[*CASE, "tolerance"])
        own = own.assign(side=side, time=np.log(own["total_seconds"]))
        rounds.append(own)
        parts.append(own.groupby([*key, "side", "session", "number"], sort=False)["time"].min().reset_index())
    passes = pd.concat(parts, ignore_index=True)
    both = passes.groupby(key, sort=False)["side"].transform("nunique") == 2
    passes = passes[both]
    samples = [{name: one.to_numpy() for name, one in frame.groupby(key)["time"]} for frame in rounds]
    rows = []
    for name, point in passes.groupby(key, sort=False):
        times = [point["time"][point["side"] == side].to_numpy() for side in (0, 1)]
        if min(map(len, times)) < LEAST_ROUNDS:
            times = [sample[name] for sample in samples]
        found = [np.nan, 0.0, np.inf]
        if min(map(len, times)) >= LEAST_ROUNDS:
            found = list(interval_of_two(times[1], times[0]))
        medians = [float(np.exp(np.median(time))) for time in times]
        rows.append((*name, *medians, medians[1] / medians[0], *found[1:]))
    return passes, pd.DataFrame(rows, columns=POINTS)


def _cases(points: pd.DataFrame) -> pd.DataFrame:
    """Return mean times and the mean difference of their logarithms of each case."""
    logarithms = points[CASE].assign(
        before=np.log(points["before"]), after=np.log(points["after"]), difference=np.log(points["ratio"])
    )
    cases = logarithms.groupby(CASE, sort=False).mean().reset_index()
    return cases.assign(before=np.exp(cases["before"]), after=np.exp(cases["after"]))


def _with_noise(cases: pd.DataFrame, passes: pd.DataFrame) -> pd.DataFrame:
    """Return the cases with the standard deviation that their passes give them (noise); infinite without any."""
    centres = passes.groupby([*CASE, "accuracy", "side"])["time"].transform("mean")
    deviations = passes.assign(time=passes["time"] - centres)
    of_passes = deviations.groupby([*CASE, "side", "session", "number"])["time"].mean()
    sides = of_passes.groupby([*CASE, "side"])
    counts, squares = sides.size().unstack(), sides.agg(lambda one: float((one**2).sum())).unstack()
    freedom = (counts - 1).sum(axis=1)
    own = squares.sum(axis=1) / freedom.where(freedom > 0)
    usual = (own * freedom / special.chdtri(freedom.where(freedom > 0), 0.5)).median()
    variance = np.maximum(own.fillna(0.0), usual if np.isfinite(usual) else np.inf)
    efficiency = counts.map(lambda n: EFFICIENCY if n > 2 else 1.0)
    noise = np.sqrt(variance * (efficiency / counts).sum(axis=1)).rename("noise")
    return cases.merge(noise.reset_index(), on=CASE, how="left")


def _solvers(cases: pd.DataFrame) -> pd.DataFrame:
    """Return mean times and mean differences of solvers, and their standard deviation (noise).

    That is taken from the spread over problems, so that a normal interval is as wide as Student's; over few problems,
    from the passes.
    """
    rows = []
    for solver, own in cases.groupby("solver", sort=False):
        n, differences = len(own), own["difference"].to_numpy()
        noise = np.sqrt((own["noise"] ** 2).sum()) / n
        if n >= LEAST_CLUSTERS and np.isfinite(noise):
            widening = special.stdtrit(n - 1, ONE_SIDED) / NORMAL
            noise = widening * differences.std(ddof=1) / np.sqrt(n)
        before, after = (float(np.exp(np.log(own[side]).mean())) for side in ("before", "after"))
        rows.append((solver, n, before, after, differences.mean(), noise))
    return pd.DataFrame(rows, columns=["solver", "problems", "before", "after", "difference", "noise"])


def _scale(yardsticks: pd.DataFrame, is_known: bool) -> tuple[float, float]:
    """Return the logarithm of the scale and its standard deviation, from the differences of the yardsticks."""
    if len(yardsticks) < LEAST_YARDSTICKS:
        return 0.0, RUN_SPREAD
    scale = float(yardsticks["difference"].median())
    if not is_known and abs(scale) > LARGEST_DRIFT:
        return 0.0, RUN_SPREAD
    return scale, float(yardsticks["noise"].median() * np.sqrt(EFFICIENCY / len(yardsticks)))


def _ratios(frame: pd.DataFrame, scale: float, half: FloatArray) -> pd.DataFrame:
    """Return a frame of differences with ratios over the scale, and intervals of this half width."""
    centre = frame["difference"].to_numpy(dtype=np.float64) - scale
    return frame.assign(ratio=np.exp(centre), low=np.exp(centre - half), high=np.exp(centre + half))
