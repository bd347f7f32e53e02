"""How certain a ratio of two times is: from rounds in pairs, with an interval from the bootstrap.

Rounds a and b of two solvers on one problem in the same pass meet the same machine, so their times t are compared in
pairs, d = log(t_a / t_b). A pass makes one pair of the means of its rounds, because these share their processes, whose
times differ by some per cent from process to process; where passes are too few, each round counts by itself, and
intervals are a little too narrow. The ratio is exp(median d); medians, since other programs disturb few rounds, but
each by a large factor. Its interval is the percentile interval of the bootstrap of that median, widened for few pairs:
with n pairs its ends are the quantiles

    Φ(±t(0.975, n - 1) √(n / (n - 1)))

of the medians of resampled pairs, with the normal distribution Φ and the quantile t of Student's (T. Hesterberg, What
Teachers Should Know About the Bootstrap, The American Statistician 69(4), 2015). With five pairs the interval is about
the range of all; with fewer there is none, since it would hold the true ratio too rarely.

Excluded rounds never count. Where they leave too few pairs, what is left of both is compared as two samples,
median log t_a - median log t_b, each resampled on its own, with n the size of the smaller one. Three rounds of both are
enough: they are all slower than three others by chance in 1 of 20 cases. With fewer there is no ratio.

A solver is slower than the fastest one if its interval lies above 1 + MARGIN: processes that do the same differ by some
per cent, so that a smaller difference between two runs is not repeated in the next two.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.solver import Status
from .outcome import Outcome

CONFIDENCE = 0.95
"""Share of intervals that shall hold the true ratio."""

LEAST_PAIRS = 5
"""Pairs of rounds that an interval needs."""

LEAST_ROUNDS = 3
"""Rounds of both that an interval needs without pairs."""

MARGIN = 0.05
"""Part by which the fastest solver is faster than all others at least."""

RESAMPLES = 1000
"""Resampled medians."""

LATE = 1.1
"""Solves that took longer than this many times their limit reach nothing; the others may end an iteration."""


SLOWER, EXCLUDED = "slower", "excluded"
"""Standings of a solver that is certainly slower than the fastest one, and of one whose rounds are all excluded."""

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
    turn: int
    total_seconds: float
    excluded: str = ""


Times = dict[tuple[str, float], list[Row]]
"""Rounds of one problem by solver and tolerance."""


def ratio(rounds: Sequence[Row], others: Sequence[Row]) -> Ratio:
    """Return the time of ``rounds`` over that of ``others``, both of one problem; NaN where they are too few."""
    mine, theirs = ([one for one in side if not one.excluded and one.total_seconds > 0.0] for side in (rounds, others))
    for moment in (_pass_of, _turn_of):
        differences = _differences(mine, theirs, moment)
        if len(differences) >= LEAST_PAIRS:
            return interval(differences)
    if min(len(mine), len(theirs)) >= LEAST_ROUNDS:
        return interval_of_two(_logarithms(mine), _logarithms(theirs))
    return interval(_differences(mine, theirs, _turn_of))


def interval(differences: FloatArray) -> Ratio:
    """Return the ratio and its interval from the logarithms of paired ratios, shape (n,)."""
    n = len(differences)
    if n == 0:
        return Ratio(np.nan, 0.0, np.inf)
    value = float(np.exp(np.median(differences)))
    if n < LEAST_PAIRS:
        return Ratio(value, 0.0, np.inf)
    return _with_ends(value, _resampled_medians(differences, 0), n)


def interval_of_two(mine: FloatArray, theirs: FloatArray) -> Ratio:
    """Return the ratio and its interval from the logarithms of times without pairs, shapes (n,) and (m,)."""
    value = float(np.exp(np.median(mine) - np.median(theirs)))
    medians = _resampled_medians(mine, 0) - _resampled_medians(theirs, 1)
    return _with_ends(value, medians, min(len(mine), len(theirs)))


def _with_ends(value: float, medians: FloatArray, n: int) -> Ratio:
    low, high = np.exp(np.quantile(medians, _tails(n)))
    return Ratio(value, float(low), float(high))


def _resampled_medians(values: FloatArray, seed: int) -> FloatArray:
    medians: FloatArray = np.median(values[_resamples(len(values), seed)], axis=1)
    return medians


def reaching(points: pd.DataFrame, accuracy: float, limit: float = np.inf) -> pd.DataFrame:
    """Return the points whose residual is at most ``accuracy``, of solves that kept their limit of time [s].

    Points that claim what the judge refutes (WRONG), or to have solved after the limit, do not count, nor do those that
    took more than ``LATE`` times the limit whatever they claim.
    """
    is_late = (points["outcome"] == Outcome.TIME_LIMIT) & (points["status"] == Status.SOLVED)
    is_late |= points["total_seconds"] > LATE * limit
    found: pd.DataFrame = points[(points["residual"] <= accuracy) & (points["outcome"] != Outcome.WRONG) & ~is_late]
    return found


def times_by_point(rounds: pd.DataFrame) -> Times:
    """Return the rounds of one problem, as in ``RunFrames``, by solver and tolerance."""
    found: Times = {}
    columns = (
        rounds[name] for name in ("solver", "tolerance", "session", "number", "turn", "total_seconds", "excluded")
    )
    for solver, tolerance, *one in zip(*columns, strict=True):
        found.setdefault((solver, tolerance), []).append(Row(*one))
    return found


def standings(points: pd.DataFrame, times: Times, accuracy: float, limit: float) -> pd.DataFrame:
    """Return one row for each solver that reaches an accuracy on one problem, the fastest first, excluded ones last.

    Columns: solver, tolerance (of its fastest point that reaches it), seconds (its median time), ratio (to the fastest
    solver), low and high (the ends of its interval), standing: "fastest" where all others are slower by ``MARGIN``,
    "tie" where it, or the fastest, may be as fast, "slower", "undecided" where rounds are too few, and "excluded".
    An excluded solver has no ratio. Its true time may be any fraction of the excluded one, so no solver is "fastest" on
    a problem with an excluded solver.

    Args:
        points: of the problem, as in ``RunFrames``.
        times: the rounds of the problem.
        accuracy: judged residual.
        limit: of the time of one solve [s].
    """
    reached = reaching(points, accuracy, limit).sort_values("total_seconds", kind="stable")
    reached = reached[reached["total_seconds"].notna()].drop_duplicates("solver")
    is_excluded = reached["is_excluded"].astype(bool)
    places = reached[~is_excluded][["solver", "tolerance", "total_seconds"]].itertuples(index=False, name=None)
    compared = [(place, times.get(place[:2], [])) for place in places]
    excluded = reached[is_excluded][["solver", "tolerance", "total_seconds"]].itertuples(index=False, name=None)
    left_out = list(excluded)
    ratios = [ratio(own, compared[0][1]) for _, own in compared[1:]]
    standing = [_standing_of_best(ratios), *map(_standing, ratios)] if compared else []
    if standing and left_out:
        standing[0] = "undecided"
    shown = ([Ratio(1.0, 1.0, 1.0), *ratios] if compared else []) + [Ratio(np.nan, 0.0, np.inf)] * len(left_out)
    rows = [*(place for place, _ in compared), *left_out]
    frame = pd.DataFrame(rows, columns=["solver", "tolerance", "seconds"])
    return frame.assign(
        ratio=np.array([one.value for one in shown]),
        low=np.array([one.low for one in shown]),
        high=np.array([one.high for one in shown]),
        standing=pd.Series([*standing, *[EXCLUDED] * len(left_out)], dtype=str),
    )


def _standing(one: Ratio) -> str:
    if one.low > 1.0 + MARGIN:
        return SLOWER
    return "tie" if np.isfinite(one.high) else "undecided"


def _standing_of_best(others: Sequence[Ratio]) -> str:
    found = set(map(_standing, others))
    return next((standing for standing in ("tie", "undecided") if standing in found), "fastest")


def _differences(rounds: Sequence[Row], others: Sequence[Row], moment: Callable[[Row], tuple[int, ...]]) -> FloatArray:
    """Return the logarithms of the ratios of rounds of the same moments, of means where a moment has several."""
    mine, theirs = _by_moment(rounds, moment), _by_moment(others, moment)
    return np.array([np.mean(mine[key]) - np.mean(theirs[key]) for key in sorted(set(mine) & set(theirs))])


def _by_moment(rounds: Sequence[Row], moment: Callable[[Row], tuple[int, ...]]) -> dict[tuple[int, ...], list[float]]:
    """Return the logarithms of the times of rounds by moment."""
    found: dict[tuple[int, ...], list[float]] = {}
    for one in rounds:
        if one.total_seconds > 0.0:
            found.setdefault(moment(one), []).append(float(np.log(one.total_seconds)))
    return found


def _pass_of(one: Row) -> tuple[int, ...]:
    return one.session, one.number


def _turn_of(one: Row) -> tuple[int, ...]:
    return one.session, one.number, one.turn


def _logarithms(rounds: Sequence[Row]) -> FloatArray:
    return np.log([one.total_seconds for one in rounds])


@cache
def _resamples(n: int, seed: int) -> IntArray:
    """Return the rows of every resample, shape (RESAMPLES, n), the same ones always."""
    return np.random.default_rng((n, seed)).integers(0, n, size=(RESAMPLES, n))


@cache
def _tails(n: int) -> tuple[float, float]:
    """Return the two quantiles that the interval has for ends."""
    wide = special.stdtrit(n - 1, 0.5 + CONFIDENCE / 2.0) * np.sqrt(n / (n - 1))
    tail = float(special.ndtr(-wide))
    return tail, 1.0 - tail
