"""Charts of a whole run agree with its summary table."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from msgspec.structs import replace as changed
from proxbench.bench.report import accuracy
from proxbench.bench.report.accuracy import summary_table
from proxbench.bench.report.charts.drawing import write_drawing
from proxbench.bench.report.charts.palette import solver_styles
from proxbench.bench.report.charts.profiles import profile_panel
from proxbench.bench.report.charts.summary import success_chart, summary_charts, time_chart
from proxbench.bench.store.frames import RunFrames
from proxbench.bench.store.outcome import Outcome


def rows(chart: Any, field: str) -> list[dict[str, Any]]:
    """Rows of all data of a chart that have a field, each once."""
    found = [row for data in chart.to_dict()["datasets"].values() for row in data if field in row]
    return list({json.dumps(row): row for row in found}.values())


@pytest.mark.slow
def test_means_and_shares_are_those_of_the_summary_table(finished: RunFrames) -> None:
    frames = finished
    means = {(row["solver"], row["accuracy"]): row for row in rows(time_chart(frames), "reached")}
    for row in summary_table(frames).to_dict("records"):
        for level in (1e-4, 1e-6):
            drawn = means[row["solver"], level]
            assert drawn["milliseconds"] == pytest.approx(1e3 * row[f"mean_time_{level:.0e}"])
            reached, _, number = drawn["reached"].split()
            assert int(reached) / int(number) == pytest.approx(row[f"correct_{level:.0e}"])


@pytest.mark.slow
def test_counts_match_the_claims_and_the_verdicts(finished: RunFrames) -> None:
    frames = finished
    counts = {(row["solver"], row["tolerance"]): row for row in rows(success_chart(frames), "claimed")}
    for row in summary_table(frames).to_dict("records"):
        cell = counts[row["solver"], "1e-4"]
        assert cell["claimed"] / cell["n"] == pytest.approx(row["success_1e-04"])
        assert cell["confirmed"] / cell["n"] == pytest.approx(row["correct_1e-04"])


@pytest.mark.slow
def test_solvers_that_support_no_problem_are_named(finished: RunFrames) -> None:
    frames = finished
    cases = frames.cases.copy()
    cases.loc[cases["solver"] == "SORprox", "outcome"] = Outcome.UNSUPPORTED
    for chart in summary_charts(replace(frames, cases=cases)).values():
        assert "not shown: SORprox (no supported problem)" in " ".join(chart.to_dict()["title"]["subtitle"])


@pytest.mark.slow
def test_a_run_without_a_common_problem_has_times_and_no_means(finished: RunFrames) -> None:
    frames = finished
    kept = frames.cases["solver"].map({"SORprox": "funnel-30", "ClarabelSOCP": "hard-immovable"})
    apart = replace(frames, cases=frames.cases[frames.cases["problem"] == kept])
    chart = time_chart(apart)
    assert rows(chart, "problem")
    assert all(row["milliseconds"] is None for row in rows(chart, "reached"))
    assert "the 0 problems that all" in " ".join(chart.to_dict()["title"]["subtitle"])


def test_nothing_is_drawn_where_nothing_is_supported(finished: RunFrames) -> None:
    frames = finished
    assert summary_charts(replace(frames, cases=frames.cases.assign(outcome=Outcome.UNSUPPORTED))) == {}


@pytest.mark.slow
@pytest.mark.parametrize("excludes", [False, True])
def test_the_note_says_whether_problems_with_excluded_times_are_left_out(
    excludes: bool, finished: RunFrames, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = finished
    case = (frames.cases["problem"].iloc[0], frames.cases["solver"].iloc[0])
    monkeypatch.setattr(accuracy, "excluded_cases", lambda *_: {case} if excludes else set())
    lines = time_chart(frames).to_dict()["title"]["subtitle"]
    assert ("without those with excluded times" in " ".join(lines)) == excludes


@pytest.mark.slow
def test_long_names_of_solvers_differ_in_all_charts_with_rows_of_solvers(finished: RunFrames, tmp_path: Path) -> None:
    long = "Fallback(SORprox(relaxation=1.5, form='factors'), NSGS, SORprox, {})"
    names = {"SORprox": long.format("Robust"), "ClarabelSOCP": long.format("Jprox")}
    tables = {
        name: getattr(finished, name).replace({"solver": names}) for name in ("cases", "points", "rounds", "iterations")
    }
    plan = finished.info.plan
    plan = changed(plan, solvers=[names.get(solver, solver) for solver in plan.solvers])
    frames = replace(finished, info=changed(finished.info, plan=plan), **tables)
    speedups = pd.DataFrame({"solver": names.values(), "problem": "p", "speedup": 2.0})
    panel = profile_panel("speedup", solver_styles(plan.solvers), speedups)
    charts = {**summary_charts(frames), "speedup": panel}
    for name, chart in charts.items():
        svg, _ = write_drawing(chart, tmp_path / name)
        labels = re.findall(r">(Fallback\([^<]*)</text>", svg.read_text(encoding="utf-8"))
        assert {label.rpartition(", ")[2] for label in labels} == {"Robust)", "Jprox)"}, name
