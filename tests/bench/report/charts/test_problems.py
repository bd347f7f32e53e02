"""Charts show judged residuals, in self-contained files."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from proxbench.bench.report.charts.problems import (
    MAX_RESIDUAL,
    convergence,
    problem_chart,
    work_precision,
    write_charts,
)
from proxbench.bench.store.frames import RunFrames
from proxbench.bench.store.outcome import Outcome


def in_legends(chart: dict[str, Any]) -> set[str]:
    """Names in the legends of the panels of a chart."""
    return {name for panel in chart["vconcat"] for name in panel["layer"][0]["encoding"]["color"]["legend"]["values"]}


def test_accuracy_axis_shows_the_judged_residual_not_the_tolerance(finished: RunFrames) -> None:
    chart = json.loads(work_precision(finished, "funnel-30").to_json())
    fields = {layer["encoding"]["x"]["field"] for layer in chart["layer"] if layer["mark"]["type"] != "text"}
    assert fields == {"residual"}


def test_a_solver_has_the_same_colour_in_every_chart(finished: RunFrames) -> None:
    frames = finished
    scales = [
        json.loads(chart.to_json())["layer"][0]["encoding"]["color"]["scale"]
        for chart in (work_precision(frames, "funnel-30"), convergence(frames, "hard-counterexample"))
    ]
    assert scales[0] == scales[1]


def test_legends_name_the_solvers_that_are_shown(finished: RunFrames) -> None:
    names = in_legends(json.loads(problem_chart(finished, "funnel-30").to_json()))
    assert {"SORprox", "ClarabelSOCP"} <= names
    assert "Misbehaving(raise)" not in names  # it has no points


@pytest.mark.slow
def test_omitted_solvers_are_named_with_the_reason(finished: RunFrames) -> None:
    frames = finished
    chart = json.loads(problem_chart(frames, "funnel-30").to_json())
    costs, iterations = (" ".join(panel["title"]["subtitle"]) for panel in chart["vconcat"][:2])
    assert "not shown: Misbehaving(raise) (crashed" in costs
    assert "ClarabelSOCP" not in costs
    assert "not shown: ClarabelSOCP, Misbehaving(lie) (no iterates)" in iterations


def test_the_reason_why_a_problem_is_unsupported_is_shown(finished: RunFrames) -> None:
    frames = finished
    points = frames.points[frames.points["solver"] != "SORprox"]
    cases = frames.cases.copy()
    cases.loc[cases["solver"] == "SORprox", ["outcome", "reason"]] = [Outcome.UNSUPPORTED.value, "no balls " * 20]
    chart = json.loads(work_precision(replace(frames, cases=cases, points=points), "funnel-30").to_json())
    lines = chart["title"]["subtitle"]
    assert "SORprox (unsupported: no balls" in " ".join(lines)
    assert " …)" in " ".join(lines)
    assert all(len(line) < 130 for line in lines)


def test_every_point_is_marked_as_answered_or_not(finished: RunFrames) -> None:
    chart = json.loads(work_precision(finished, "funnel-30").to_json())
    filters = [layer["transform"][0]["filter"] for layer in chart["layer"] if layer["mark"]["type"] == "point"]
    answered, unanswered = (set(chosen["oneOf"]) for chosen in filters if isinstance(chosen, dict))
    assert answered == {Outcome.SOLVED, Outcome.RELAXED}
    assert answered | unanswered == set(Outcome)
    assert not answered & unanswered


def test_a_diverging_curve_leaves_the_chart_instead_of_levelling_off(finished: RunFrames) -> None:
    frames = finished
    growing = pd.DataFrame(
        {"problem": "funnel-30", "solver": "SORprox", "iteration": [1, 2, 3], "residual": [0.5, 200.0, 1e9]}
    )
    chart = json.loads(convergence(replace(frames, iterations=growing), "funnel-30").to_json())
    (drawn,) = chart["datasets"].values()
    assert [row["residual"] for row in drawn] == [0.5, 200.0]
    assert max(chart["layer"][0]["encoding"]["y"]["scale"]["domain"]) < MAX_RESIDUAL


@pytest.mark.slow
def test_one_chart_of_every_problem_and_those_of_the_run_are_written(finished: RunFrames, tmp_path: Path) -> None:
    files = write_charts(finished, tmp_path)
    names = {file.name for file in files}
    charts = ("funnel-30", "hard-counterexample", "summary-success", "summary-time")  # hard-immovable: no finite value
    assert names == {f"{chart}.{kind}" for chart in charts for kind in ("svg", "png")}
    for file in files:
        begin = file.read_bytes()[:200]
        assert begin.startswith(b"\x89PNG") if file.suffix == ".png" else b"<svg" in begin
