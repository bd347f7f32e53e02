"""Profiles are what their definitions say, over the problems and solvers of a table, whoever failed on what."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from proxbench.bench import load
from proxbench.bench.errors import BenchError
from proxbench.bench.report.accuracy import times_to_accuracies
from proxbench.bench.report.charts.profiles import write_profiles
from proxbench.bench.report.profiles import (
    ALL,
    BUDGETS,
    accuracy_profile,
    baseline_of,
    budget_table,
    data_profile,
    performance_profile,
    profile_tables,
    residual_matrix,
    seconds_matrix,
    speedups,
)

REFERENCE = Path(__file__).parents[3] / "results/reference"


def random_seconds(seed: int, problems: int = 17, solvers: int = 5) -> pd.DataFrame:
    """Times of solvers on problems, a third of them failures, with ties and a problem that no solver solves."""
    draw = np.random.default_rng(seed)
    seconds = np.round(10.0 ** draw.uniform(-4, 1, (problems, solvers)), 4)
    seconds[draw.random(seconds.shape) < 1 / 3] = np.nan
    seconds[0] = np.nan
    return pd.DataFrame(seconds, [f"p{k}" for k in range(problems)], [f"s{k}" for k in range(solvers)])


def on_stairs(corners: pd.DataFrame, column: str, solver: str, at: float) -> float:
    """The height of a solver's staircase at a place."""
    own = corners[corners["solver"] == solver]
    return float(own["share"][own[column] <= at].iloc[-1])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("dropped", [[], ["s0"], ["s1", "s3"]])
def test_profiles_equal_their_definition_over_the_solvers_shown(seed: int, dropped: list[str]) -> None:
    seconds = random_seconds(seed).drop(columns=dropped)
    performance, data, budgets = performance_profile(seconds), data_profile(seconds), budget_table(seconds)
    times = seconds.to_dict()
    for solver, own in times.items():
        for ratio in np.append(performance["ratio"].unique(), [1.7, 1e9]):
            count = 0
            for problem, time in own.items():
                solved = [other[problem] for other in times.values() if other[problem] == other[problem]]
                count += bool(solved) and time / min(solved) <= ratio
            assert on_stairs(performance, "ratio", solver, ratio) == count / len(own)
        for limit in np.append(data["seconds"].unique(), BUDGETS[-1] * 20):
            assert on_stairs(data, "seconds", solver, limit) == sum(time <= limit for time in own.values()) / len(own)
        for row in budgets[budgets["solver"] == solver].to_dict("records"):
            assert row["solved"] == sum(time <= row["budget"] for time in own.values())
            assert row["share"] == row["solved"] / row["problems"] == row["solved"] / len(own)


@pytest.mark.parametrize("seed", range(20))
def test_speedups_are_over_the_problems_that_both_solve(seed: int) -> None:
    seconds = random_seconds(seed)
    times = seconds.to_dict()
    expected = {
        (solver, problem): times["s2"][problem] / time
        for solver, own in times.items()
        for problem, time in own.items()
        if solver != "s2" and time == time and times["s2"][problem] == times["s2"][problem]
    }
    found = speedups(seconds, "s2")
    assert {(row.solver, row.problem): row.speedup for row in found.itertuples()} == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(20))
def test_an_accuracy_profile_counts_residuals_of_at_most_each_accuracy(seed: int) -> None:
    residuals = random_seconds(seed) ** 3
    for row in accuracy_profile(residuals).to_dict("records"):
        own = residuals[row["solver"]].tolist()
        assert row["share"] == sum(value <= row["residual"] for value in own) / len(own)


def test_solvers_that_solve_nothing_give_profiles_of_zero() -> None:
    seconds = random_seconds(0) * np.nan
    for profile in (performance_profile(seconds), data_profile(seconds), budget_table(seconds)):
        assert set(profile["solver"]) == set(seconds.columns)
        assert (profile["share"] == 0.0).all()
        assert np.isfinite(profile.select_dtypes("number")).all(axis=None)
    assert speedups(seconds, "s0").empty


@pytest.mark.slow
def test_times_and_residuals_are_those_of_points_that_count() -> None:
    run = load(REFERENCE)
    seconds, residuals = seconds_matrix(run, 1e-6), residual_matrix(run)
    assert seconds.shape == residuals.shape == (8, 15)
    times = times_to_accuracies(run.points, [1e-6], run.info.plan.limits.solve_seconds)[1e-6]
    for problem, solver in run.points.groupby(["problem", "solver"]).groups:
        expected = times.get((problem, solver), np.nan)
        assert seconds.at[problem, solver] == pytest.approx(expected, nan_ok=True)
        assert (residuals.at[problem, solver] <= 1e-6) == np.isfinite(expected)


@pytest.mark.slow
def test_families_are_profiled_as_the_problems_of_each_alone() -> None:
    run = load(REFERENCE)
    tables = profile_tables(run, "NSGS")
    funnel = run.only([name for name in run.info.plan.problems if name.startswith("funnel")])
    for name, table in profile_tables(funnel, "NSGS").items():
        alone = table[table["family"] == ALL].drop(columns="family").reset_index(drop=True)
        of_family = tables[name][tables[name]["family"] == "funnel"].drop(columns="family").reset_index(drop=True)
        pd.testing.assert_frame_equal(of_family, alone)


@pytest.mark.slow
def test_every_chart_has_its_numbers_beside_it(tmp_path: Path) -> None:
    run = load(REFERENCE)
    files = {file.name for file in write_profiles(run, "NSGS", tmp_path)}
    for name in ("performance", "data", "accuracy", "speedup"):
        assert {f"profile-{name}{ending}" for ending in (".svg", ".png", ".csv")} <= files
    assert {"profile-families.svg", "profile-budgets.csv"} <= files
    stored = pd.read_csv(tmp_path / "profile-performance.csv")
    pd.testing.assert_frame_equal(stored, profile_tables(run, "NSGS")["performance"])


@pytest.mark.slow
def test_a_baseline_that_is_not_named_solves_most() -> None:
    run = load(REFERENCE)
    solved = seconds_matrix(run, 1e-8).notna().sum()
    assert solved[baseline_of(run)] == solved.max()
    assert baseline_of(run, "Lemke") == "Lemke"


def test_a_run_without_cases_has_no_profiles(finished_run: Path, tmp_path: Path) -> None:
    (tmp_path / "run.json").write_bytes((finished_run / "run.json").read_bytes())
    with pytest.raises(BenchError, match="no finished case"):
        baseline_of(load(tmp_path))
