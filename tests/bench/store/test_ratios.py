"""Ratios of times are paired by rounds, and their intervals have the stated coverage."""

import os
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from numpy.random import Generator, default_rng
from proxbench.bench.store import ratios
from proxbench.bench.store.ratios import (
    MARGIN,
    MIN_PAIRS,
    MIN_ROUNDS,
    Ratio,
    bootstrap_ratio,
    reaching,
    standings,
    times_by_point,
)

RUNS = 500
"""Number of simulated runs; they give the share of intervals that contain a ratio to 0.01."""

IS_FULL = os.environ.get("PROXBENCH_PROFILE") == "full"
"""Whether sizes between the smallest and the largest samples are tried too."""

Noise = Callable[[Generator, int], "np.typing.NDArray[np.float64]"]


def quiet(chance: Generator, n: int) -> "np.typing.NDArray[np.float64]":
    return chance.normal(0.0, 0.02, n)


def disturbed(chance: Generator, n: int) -> "np.typing.NDArray[np.float64]":
    """A tenth of the rounds takes up to several times as long."""
    return quiet(chance, n) + (chance.random(n) < 0.1) * chance.exponential(0.5, n)


def rounds(seconds: "np.typing.ArrayLike", session: int = 0, excluded: str = "", first: int = 0) -> pd.DataFrame:
    values = np.atleast_1d(seconds)
    numbers = first + np.arange(len(values))
    frame = pd.DataFrame({"session": session, "number": numbers, "turn": 0, "total_seconds": values})
    return frame.assign(excluded=excluded, solver="a", tolerance=1e-4)


def ratio(mine: pd.DataFrame, others: pd.DataFrame) -> Ratio:
    """Return the ratio of rounds of two solvers on one problem."""
    both = times_by_point(pd.concat([mine, others.assign(solver="b")]))
    none = both["b", 1e-4].iloc[:0]
    return ratios.ratio(both.get(("a", 1e-4), none), both["b", 1e-4])


@pytest.mark.slow
@pytest.mark.parametrize("noise", [pytest.param(quiet, marks=pytest.mark.weekly), disturbed])
@pytest.mark.parametrize(
    "pairs", [MIN_PAIRS, 6, 10, 20] if IS_FULL else [MIN_PAIRS, pytest.param(20, marks=pytest.mark.weekly)]
)
def test_intervals_hold_the_true_ratio_as_often_as_they_say(noise: Noise, pairs: int) -> None:
    chance = default_rng(pairs)
    found = [bootstrap_ratio(np.log(2.0) + noise(chance, pairs) - noise(chance, pairs)) for _ in range(RUNS)]
    assert 0.92 <= np.mean([one.low <= 2.0 <= one.high for one in found]) <= 0.995
    assert np.median([one.value for one in found]) == pytest.approx(2.0, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("passes", [MIN_PAIRS, pytest.param(7, marks=pytest.mark.weekly)])
def test_intervals_hold_the_true_ratio_where_processes_differ_more_than_their_rounds(passes: int) -> None:
    chance, n_runs, place = default_rng(passes), 2 * RUNS, np.arange(2 * passes)

    def of_processes(solver: str, median: float) -> pd.DataFrame:
        """Return the rounds of all simulated runs, with a separate tolerance for each run."""
        own = np.repeat(chance.normal(0.0, 0.05, (n_runs, passes)), 2, axis=1)
        times = median * np.exp(own + chance.normal(0.0, 0.02, own.shape))
        frame = rounds(times.ravel()).assign(number=np.tile(place // 2, n_runs), turn=np.tile(place % 2, n_runs))
        return frame.assign(solver=solver, tolerance=np.repeat(np.arange(n_runs), 2 * passes))

    both = times_by_point(pd.concat([of_processes("a", 2.0), of_processes("b", 1.0)]))
    found = [ratios.ratio(both["a", run], both["b", run]) for run in range(n_runs)]
    assert 0.92 <= np.mean([one.low <= 2.0 <= one.high for one in found]) <= 0.995


def test_disturbances_of_both_rounds_of_a_pair_cancel() -> None:
    drift = np.array([1.0, 3.0, 0.2, 7.0, 1.5])
    found = ratio(rounds(2.6 * drift), rounds(drift))
    assert found == pytest.approx((2.6, 2.6, 2.6))
    assert found.low > 1.0


def test_single_disturbed_round_hardly_changes_a_ratio() -> None:
    times = np.full(9, 2.6)
    times[3] *= 1.9
    assert ratio(rounds(times), rounds(np.ones(9))).value == pytest.approx(2.6)


def test_swapping_the_solvers_inverts_their_ratio_and_its_interval() -> None:
    chance = default_rng(3)
    mine, others = rounds(np.exp(quiet(chance, 8))), rounds(np.exp(quiet(chance, 8)))
    there, back = ratio(mine, others), ratio(others, mine)
    assert (1.0 / back.value, 1.0 / back.high, 1.0 / back.low) == pytest.approx(there, rel=1e-3)
    assert (there.low > 1.0 or there.high < 1.0) is (back.low > 1.0 or back.high < 1.0)


def test_rounds_of_different_sessions_or_numbers_are_not_paired() -> None:
    times = np.linspace(1.0, 2.0, MIN_PAIRS)
    for others in (rounds(times, session=1), rounds(times, first=MIN_PAIRS)):
        found = ratio(rounds(times), others)
        assert found.value == pytest.approx(1.0)
        assert found.low < 0.7
        assert found.high > 1.4


@pytest.mark.slow
@pytest.mark.parametrize("noise", [pytest.param(quiet, marks=pytest.mark.weekly), disturbed])
@pytest.mark.parametrize(
    ("mine", "others"),
    [(3, 3), (3, 6), (5, 4), (10, 10)] if IS_FULL else [(3, 6), pytest.param(10, 10, marks=pytest.mark.weekly)],
)
def test_intervals_without_pairs_hold_the_true_ratio_too(noise: Noise, mine: int, others: int) -> None:
    chance = default_rng((mine, others))
    found = [bootstrap_ratio(np.log(2.0) + noise(chance, mine), noise(chance, others)) for _ in range(RUNS)]
    assert 0.89 <= np.mean([one.low <= 2.0 <= one.high for one in found]) <= 0.995


def test_too_few_rounds_without_pairs_have_no_interval() -> None:
    found = ratio(rounds(np.ones(MIN_ROUNDS - 1)), rounds(np.ones(9), session=1))
    assert (found.low, found.high) == (0.0, np.inf)


def test_excluded_rounds_never_count() -> None:
    n = MIN_PAIRS
    good, excluded = rounds(np.ones(n)), rounds(np.full(n, 9.0), excluded="preempted", first=n)
    both = rounds(np.ones(2 * n))
    assert ratio(pd.concat([good, excluded]), both).value == pytest.approx(1.0)
    assert np.isnan(ratio(excluded, both).value)


def test_few_pairs_have_no_interval_and_decide_nothing() -> None:
    found = bootstrap_ratio(np.log(np.full(MIN_PAIRS - 1, 3.0)))
    assert found.value == pytest.approx(3.0)
    assert (found.low, found.high) == (0.0, np.inf)


def points(*rows: tuple[str, float, float, float, str]) -> pd.DataFrame:
    columns = ["solver", "tolerance", "residual", "total_seconds", "outcome"]
    frame = pd.DataFrame(rows, columns=columns)
    return frame.assign(is_excluded=False, status="solved")


def rounds_frame(**times: list[float]) -> pd.DataFrame:
    return pd.concat([rounds(seconds).assign(solver=solver) for solver, seconds in times.items()])


def test_the_fastest_point_of_a_solver_is_one_that_the_judge_confirms_in_time() -> None:
    found = reaching(
        points(
            ("a", 1e-2, 1e-5, 3.0, "solved"),
            ("a", 1e-4, 1e-6, 2.0, "solved"),
            ("b", 1e-4, 1e-3, 1.0, "solved"),
            ("c", 1e-4, 1e-6, 1.0, "wrong"),
            ("d", 1e-4, 1e-6, 11.5, "solved"),
            ("e", 1e-4, 1e-6, 10.5, "time limit"),
        ),
        1e-4,
        10.0,
    )
    assert list(found["solver"]) == ["a", "a"]


STEADY = [1.0, 1.1, 0.9, 1.05, 0.95]


@pytest.mark.parametrize(
    ("other", "first", "second"),
    [
        ([2.0, 2.3, 1.9, 2.0, 2.1], "fastest", "slower"),
        ([1.3, 1.0, 1.2, 1.0, 1.25], "tie", "tie"),
        ([2.0, 2.0], "undecided", "undecided"),
    ],
)
def test_solver_is_fastest_only_if_all_others_are_slower(other: list[float], first: str, second: str) -> None:
    both = points(("a", 1e-4, 1e-5, 1.0, "solved"), ("b", 1e-4, 1e-5, float(np.median(other)), "solved"))
    found = standings(both, times_by_point(rounds_frame(a=STEADY, b=other)), 1e-4, 10.0)
    assert list(found["solver"]) == ["a", "b"]
    assert list(found["standing"]) == [first, second]
    assert found["low"][1] <= found["ratio"][1] <= found["high"][1]


def test_a_solver_that_is_slower_by_less_than_the_margin_leaves_no_winner() -> None:
    slower = [(1.0 + 0.9 * MARGIN) * value for value in STEADY]
    both = points(("a", 1e-4, 1e-5, 1.0, "solved"), ("b", 1e-4, 1e-5, float(np.median(slower)), "solved"))
    found = standings(both, times_by_point(rounds_frame(a=STEADY, b=slower)), 1e-4, 10.0)
    assert found["low"][1] > 1.0
    assert list(found["standing"]) == ["tie", "tie"]


@pytest.mark.parametrize("seconds", [5.0, 0.5])
def test_an_excluded_time_takes_part_in_no_ratio_and_beside_it_there_is_no_winner(seconds: float) -> None:
    rows = [("a", 1e-4, 1e-5, 1.0, "solved"), ("b", 1e-4, 1e-5, 2.0, "solved"), ("c", 1e-4, 1e-5, seconds, "solved")]
    both = points(*rows).assign(is_excluded=[False, False, True])
    times = times_by_point(rounds_frame(a=STEADY, b=[2.0 * one for one in STEADY], c=[seconds] * 5))
    found = standings(both, times, 1e-4, 10.0)
    assert list(found["solver"]) == ["a", "b", "c"]
    assert list(found["standing"]) == ["undecided", "slower", "excluded"]
    assert np.isnan(found["ratio"][2])


def test_no_standings_if_no_accuracy_is_reached() -> None:
    assert standings(points(("a", 1e-4, 1e-2, 1.0, "solved")), times_by_point(rounds_frame(a=STEADY)), 1e-4, 10.0).empty


def test_without_pairs_the_smaller_sample_decides_how_wide_an_interval_is() -> None:
    """Rounds that do not scatter do not widen the interval, however many they are."""
    mine = rounds(np.exp(disturbed(default_rng(1), 20)))
    few, many = (ratio(mine, rounds(np.ones(n), session=1)) for n in (20, 400))
    assert many == pytest.approx(few, rel=1e-12)
    assert few.low < few.value < few.high
    fewer = ratio(mine, rounds(np.ones(5), session=1))
    assert fewer.low < few.low
    assert fewer.high > few.high


def test_the_interval_of_six_pairs_is_the_range_of_all() -> None:
    """Few pairs widen the interval: the plain percentile interval of their median would leave out both ends."""
    found = ratio(rounds(2.0 ** np.arange(6.0)), rounds(np.ones(6)))
    assert (found.low, found.high) == pytest.approx((1.0, 32.0))
