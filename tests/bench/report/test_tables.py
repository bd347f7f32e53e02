"""Tables show all measured results, and nothing else."""

from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace as changed
from proxbench.bench import load
from proxbench.bench.report.accuracy import attempts, problems_table, summary_table, times_to_accuracies
from proxbench.bench.report.cells import duration, shown_results
from proxbench.bench.report.tables import (
    print_tables,
    results_table,
    write_tables,
)
from proxbench.bench.store.frames import RunFrames
from proxbench.bench.store.outcome import Outcome
from rich.console import Console
from simulated_runs import solved_point, store_run
from stored_cases import case_record, timed_round


def points(*rows: tuple[float, float, str], status: str = "") -> pd.DataFrame:
    frame = pd.DataFrame(rows, columns=["residual", "total_seconds", "outcome"])
    frame = frame.assign(status=status or frame["outcome"], solve_seconds=frame["total_seconds"])
    return frame.assign(problem="p", solver="s")


def time_to_accuracy(frame: pd.DataFrame, accuracy: float, limit: float = np.inf) -> float:
    return float(times_to_accuracies(frame, [accuracy], limit)[accuracy].get(("p", "s"), np.nan))


def test_time_to_accuracy_is_the_least_time_among_points_that_are_accurate_enough() -> None:
    frame = points((1e-3, 1.0, "solved"), (1e-5, 3.0, "solved"), (1e-6, 2.0, "time limit"))
    assert time_to_accuracy(frame, 1e-2) == 1.0
    assert time_to_accuracy(frame, 1e-4) == 2.0
    assert np.isnan(time_to_accuracy(frame, 1e-8))


def test_wrong_claims_are_never_ranked() -> None:
    assert np.isnan(time_to_accuracy(points((1e-9, 0.1, "wrong"), status="solved"), 1e-2))


def test_solves_after_the_time_limit_are_not_ranked() -> None:
    assert np.isnan(time_to_accuracy(points((1e-9, 50.0, "stalled")), 1e-2, limit=0.5))
    assert np.isnan(time_to_accuracy(points((1e-9, 1.0, "time limit"), status="solved"), 1e-2))


@pytest.mark.slow
def test_residuals_and_iterations_of_a_row_are_those_of_one_solve(reference_run: RunFrames) -> None:
    """A pyramid is solved more accurately by later solves, whose distance from Coulomb's law hardly changes."""
    frames = reference_run
    columns = ["problem", "solver", "residual", "model_residual", "iterations"]
    rows, points = results_table(frames)[columns].dropna(), frames.points[columns].dropna()
    assert len(rows) == len(rows.merge(points.drop_duplicates(), on=columns)) > 100
    relaxed = rows[rows["solver"] == "PyramidPGS(sides=16)"]
    assert (relaxed.merge(points, on=["problem", "solver"]).eval("model_residual_x <= model_residual_y")).all()


def test_every_case_is_a_row_with_its_ending_in_words(finished: RunFrames) -> None:
    table = results_table(finished).set_index(["problem", "solver"])
    assert len(table) == 15
    relaxed = table.loc[("funnel-30", "ClarabelSOCP")]
    assert relaxed["outcome"] == Outcome.RELAXED, relaxed["reason"]
    assert relaxed["model_residual"] <= 1e-6 < relaxed["residual"]
    assert "convex" in str(table.loc[("funnel-30", "ClarabelSOCP"), "reason"])
    assert table.loc[("funnel-30", "Misbehaving(lie)"), "outcome"] == Outcome.WRONG
    assert table.loc[("funnel-30", "Misbehaving(raise)"), "outcome"] == Outcome.CRASHED
    assert "the plugin gave up" in str(table.loc[("funnel-30", "Misbehaving(raise)"), "reason"])
    assert table.loc[("hard-counterexample", "SORprox"), "outcome"] == Outcome.OSCILLATING


@pytest.mark.slow
def test_unmeasured_cases_of_an_interrupted_run_are_not_failures(finished: RunFrames) -> None:
    """Cases without the last point of their ladder, or without any, count neither as attempts nor as failures."""
    whole = finished
    of_case = {
        name: (whole.points["problem"] == "funnel-30") & (whole.points["solver"] == name)
        for name in ("SORprox", "SORprox(relaxation=0.5)")
    }
    finest = whole.points["tolerance"] == min(whole.info.plan.tolerances)
    left = (of_case["SORprox"] & finest) | of_case["SORprox(relaxation=0.5)"]
    is_left = (whole.cases["problem"] == "funnel-30") & whole.cases["solver"].isin(of_case)
    cases = whole.cases.assign(is_tried=~is_left, is_finished=~is_left)
    run = replace(whole, points=whole.points[~left], cases=cases)
    table = results_table(run).set_index(["problem", "solver"])
    for solver, reason in (("SORprox", "not measured below 1e-04"), ("SORprox(relaxation=0.5)", "not measured yet")):
        assert tuple(table.loc[("funnel-30", solver), ["outcome", "reason"]]) == ("unfinished", reason)
        before, after = (summary_table(one).set_index("solver").loc[solver] for one in (whole, run))
        assert after["problems"] == before["problems"] - 1
        assert not (
            (attempts(run, [1e-2])["solver"] == solver) & (attempts(run, [1e-2])["problem"] == "funnel-30")
        ).any()
    before, after = (problems_table(one).set_index("problem").loc["funnel-30", "solvers"] for one in (whole, run))
    assert after == before - 2


def test_residuals_by_the_model_are_shown_only_beside_other_models_than_coulomb_s(finished: RunFrames) -> None:
    table = results_table(finished)
    shown = shown_results(table, {}).set_index(["problem", "solver"])
    assert float(shown.loc[("funnel-30", "ClarabelSOCP"), "by model"]) <= 1e-6
    assert "by model" not in shown_results(table[table["model"] == "coulomb"], {})


def test_the_convex_model_reaches_no_accuracy_where_contacts_slide(finished: RunFrames) -> None:
    table = results_table(finished).set_index(["problem", "solver"])
    assert np.isnan(float(table.loc[("funnel-30", "ClarabelSOCP"), "time_to_1e-02"]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tolerances", "columns", "summed"),
    [
        ([1e-1], ["1e-01"], ["1e-01"]),
        ([2.5e-4, 1e-2], ["1e-02", "2.5e-04"], ["1e-02", "2.5e-04"]),
        ([1e-2, 1e-4, 1e-6], ["1e-02", "1e-04", "1e-06"], ["1e-04", "1e-06"]),
        ([10.0**-k for k in range(1, 11)], ["1e-02", "1e-04", "1e-06", "1e-08"], ["1e-04", "1e-06"]),
        ([10.0**-k for k in range(1, 7)], ["1e-02", "1e-04", "1e-06"], ["1e-04", "1e-06"]),
        ([0.9, 0.8, 0.7, 0.6, 0.5], ["5e-01"], ["5e-01"]),
    ],
)
def test_columns_are_those_of_the_plan(
    finished: RunFrames, tolerances: list[float], columns: list[str], summed: list[str]
) -> None:
    frames = finished
    chosen = replace(frames, info=changed(frames.info, plan=changed(frames.info.plan, tolerances=tolerances)))
    results, summary = results_table(chosen), summary_table(chosen)
    assert [key for key in results if key.startswith("time_to_")] == [f"time_to_{tag}" for tag in columns]
    assert [key for key in summary if key.startswith("correct_")] == [f"correct_{tag}" for tag in summed]
    shown = StringIO()
    print_tables(chosen, Console(file=shown, width=120))
    assert all(tag in shown.getvalue() for tag in columns)


def test_summary_shows_claimed_and_confirmed_solves(finished: RunFrames) -> None:
    frames = finished
    summary, lies = summary_table(frames).set_index("solver"), frames.points["solver"] == "Misbehaving(lie)"
    assert summary.loc["Misbehaving(lie)", "success_1e-04"] == 1.0
    assert summary.loc["Misbehaving(lie)", "correct_1e-04"] == 0.0
    wrong = int((frames.points["outcome"] == Outcome.WRONG)[lies].sum())
    assert summary.loc["Misbehaving(lie)", "wrong"] == wrong >= 8  # one of nine claims is wrong only on some copies
    assert summary.loc["SORprox(relaxation=0.5)", "correct_1e-06"] == pytest.approx(2 / 3)


def test_means_compare_only_what_all_solvers_support(finished: RunFrames) -> None:
    frames = finished
    means = [f"mean_time_{accuracy}" for accuracy in ("1e-04", "1e-06")]
    whole = summary_table(frames).set_index("solver")
    assert (whole["common"] == frames.cases["problem"].nunique()).all()
    lacking = frames.cases.copy()
    lacking.loc[(lacking["problem"] == "funnel-30") & (lacking["solver"] == "SORprox"), "outcome"] = "unsupported"
    fewer = summary_table(replace(frames, cases=lacking)).set_index("solver")
    without = frames.cases[frames.cases["problem"] != "funnel-30"]
    none = summary_table(replace(frames, cases=without)).set_index("solver")
    assert (fewer["common"] == 2).all()
    pd.testing.assert_frame_equal(fewer[means], none[means])  # a problem that one solver lacks is omitted for all
    all_own = [f"own_{mean}" for mean in means]
    # own means include all problems of a solver
    pd.testing.assert_frame_equal(fewer[all_own].drop("SORprox"), whole[all_own].drop("SORprox"))
    assert fewer.loc["SORprox", all_own].tolist() == fewer.loc["SORprox", means].tolist()
    own = whole.index != "SORprox"
    assert fewer[own]["correct_1e-04"].equals(whole[own]["correct_1e-04"])  # the success of other solvers is unchanged
    assert (fewer[own]["problems"] == 3).all()


@pytest.mark.parametrize("lacks", [pytest.param(False, marks=pytest.mark.slow), True])
def test_the_own_mean_is_shown_if_it_differs_from_the_mean(finished: RunFrames, lacks: bool) -> None:
    frames = finished
    cases = frames.cases.copy()
    if lacks:
        cases.loc[(cases["problem"] == "funnel-30") & (cases["solver"] == "SORprox"), "outcome"] = "unsupported"
    text = StringIO()
    print_tables(replace(frames, cases=cases), Console(file=text, width=80))
    summary = text.getvalue().partition("all 3 problems")[2]
    assert max(map(len, summary.splitlines())) <= 80
    assert ("own mean" in summary, "mean of 2: " in summary.replace("\n", " ")) == (lacks, lacks)
    assert summary.count(" wrong") == 2  # a table for each accuracy
    (row,) = [line for line in summary.splitlines() if line.startswith("SORprox ")][:1]
    assert row.count("2/2" if lacks else "3/3") <= 2
    assert ("own mean 1e-04" in replace(frames, cases=cases)._repr_html_()) == lacks
    seconds = summary_table(replace(frames, cases=cases)).set_index("solver").loc["ClarabelSOCP"]
    kinds = ("mean_time", "own_mean_time") if lacks else ("mean_time",)
    line = next(line for line in summary.splitlines() if line.startswith("ClarabelSOCP"))
    for kind in kinds:
        assert duration(seconds[f"{kind}_1e-04"]) in line


@pytest.mark.weekly
def test_tables_by_the_local_residual_hold_those_reached_by_it(finished_run: Path, tmp_path: Path) -> None:
    judged, local = load(finished_run), load(finished_run).judged_by("local")
    key = ["problem", "solver"]
    times = results_table(local).set_index(key)["time_to_1e-04"]
    points = judged.points[judged.points["total_seconds"].notna() & (judged.points["outcome"] != Outcome.WRONG)]
    best = points.groupby(key)["local_residual"].min().reindex(times.index)
    assert (times.notna() == (best <= 1e-4)).all()
    assert (best != points.groupby(key)["residual"].min().reindex(times.index)).any()
    assert results_table(local)["outcome"].equals(results_table(judged)["outcome"])
    text = StringIO()
    print_tables(local, Console(file=text, width=200))
    assert "residuals are local" in text.getvalue()
    assert "to that local residual" in text.getvalue()
    made = local.report()
    assert {file.parent for file in (*made.tables, *made.charts)} == {
        finished_run / "local" / "tables",
        finished_run / "local" / "charts",
    }
    pd.testing.assert_frame_equal(made.results, results_table(local))
    assert "residuals are local" in (finished_run / "local" / "tables" / "summary.md").read_text()
    assert not (finished_run / "local" / "tables" / "matrix.md").exists()  # it shows claims about judged residuals
    chart = (finished_run / "local" / "charts" / "funnel-30.svg").read_text()
    assert "local residual (velocity error" in chart


def test_without_a_common_problem_there_is_no_mean(finished: RunFrames) -> None:
    frames = finished
    kept = frames.cases["solver"].map({"SORprox": "funnel-30", "ClarabelSOCP": "hard-immovable"})
    apart = replace(frames, cases=frames.cases[frames.cases["problem"] == kept])
    summary = summary_table(apart)
    assert (summary["common"] == 0).all()
    assert summary["mean_time_1e-04"].isna().all()
    text = StringIO()
    print_tables(apart, Console(file=text, width=100))
    assert "means are not comparable" in text.getvalue()
    assert summary["own_mean_time_1e-04"].notna().all()


@pytest.mark.slow
def test_table_files_agree_in_all_formats(finished: RunFrames, tmp_path: Path) -> None:
    files = write_tables(finished, tmp_path)
    assert {file.suffix for file in files} == {".csv", ".parquet", ".md", ".tex"}
    from_csv, from_parquet = pd.read_csv(tmp_path / "results.csv"), pd.read_parquet(tmp_path / "results.parquet")
    assert from_parquet["time_to_1e-04"].dtype == np.float64
    assert from_csv["residual"].to_numpy() == pytest.approx(from_parquet["residual"].to_numpy(), nan_ok=True)


@pytest.mark.parametrize("kept", [Outcome.UNSUPPORTED, pytest.param("none", marks=pytest.mark.slow)])
def test_a_run_without_a_measured_case_still_has_tables(finished: RunFrames, tmp_path: Path, kept: str) -> None:
    frames = finished
    cases = frames.cases.iloc[:2].assign(outcome=kept) if kept == Outcome.UNSUPPORTED else frames.cases.iloc[:0]
    bare = replace(frames, cases=cases, points=frames.points.iloc[:0])
    write_tables(bare, tmp_path)
    assert set(pd.read_csv(tmp_path / "results.csv").columns) == set(results_table(frames).columns)
    assert len(pd.read_parquet(tmp_path / "summary.parquet")) == 0
    text = StringIO()
    print_tables(bare, Console(file=text, width=100))
    assert ("unsupported" if len(cases) else "no case") in text.getvalue()


@pytest.mark.parametrize("width", [80, pytest.param(120, marks=pytest.mark.slow)])
def test_the_printed_table_fits_its_width_and_spells_failures_out(finished: RunFrames, width: int) -> None:
    text = StringIO()
    print_tables(finished, Console(file=text, width=width))
    printed = text.getvalue()
    assert max(map(len, printed.splitlines())) <= width
    for words in ("oscillating", "relaxed", "RuntimeError: the plugin gave up", "infeasible", "residual", " wrong"):
        assert words in printed
    assert "…" not in printed
    heads = [line.split() for line in printed.splitlines() if line.startswith("solver ")]
    assert len(heads) == 5  # three problems, and the summary to two accuracies
    assert all(head[:2] == ["solver", "model"] for head in heads)
    for piece in ("SORprox(relaxation=0.5)", "ClarabelSOCP", "Misbehaving(lie)"):
        assert piece in printed


@pytest.mark.parametrize(
    ("seconds", "text"), [(1.5, "1.5 s"), (0.0031, "3.1 ms"), (4.2e-5, "42 µs"), (float("nan"), "–"), (3e-7, "0.3 µs")]
)
def test_times_are_shown_in_engineering_units(seconds: float, text: str) -> None:
    assert duration(seconds) == text


@pytest.mark.parametrize(
    ("plan", "problems", "title"),
    [
        ({}, ("a", "b", "c"), "all 3 problems, to"),
        ({}, ("a", "b"), "2 of 3 problems, to"),
        ({}, ("b",), "1 of 3 problems, to"),
        ({"suite": "mine", "requested": ["mine"]}, ("a", "b", "c"), "all 3 problems of mine, to"),
        ({"suite": "mine", "requested": ["mine"], "available": 9}, ("a", "b", "c"), "3 of 9 problems of mine, to"),
        ({"suite": "mine", "requested": ["mine"], "sample": 3}, ("a", "b", "c"), "3 problems of mine, to"),
        ({"suite": "mine", "requested": ["mine"], "shard": "1/2"}, ("a", "b"), "2 problems of mine, to"),
    ],
)
def test_the_summary_says_which_part_of_the_problems_it_is_about(
    plan: dict[str, object], problems: tuple[str, ...], title: str, tmp_path: Path
) -> None:
    points = [solved_point(1e-2, [timed_round(0, 0.1)])]
    cases = [
        case_record(problem=name, solver="S", points=points, outcome=Outcome.MEASURED, digest="0" * 64)
        for name in ("a", "b", "c")
    ]
    frames = load(store_run(tmp_path / "run", cases))
    frames = replace(frames, info=changed(frames.info, plan=changed(frames.info.plan, **plan)))
    for shown in (frames.only(problems), measured_only(frames, problems)):
        text = StringIO()
        print_tables(shown, Console(file=text, width=120))
        assert any(line.startswith(title) for line in text.getvalue().splitlines())


def measured_only(frames: RunFrames, problems: tuple[str, ...]) -> RunFrames:
    """Return a run that was interrupted after some problems."""
    tables = {name: getattr(frames, name) for name in ("cases", "points", "rounds", "iterations", "errors")}
    return replace(frames, **{name: table[table["problem"].isin(problems)] for name, table in tables.items()})
