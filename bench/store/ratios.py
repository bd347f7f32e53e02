"""Estimate ratios of two times with confidence intervals.

Two solvers that are measured in the same pass run in the same state of the machine, so their times t are compared in
pairs, d = log(t_a / t_b). Rounds of one pass share their processes, so each pass gives one pair of means; if there are
too few passes, each round gives a pair. The ratio is exp(median d), because other programs disturb few rounds, each by
a large factor.

The interval is the percentile interval of ``scipy.stats.bootstrap``. For n values its level is expanded so that its
ends are the quantiles of the bootstrap distribution at

    Φ(±t(1/2 + level/2, n - 1) √(n / (n - 1)))

with the normal distribution function Φ and the quantile t of Student's distribution (T. Hesterberg, What Teachers
Should Know About the Bootstrap, The American Statistician 69(4), 2015). The plain interval is too narrow for small n.
Fewer than ``MIN_PAIRS`` pairs have no interval, because it would miss the true ratio too often.

Excluded rounds never count. If too few pairs remain, the remaining times are compared as two samples,
median log t_a - median log t_b, with n the size of the smaller one. ``MIN_ROUNDS`` rounds of both are enough: with
three rounds each, all rounds of one solver are slower than all rounds of the other by chance in 1 of 20 cases.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from .outcome import Outcome

CONFIDENCE = 0.95
"""Confidence level of an interval."""

MIN_PAIRS = 5
"""Least number of pairs for an interval."""

MIN_ROUNDS = 3
"""Least number of times of each solver for an interval without pairs."""

MARGIN = 0.05
"""Relative excess over the time of the fastest solver above which a solver counts as slower. Times of processes that
run the same program differ by a few per cent."""

RESAMPLES = 1000
"""Number of resamples of a bootstrap."""

MAX_OVERTIME = 1.1
"""Largest multiple of the time limit at which a solve counts; it may finish an iteration after the limit."""

SLOWER, EXCLUDED, ALONE = "slower", "excluded", "alone"
"""Standings: slower than the fastest solver, only excluded rounds, and no other solver with as many threads."""

STANDINGS = ("solver", "tolerance", "seconds", "ratio", "low", "high", "standing")
"""Columns of ``standings``."""

_ROUND_LEVELS = ["session", "number", "turn"]
"""Levels of the index of times, which identify a round."""

_PASS_LEVELS = 2
"""Number of the first levels that identify a pass."""

Times = dict[tuple[str, float], "pd.Series[float]"]
"""Logarithms of the times of one problem by solver and tolerance, indexed by session, number and turn."""


class Ratio(NamedTuple):
    """A ratio of times, and the ends of its interval, which is infinite if there are too few times."""

    value: float
    low: float
    high: float


UNKNOWN = Ratio(np.nan, 0.0, np.inf)
"""The ratio of two solvers without comparable times."""


def bootstrap_ratio(
    logarithms: FloatArray,
    others: FloatArray | None = None,
    confidence: float = CONFIDENCE,
    statistic: Callable[..., Any] = np.median,
) -> Ratio:
    """Return a ratio of times, with an infinite interval if there are too few numbers.

    Args:
        logarithms: logarithms of the ratios of pairs if ``others`` is None, else of the times in the numerator,
            shape (n,).
        others: logarithms of the times in the denominator, shape (m,).
        confidence: level of the interval.
        statistic: location of a sample, with an argument ``axis``.
    """
    samples = (logarithms,) if others is None else (logarithms, others)
    n, needed = min(map(len, samples)), MIN_PAIRS if others is None else MIN_ROUNDS
    if n == 0:
        return UNKNOWN

    def log_ratio(*parts: FloatArray, axis: int = -1) -> Any:
        locations = [statistic(part, axis=axis) for part in parts]
        return locations[0] - locations[1] if others is not None else locations[0]

    value = float(np.exp(log_ratio(*samples)))
    if n < needed:
        return Ratio(value, 0.0, np.inf)
    from scipy import stats  # slow to import, and only reports need it

    bootstrap = stats.bootstrap(
        samples,
        log_ratio,
        n_resamples=RESAMPLES,
        vectorized=True,
        confidence_level=_expanded_level(confidence, n),
        method="percentile",
        rng=np.random.default_rng(n),
    )
    low, high = np.exp(bootstrap.confidence_interval)
    return Ratio(value, float(low), float(high))


@cache
def _expanded_level(confidence: float, n: int) -> float:
    """Return the level at which a percentile interval of n values has about the coverage ``confidence``."""
    return float(2.0 * special.ndtr(special.stdtrit(n - 1, 0.5 + confidence / 2.0) * np.sqrt(n / (n - 1))) - 1.0)


def ratio(times: "pd.Series[float]", others: "pd.Series[float]") -> Ratio:
    """Return the ratio of ``times`` to ``others``; NaN without times.

    Args:
        times: logarithms of the times of one solver on a problem, as in ``Times``.
        others: those of another solver on the same problem.
    """
    for n_levels in (_PASS_LEVELS, len(_ROUND_LEVELS)):
        means, means_of_others = _means(times, n_levels), _means(others, n_levels)
        pairs = np.array([means[key] - means_of_others[key] for key in sorted(means.keys() & means_of_others.keys())])
        if len(pairs) >= MIN_PAIRS:
            return bootstrap_ratio(pairs)
    if min(len(times), len(others)) >= MIN_ROUNDS:
        return bootstrap_ratio(_array(times), _array(others))
    return bootstrap_ratio(pairs)


def _means(times: "pd.Series[float]", n_levels: int) -> dict[tuple[int, ...], float]:
    """Return the mean of the times that agree in the first levels of their index, by the values of these levels."""
    groups: dict[tuple[int, ...], list[float]] = {}
    for key, value in zip(times.index.tolist(), times.tolist(), strict=True):
        if not math.isnan(value):
            groups.setdefault(key[:n_levels], []).append(value)
    return {key: math.fsum(values) / len(values) for key, values in groups.items()}


def _array(values: "pd.Series[float]") -> FloatArray:
    return np.asarray(values, dtype=np.float64)


def counted_rounds(rounds: pd.DataFrame) -> pd.DataFrame:
    """Return the rounds that are not excluded and have a time, with a column "logarithm" of the times."""
    counted = rounds[(rounds["excluded"] == "") & (rounds["total_seconds"] > 0.0)]
    return counted.assign(logarithm=np.log(counted["total_seconds"]))


def times_by_point(rounds: pd.DataFrame) -> Times:
    """Return the logarithms of the times in the counted rounds of one problem; ``rounds`` are as in ``RunFrames``."""
    logarithms = counted_rounds(rounds).set_index(_ROUND_LEVELS)
    groups: Any = logarithms.groupby(["solver", "tolerance"], sort=False)["logarithm"]
    return dict(iter(groups))


def reaching(points: pd.DataFrame, accuracy: float, limit: float = np.inf) -> pd.DataFrame:
    """Return the points whose residual is at most ``accuracy`` within the time limit [s] of a solve.

    Wrong points do not count, nor do points that claim success after the limit or exceed ``MAX_OVERTIME`` times it.
    """
    is_late = (points["outcome"] == Outcome.TIME_LIMIT) & (points["status"] == Status.SOLVED)
    is_late |= points["total_seconds"] > MAX_OVERTIME * limit
    reached: pd.DataFrame = points[(points["residual"] <= accuracy) & (points["outcome"] != Outcome.WRONG) & ~is_late]
    return reached


def standings(points: pd.DataFrame, times: Times, accuracy: float, limit: float) -> pd.DataFrame:
    """Return one row for each solver that reaches an accuracy on one problem, the fastest first, excluded ones last.

    Columns: solver, tolerance (of its fastest point that reaches it), seconds (its median time), ratio (to the fastest
    solver), low and high (the ends of its interval), and standing: "fastest" if all others are slower by ``MARGIN``,
    "tie" if it may be as fast as the fastest one, "slower", "undecided" if there are too few rounds, and "excluded".
    An excluded solver has no ratio. Its true time may be any fraction of the measured one, so on a problem with an
    excluded solver the first solver is "undecided".

    Args:
        points: points of the problem, as in ``RunFrames``.
        times: times of the problem.
        accuracy: judged residual.
        limit: time limit of one solve [s].
    """
    reached = reaching(points, accuracy, limit).dropna(subset="total_seconds").astype({"is_excluded": bool})
    reached = reached.sort_values("total_seconds", kind="stable").drop_duplicates("solver")
    reached = reached.sort_values("is_excluded", kind="stable", ignore_index=True)
    n_excluded = int(reached["is_excluded"].sum())
    n_compared = len(reached) - n_excluded
    no_times = pd.Series(np.empty(0), index=pd.MultiIndex.from_arrays([[]] * 3, names=_ROUND_LEVELS))
    points_reached = zip(reached["solver"], reached["tolerance"], strict=True)
    compared_times = [times.get(point, no_times) for point in points_reached][:n_compared]
    ratios = [ratio(others, compared_times[0]) for others in compared_times[1:]]
    standings_of_others = [
        SLOWER if other.low > 1.0 + MARGIN else "tie" if np.isfinite(other.high) else "undecided" for other in ratios
    ]
    best = next((name for name in ("tie", "undecided") if name in standings_of_others), "fastest")
    values = [Ratio(1.0, 1.0, 1.0), *ratios][:n_compared] + [UNKNOWN] * n_excluded
    all_standings = ["undecided" if n_excluded else best, *standings_of_others][:n_compared] + [EXCLUDED] * n_excluded
    rows = reached[["solver", "tolerance"]].assign(seconds=reached["total_seconds"])
    return rows.assign(
        **pd.DataFrame(values, columns=["ratio", "low", "high"], dtype=np.float64),
        standing=pd.Series(all_standings, dtype=str),
    )
