"""Charts show judged residuals, in files that open anywhere."""

import json
from dataclasses import replace
from pathlib import Path

import pandas as pd
from proxbench.bench import load
from proxbench.bench.charts import LARGEST_RESIDUAL, convergence, work_precision, write_charts
from proxbench.bench.outcome import Outcome


def test_accuracy_is_the_judged_residual_never_the_tolerance(finished_run: Path) -> None:
    chart = json.loads(work_precision(load(finished_run), "funnel-30").to_json())
    fields = {layer["encoding"]["x"]["field"] for layer in chart["layer"]}
    assert fields == {"residual"}


def test_a_solver_has_the_same_colour_in_every_chart(finished_run: Path) -> None:
    frames = load(finished_run)
    scales = [
        json.loads(chart.to_json())["layer"][0]["encoding"]["color"]["scale"]
        for chart in (work_precision(frames, "funnel-30"), convergence(frames, "hard-counterexample"))
    ]
    assert scales[0] == scales[1]


def test_the_legend_names_the_solvers_that_are_drawn_and_no_other(finished_run: Path) -> None:
    chart = json.loads(convergence(load(finished_run), "funnel-30").to_json())
    named = chart["layer"][0]["encoding"]["color"]["legend"]["values"]
    assert "SORprox" in named
    assert "ClarabelSOCP" not in named  # it has no iterates


def test_every_point_is_marked_as_answered_or_not(finished_run: Path) -> None:
    chart = json.loads(work_precision(load(finished_run), "funnel-30").to_json())
    filters = [layer["transform"][0]["filter"] for layer in chart["layer"] if layer["mark"]["type"] == "point"]
    answered, unanswered = (set(chosen["oneOf"]) for chosen in filters if isinstance(chosen, dict))
    assert answered == {Outcome.SOLVED, Outcome.RELAXED}
    assert answered | unanswered == set(Outcome)
    assert not answered & unanswered


def test_a_diverging_curve_leaves_the_chart_instead_of_levelling_off(finished_run: Path) -> None:
    frames = load(finished_run)
    growing = pd.DataFrame({"problem": "funnel-30", "solver": "SORprox", "iteration": [1, 2], "residual": [0.5, 1e9]})
    chart = json.loads(convergence(replace(frames, iterations=growing), "funnel-30").to_json())
    drawn = next(iter(chart["datasets"].values()))
    assert [row["residual"] for row in drawn] == [0.5, 1e9]
    layer = chart["layer"][0]
    assert layer["encoding"]["y"]["scale"]["domain"] == [0.25, LARGEST_RESIDUAL]
    assert layer["mark"]["clip"]


def test_both_charts_of_every_problem_are_written(finished_run: Path, tmp_path: Path) -> None:
    files = write_charts(load(finished_run), tmp_path)
    names = {file.name for file in files}
    assert not any(name.startswith("hard-immovable") for name in names)  # no finite residual to draw
    assert "funnel-30-work-precision.svg" in names
    assert "funnel-30-convergence.png" in names
    for file in files:
        begin = file.read_bytes()[:200]
        assert begin.startswith(b"\x89PNG") if file.suffix == ".png" else b"<svg" in begin
