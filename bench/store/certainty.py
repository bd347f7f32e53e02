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

from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import stats

from ...problems.arrays import FloatArray, IntArray
from ...solvers.interface import Status
from .outcome import Outcome
from .records import CaseRecord, Point, Round

CONFIDENCE = 0.95
"""Share of intervals that shall hold the true ratio."""

LEAST_PAIRS = 5
"""Pairs of rounds that an interval needs."""

RESAMPLES = 1000
"""Resampled medians."""

LATE = 1.1
"""Solves that took longer than this many times their limit reach nothing; the others may end an iteration."""


class Ratio(NamedTuple):
    """A ratio of times, and the ends of its interval; infinitely wide where rounds are too few."""

    value: float
    low: float
    high: float

    @property
    def is_tie(self) -> bool:
        """Whether either of both may be the faster one."""
        return self.low <= 1.0 <= self.high

    @property
    def width(self) -> float:
        """Width of the interval, relative to its lower end."""
        return self.high / self.low - 1.0 if self.low > 0.0 else np.inf


def ratio(rounds: Sequence[Round], others: Sequence[Round]) -> Ratio:
    """Return the time of ``rounds`` over that of ``others``, both of one problem.

    Marred rounds count only where a point has no others.
    """
    mine, theirs = (_by_moment(_usable(side)) for side in (rounds, others))
    both = sorted(set(mine) & set(theirs))
    return interval(np.log([mine[key] / theirs[key] for key in both]) if both else np.zeros(0))


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


def fastest(cases: Sequence[CaseRecord], accuracy: float, limit: float) -> Mapping[str, Point]:
    """Return, of the cases of one problem, each solver's fastest point whose judged residual is at most ``accuracy``.

    Args:
        cases: of one problem.
        accuracy: judged residual.
        limit: of the time of one solve [s].
    """
    found = {}
    for case in cases:
        reached = [point for point in case.points if _reaches(point, accuracy, limit)]
        if reached:
            found[case.solver] = min(reached, key=_seconds)
    return found


def _reaches(point: Point, accuracy: float, limit: float) -> bool:
    measured = point.measured
    if measured is None or measured.residual is None or point.outcome is Outcome.WRONG:
        return False
    is_late = point.outcome is Outcome.TIME_LIMIT and point.status == Status.SOLVED
    return not is_late and measured.residual <= accuracy and measured.solve_seconds.median <= LATE * limit


def _seconds(point: Point) -> float:
    return np.inf if point.measured is None else point.measured.total_seconds.median


def _usable(rounds: Sequence[Round]) -> Sequence[Round]:
    return [one for one in rounds if not one.is_marred] or rounds


def _by_moment(rounds: Sequence[Round]) -> dict[tuple[int, int], float]:
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
