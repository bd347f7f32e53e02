"""How certain a ratio of two times is: paired by rounds, with an interval from the bootstrap.

Rounds a and b of two solvers on one problem that were measured within moments of each other meet the same machine, so
their times t are compared in pairs, d = log(t_a / t_b). The ratio is exp(median d); medians, since other programs
disturb few rounds, but these by a factor. Its interval is the percentile interval of the bootstrap of that median,
widened for few pairs: with n pairs its ends are the quantiles

    Φ(±t(0.975, n - 1) √(n / (n - 1)))

of the medians of resampled pairs, with the normal distribution Φ and the quantile t of Student's (T. Hesterberg, What
Teachers Should Know About the Bootstrap, The American Statistician 69(4), 2015). With five pairs the interval is about
the range of all; with fewer there is none, since it would hold the true ratio too rarely.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from ...problems.arrays import FloatArray, IntArray
from ...solvers.interface import Status
from .outcome import Outcome
from .records import Round

CONFIDENCE = 0.95
"""Share of intervals that shall hold the true ratio."""

LEAST_PAIRS = 5
"""Pairs of rounds that an interval needs."""

RESAMPLES = 1000
"""Resampled medians."""

LATE = 1.1
"""Solves that took longer than this many times their limit reach nothing; the others may end an iteration."""


STANDINGS = ("solver", "tolerance", "seconds", "ratio", "low", "high", "standing")
"""Columns of ``standings``."""


class Ratio(NamedTuple):
    """A ratio of times, and the ends of its interval; infinitely wide where rounds are too few."""

    value: float
    low: float
    high: float


class Row(NamedTuple):
    """What of a row of the rounds of ``RunFrames`` is compared."""

    session: int
    number: int
    total_seconds: float
    is_marred: bool


Timed = Round | Row
"""A round, as a record or as a row of a frame."""

Times = dict[tuple[str, float], list[Row]]
"""Rounds of one problem by solver and tolerance."""


def ratio(rounds: Sequence[Timed], others: Sequence[Timed]) -> Ratio:
    """Return the time of ``rounds`` over that of ``others``, both of one problem.

    Marred rounds count only where the others make too few pairs.
    """
    steady = ([one for one in side if not one.is_marred] for side in (rounds, others))
    differences = _differences(*steady)
    return interval(differences if len(differences) >= LEAST_PAIRS else _differences(rounds, others))


def interval(differences: FloatArray) -> Ratio:
    """Return the ratio and its interval from the logarithms of paired ratios, shape (n,)."""
    n = len(differences)
    if n == 0:
        return Ratio(np.nan, 0.0, np.inf)
    value = float(np.exp(np.median(differences)))
    if n < LEAST_PAIRS:
        return Ratio(value, 0.0, np.inf)
    medians = np.median(differences[_resamples(n)], axis=1)
    low, high = np.exp(np.quantile(medians, _tails(n)))
    return Ratio(value, float(low), float(high))


def reaching(points: pd.DataFrame, accuracy: float, limit: float = np.inf) -> pd.DataFrame:
    """Return the points whose residual is at most ``accuracy``, of solves that kept their limit of time [s].

    Points that claim what the judge refutes (WRONG), or to have solved after the limit, do not count, nor do those that
    took more than ``LATE`` times the limit whatever they claim.
    """
    is_late = (points["outcome"] == Outcome.TIME_LIMIT) & (points["status"] == Status.SOLVED)
    is_late |= points["solve_seconds"] > LATE * limit
    found: pd.DataFrame = points[(points["residual"] <= accuracy) & (points["outcome"] != Outcome.WRONG) & ~is_late]
    return found


def times_by_point(rounds: pd.DataFrame) -> Times:
    """Return the rounds of one problem, as in ``RunFrames``, by solver and tolerance."""
    found: Times = {}
    columns = (rounds[name] for name in ("solver", "tolerance", "session", "number", "total_seconds", "is_marred"))
    for solver, tolerance, *one in zip(*columns, strict=True):
        found.setdefault((solver, tolerance), []).append(Row(*one))
    return found


def standings(points: pd.DataFrame, times: Times, accuracy: float, limit: float) -> pd.DataFrame:
    """Return one row for each solver that reaches an accuracy on one problem, the fastest first.

    Columns: solver, tolerance (of its fastest point that reaches it), seconds (its median time), ratio (to the fastest
    solver), low and high (the ends of its interval), standing: "fastest" where all others are slower, "tie" where it,
    or the fastest, may be as fast, "slower", and "undecided" where rounds are too few.

    Args:
        points: of the problem, as in ``RunFrames``.
        times: the rounds of the problem.
        accuracy: judged residual.
        limit: of the time of one solve [s].
    """
    reached = reaching(points, accuracy, limit).sort_values("total_seconds", kind="stable")
    reached = reached[reached["total_seconds"].notna()].drop_duplicates("solver")
    places = list(zip(reached["solver"], reached["tolerance"], reached["total_seconds"], strict=True))
    timed = [times.get((solver, tolerance), []) for solver, tolerance, _ in places]
    ratios = [ratio(own, timed[0]) for own in timed[1:]]
    shown = [Ratio(1.0, 1.0, 1.0), *ratios] if places else []
    standing = [_standing_of_best(ratios), *map(_standing, ratios)] if places else []
    frame = pd.DataFrame(places, columns=["solver", "tolerance", "seconds"])
    return frame.assign(
        ratio=np.array([one.value for one in shown]),
        low=np.array([one.low for one in shown]),
        high=np.array([one.high for one in shown]),
        standing=pd.Series(standing, dtype=str),
    )


def _standing(one: Ratio) -> str:
    if one.low > 1.0:
        return "slower"
    return "tie" if np.isfinite(one.high) else "undecided"


def _standing_of_best(others: Sequence[Ratio]) -> str:
    found = set(map(_standing, others))
    return next((standing for standing in ("tie", "undecided") if standing in found), "fastest")


def _differences(rounds: Sequence[Timed], others: Sequence[Timed]) -> FloatArray:
    """Return the logarithms of the ratios of rounds that were measured at the same moments."""
    mine, theirs = _by_moment(rounds), _by_moment(others)
    return np.array([np.log(mine[key] / theirs[key]) for key in sorted(set(mine) & set(theirs))])


def _by_moment(rounds: Sequence[Timed]) -> dict[tuple[int, int], float]:
    return {(one.session, one.number): one.total_seconds for one in rounds if one.total_seconds > 0.0}


@cache
def _resamples(n: int) -> IntArray:
    """Return the rows of every resample, shape (RESAMPLES, n), the same ones always."""
    return np.random.default_rng(n).integers(0, n, size=(RESAMPLES, n))


@cache
def _tails(n: int) -> tuple[float, float]:
    """Return the two quantiles that the interval has for ends."""
    wide = stats.t.ppf(0.5 + CONFIDENCE / 2.0, n - 1) * np.sqrt(n / (n - 1))
    tail = float(stats.norm.cdf(-wide))
    return tail, 1.0 - tail
