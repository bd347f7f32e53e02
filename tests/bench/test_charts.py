"""Charts show judged residuals, in files that open anywhere."""

import json
from pathlib import Path

from proxbench.bench import load
from proxbench.bench.charts import convergence, work_precision, write_charts


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


def test_both_charts_of_every_problem_are_written(finished_run: Path, tmp_path: Path) -> None:
    files = write_charts(load(finished_run), tmp_path)
    names = {file.name for file in files}
    assert "funnel-30-work-precision.svg" in names
    assert "funnel-30-convergence.png" in names
    for file in files:
        begin = file.read_bytes()[:200]
        assert begin.startswith(b"\x89PNG") if file.suffix == ".png" else b"<svg" in begin
