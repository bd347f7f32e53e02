"""Ratios of two times with confidence intervals: the only estimator of such ratios in this package.

Two solvers that are measured in the same pass run in the same state of the machine, so their times t are compared in
pairs, d = log(t_a / t_b). Rounds of one pass share their processes, so each pass gives one pair of means; if there are
too few passes, each round gives a pair. The ratio is exp(median d), because other programs disturb few rounds, each by
a large factor.

The interval is the percentile interval of ``scipy.stats.bootstrap``. For n values its level is expanded so that its
ends are the quantiles

    Φ(±t(1/2 + level/2, n - 1) √(n / (n - 1)))

with the normal distribution function Φ and the quantile t of Student's distribution (T. Hesterberg, What Teachers
Should Know About the Bootstrap, The American Statistician 69(4), 2015). The plain interval is too narrow for small n.
Fewer than ``MIN_PAIRS`` pairs have no interval, because it would miss the true ratio too often.

Excluded rounds never count. If too few pairs remain, the remaining times are compared as two samples,
median log t_a - median log t_b, with n the size of the smaller one. ``MIN_ROUNDS`` rounds of both are enough: all of
them are slower than three others by chance in 1 of 20 cases.
"""

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
"""Share of intervals that contain the true ratio."""

MIN_PAIRS = 5
"""Least number of pairs for an interval."""

MIN_ROUNDS = 3
"""Least number of times of each solver for an interval without pairs."""

MARGIN = 0.05
"""Relative time by which a solver must exceed the fastest one to count as slower, because processes that run the same
program differ by some per cent."""

RESAMPLES = 1000
"""Number of resamples of a bootstrap."""

MAX_OVERTIME = 1.1
"""Largest multiple of the time limit at which a solve counts; it may finish an iteration after the limit."""

SLOWER, EXCLUDED, ALONE = "slower", "excluded", "alone"
"""Standings: slower than the fastest solver, only excluded rounds, and no other solver with as many threads."""

STANDINGS = ("solver", "tolerance", "seconds", "ratio", "low", "high", "standing")
"""Columns of ``standings``."""

_PASS, _ROUND = ["session", "number"], ["session", "number", "turn"]

Times = dict[tuple[str, float], "pd.Series[float]"]
"""Logarithms of the times of one problem by solver and tolerance, indexed by session, number and turn."""


class Ratio(NamedTuple):
    """A ratio of times, and the ends of its interval, which is infinite if there are too few times."""

    value: float
    low: float
    high: float


UNKNOWN = Ratio(np.nan, 0.0, np.inf)
"""The ratio without times."""


def bootstrap_ratio(
    logarithms: FloatArray,
    others: FloatArray | None = None,
    confidence: float = CONFIDENCE,
    statistic: Callable[..., Any] = np.median,
) -> Ratio:
    """Return a ratio of times and its interval.

    Args:
        logarithms: logarithms of the ratios of pairs, or of the times of one side, shape (n,).
        others: logarithms of the times of the other side, shape (m,); None for pairs.
        confidence: level of the interval.
        statistic: location of a sample, with an argument ``axis``.
    """
    samples = (logarithms,) if others is None else (logarithms, others)
    n, needed = min(map(len, samples)), MIN_PAIRS if others is None else MIN_ROUNDS
    if n == 0:
        return UNKNOWN

    def difference(*parts: FloatArray, axis: int = -1) -> Any:
        located = [statistic(part, axis=axis) for part in parts]
        return located[0] - located[1] if others is not None else located[0]

    value = float(np.exp(difference(*samples)))
    if n < needed:
        return Ratio(value, 0.0, np.inf)
    from scipy import stats  # slow to import, and only reports need it

    found = stats.bootstrap(
        samples,
        difference,
        n_resamples=RESAMPLES,
        vectorized=True,
        confidence_level=_expanded(confidence, n),
        method="percentile",
        rng=np.random.default_rng(n),
    )
    low, high = np.exp(found.confidence_interval)
    return Ratio(value, float(low), float(high))


@cache
def _expanded(confidence: float, n: int) -> float:
    """Return the level at which a percentile interval of n values has a coverage of ``confidence``."""
    return float(2.0 * special.ndtr(special.stdtrit(n - 1, 0.5 + confidence / 2.0) * np.sqrt(n / (n - 1))) - 1.0)


def ratio(times: "pd.Series[float]", others: "pd.Series[float]") -> Ratio:
    """Return the ratio of the times of two solvers on one problem, as in ``Times``; NaN without times."""
    for moment in (_PASS, _ROUND):
        pairs = (times.groupby(level=moment).mean() - others.groupby(level=moment).mean()).dropna()
        if len(pairs) >= MIN_PAIRS:
            return bootstrap_ratio(_array(pairs))
    if min(len(times), len(others)) >= MIN_ROUNDS:
        return bootstrap_ratio(_array(times), _array(others))
    return bootstrap_ratio(_array(pairs))


def _array(values: "pd.Series[float]") -> FloatArray:
    return np.asarray(values, dtype=np.float64)


def counted_rounds(rounds: pd.DataFrame) -> pd.DataFrame:
    """Return the rounds that are not excluded and have a time, with a column "logarithm" of the times."""
    counted = rounds[(rounds["excluded"] == "") & (rounds["total_seconds"] > 0.0)]
    return counted.assign(logarithm=np.log(counted["total_seconds"]))


def times_by_point(rounds: pd.DataFrame) -> Times:
    """Return the logarithms of the times in the counted rounds of one problem; ``rounds`` are as in ``RunFrames``."""
    logarithms = counted_rounds(rounds).set_index(_ROUND)
    groups: Any = logarithms.groupby(["solver", "tolerance"], sort=False)["logarithm"]
    return dict(iter(groups))


def reaching(points: pd.DataFrame, accuracy: float, limit: float = np.inf) -> pd.DataFrame:
    """Return the points whose residual is at most ``accuracy`` within the time limit [s] of a solve.

    Wrong points do not count, nor do points that claim success after the limit or exceed ``MAX_OVERTIME`` times it.
    """
    is_late = (points["outcome"] == Outcome.TIME_LIMIT) & (points["status"] == Status.SOLVED)
    is_late |= points["total_seconds"] > MAX_OVERTIME * limit
    found: pd.DataFrame = points[(points["residual"] <= accuracy) & (points["outcome"] != Outcome.WRONG) & ~is_late]
    return found


def standings(points: pd.DataFrame, times: Times, accuracy: float, limit: float) -> pd.DataFrame:
    """Return one row for each solver that reaches an accuracy on one problem, the fastest first, excluded ones last.

    Columns: solver, tolerance (of its fastest point that reaches it), seconds (its median time), ratio (to the fastest
    solver), low and high (the ends of its interval), and standing: "fastest" if all others are slower by ``MARGIN``,
    "tie" if it may be as fast as the fastest one, "slower", "undecided" if there are too few rounds, and "excluded".
    An excluded solver has no ratio. Its true time may be any fraction of the measured one, so no solver is "fastest" on
    a problem with an excluded solver.

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
    none = pd.Series(np.empty(0), index=pd.MultiIndex.from_arrays([[]] * 3, names=_ROUND))
    own = [times.get(place, none) for place in zip(reached["solver"], reached["tolerance"], strict=True)][:n_compared]
    ratios = [ratio(one, own[0]) for one in own[1:]]
    others = [SLOWER if one.low > 1.0 + MARGIN else "tie" if np.isfinite(one.high) else "undecided" for one in ratios]
    best = next((found for found in ("tie", "undecided") if found in others), "fastest")
    values = [Ratio(1.0, 1.0, 1.0), *ratios][:n_compared] + [UNKNOWN] * n_excluded
    standing = ["undecided" if n_excluded else best, *others][:n_compared] + [EXCLUDED] * n_excluded
    rows = reached[["solver", "tolerance"]].assign(seconds=reached["total_seconds"])
    return rows.assign(
        **pd.DataFrame(values, columns=["ratio", "low", "high"], dtype=np.float64),
        standing=pd.Series(standing, dtype=str),
    )
