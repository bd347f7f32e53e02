"""Charts of the problems of a run, one file per problem: cost against accuracy, and convergence of the iterations.

Charts of a trajectory show wall time and number of one-step solves against accuracy, for each quantity with an error.
"""

from collections.abc import Mapping
from pathlib import Path
from textwrap import shorten
from typing import Any, Literal

import altair as alt
import numpy as np
import pandas as pd

from ...store.condition import chart_notes
from ...store.frames import POINT, RunFrames
from ...store.outcome import Outcome
from ...store.store import plain_name
from ..endings import case_endings
from ..layout.text import counted
from ..studies import headline, motion_warning, reference_statistics
from .drawing import (
    LEGEND_WIDTH,
    SEPARATE_LEGENDS,
    TIME_AXIS,
    TIME_TITLE,
    by_name,
    heading,
    log_scale,
    side_by_side,
    solver_legend,
    stacked,
    write_drawing,
)
from .palette import SolverStyle, solver_styles
from .summary import summary_charts

MIN_RESIDUAL = 1e-16
"""Value at which zero residuals are drawn on logarithmic axes."""

MAX_RESIDUAL = 1e3
"""Largest residual on charts, so that diverging solvers do not compress the other curves."""

RESIDUAL_AXIS: dict[str, Any] = {
    "format": ".0e",
    "values": [10.0**power for power in range(-16, 4)],
    "labelOverlap": True,
}
"""Ticks of axes of residuals."""

CROSS = "M-1,-1L1,1M-1,1L1,-1"
"""Two strokes, as an SVG path, for wrong claims."""

WIDTH, HEIGHT = 620, 330
"""Size of a panel [pixels]."""

MAX_REASON_LENGTH = 70
"""Largest number of characters of the reason why a solver is not shown; the tables contain the full reason."""

MIN_SHARE = 0.05
"""Share of the upper end of a bar; a mean deviation below this share is noise and is drawn at this share."""

COST_TITLES = {"milliseconds": TIME_TITLE, "wall": "wall time [s]", "iterations": "one-step solves"}
"""Titles of the axis of cost, by column."""

FILLED_OUTCOMES = (Outcome.SOLVED.value, Outcome.RELAXED.value)
"""Outcomes that are drawn as filled marks."""

COST_NOTE = (
    "Each curve is a solver, each mark a solve: lower is faster, further to the right is more accurate. "
    "Vertical lines are quartiles, hollow marks are solves that fail, × is a wrong claim."
)
"""Explanation of the chart of cost against accuracy."""

CONVERGENCE_NOTE = "Each curve is a solver: the sooner it falls, the fewer iterations it needs."
"""Explanation of the chart of convergence."""


def write_charts(frames: RunFrames, folder: Path) -> list[Path]:
    """Write the charts of all problems with drawable rows, and those of the whole run, as SVG and PNG.

    Returns:
        The files.

    Raises:
        UnwritableError: if they cannot be written.
        BenchError: if a link in the folder leads out of it.
    """
    files = []
    draw = trajectory_chart if frames.is_study else problem_chart
    for problem in frames.cases["problem"].unique():
        if has_drawable_rows(frames, problem):
            files += write_drawing(draw(frames, problem), folder / plain_name(problem))
    for name, chart in ({} if frames.is_study else summary_charts(frames)).items():
        files += write_drawing(chart, folder / name)
    return files


def has_drawable_rows(frames: RunFrames, problem: str) -> bool:
    """Return whether a problem has rows for a chart."""
    costs = _drawable(frames.points, problem) if frames.is_study else _costs(frames, problem)
    return len(costs) > 0 or len(_curves(frames, problem)) > 0


def trajectory_chart(frames: RunFrames, problem: str) -> alt.VConcatChart:
    """Return a row of panels for each quantity of a trajectory: wall time, and one-step solves, over the error.

    Bars go from the smallest to the largest error of a member, or show a standard error of the mean deviation; a dashed
    line is the standard error, over seeds, of the reference itself.
    """
    trajectory, styles = frames.info.plan.trajectory(problem), solver_styles(frames.info.plan.solvers)
    points = frames.points[frames.points["problem"] == problem].merge(frames.errors, on=POINT, suffixes=("", "_of"))
    floor_error = np.maximum(MIN_SHARE * points["high"], MIN_RESIDUAL)
    points = points.assign(
        wall=points["total_seconds"],
        residual=np.maximum(points["error"], floor_error),
        low=np.maximum(points["low"], floor_error),
        high=np.maximum(points["high"], MIN_RESIDUAL),
    )
    floors = {quantity: floor for quantity, (_, floor) in reference_statistics(trajectory).items() if floor > 0.0}
    rows: list[alt.HConcatChart] = []
    for quantity in points["quantity"].unique():
        own = points[points["quantity"] == quantity]
        error = "error" if len(points) == len(own) else f"error of {quantity}"
        panels = []
        for work in ("wall", "iterations"):
            legend = solver_legend(styles, points["solver"]) if work == "iterations" and not rows else None
            panel = cost_panel(styles, own, f"{error}, relative", work, legend, floor=floors.get(quantity))
            panels.append(panel.properties(width=WIDTH, height=HEIGHT))
        rows.append(side_by_side(panels, spacing=40))
    notes = [*chart_notes(frames), _omission_note(frames, problem, points), motion_warning(trajectory)]
    title = heading(headline(frames.info.plan, problem), notes, 2 * WIDTH + LEGEND_WIDTH)
    return stacked(rows, title, SEPARATE_LEGENDS, spacing=20)


def problem_chart(frames: RunFrames, problem: str) -> alt.VConcatChart:
    """Return the panels of cost against accuracy and of convergence, each if there are rows to draw.

    A solver has the same colour, shape and dashes in all charts of a run.
    """
    panels = [
        draw(frames, problem)
        for rows, draw in ((_costs(frames, problem), work_precision), (_curves(frames, problem), convergence))
        if len(rows)
    ]
    case = frames.cases[frames.cases["problem"] == problem].iloc[0]
    size = f"{counted(int(case['n_contacts']), 'contact')}, {counted(int(case['n_rows']), 'row')}"
    title = heading(problem, [size, *chart_notes(frames)], WIDTH + LEGEND_WIDTH)
    return stacked(panels, title, SEPARATE_LEGENDS, spacing=20)


def work_precision(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return median time over the residual of the frames, one line for each solver, more accurate to the right.

    Marks are at this residual, not at the tolerance: filled for successful solves, hollow for the best iterate of
    other solves, and crosses for wrong claims.
    """
    rows, styles = _costs(frames, problem), solver_styles(frames.info.plan.solvers)
    residual = f"{frames.residual} residual (velocity error, relative)"
    panel = cost_panel(styles, rows, residual, "milliseconds", solver_legend(styles, rows["solver"]))
    return _titled(panel, "What accuracy costs", [COST_NOTE, _omission_note(frames, problem, rows)])


def convergence(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return the judged residual over iterations of the observed solves, one line per solver.

    Curves are cut at ``MAX_RESIDUAL``.
    """
    rows, styles = _curves(frames, problem), solver_styles(frames.info.plan.solvers)
    panel = convergence_panel(styles, rows, solver_legend(styles, rows["solver"], has_marks=False))
    return _titled(panel, "Convergence", [CONVERGENCE_NOTE, _omission_note(frames, problem, rows)])


def cost_panel(
    styles: Mapping[str, SolverStyle],
    data: Any,
    residual: str,
    work: str,
    legend: alt.Legend | None = None,
    *,
    floor: float | None = None,
) -> alt.LayerChart:
    """Return the cost over the residual, or error, of solves, more accurate to the right.

    Args:
        styles: the style of each solver.
        data: rows with the columns solver, tolerance, residual, low, high, iterations, outcome and that of the work, or
            data of altair that are filled in later. Low and high are ends of bars: of times, or of errors.
        residual: title of the horizontal axis.
        work: column of the vertical axis, one of ``COST_TITLES``; bars are vertical for "milliseconds" only.
        legend: legend of solvers.
        floor: residual at which a dashed line is drawn.
    """
    bar: Literal["x", "y"] = "y" if work == "milliseconds" else "x"
    x_ends, y_ends = (["residual"], ["low", "high"]) if bar == "y" else (["low", "high"], [work])
    columns = ["solver", "tolerance", "residual", "low", "high", "iterations", "outcome"]
    data = data if not isinstance(data, pd.DataFrame) else data[list(dict.fromkeys([*columns, work]))]
    titles = {"x": f"{residual}; better to the right", "y": f"{COST_TITLES[work]}; better below"}
    base = alt.Chart(data).encode(
        x=alt.X("residual:Q", title=titles["x"], scale=log_scale(data, x_ends, floor, True, has_decades=True)).axis(
            **RESIDUAL_AXIS
        ),
        y=alt.Y(f"{work}:Q", title=titles["y"], scale=log_scale(data, y_ends)).axis(**TIME_AXIS),
        color=by_name(alt.Color, "solver", styles, "colour", legend),
    )
    channel = {"x": alt.X, "y": alt.Y}[bar]
    ends = {bar: channel("low:Q", title=titles[bar]), f"{bar}2": "high:Q"}
    layers = [
        base.mark_rule(strokeWidth=1).encode(**ends),
        base.mark_line(strokeWidth=2).encode(
            strokeDash=by_name(alt.StrokeDash, "solver", styles, "dash", legend), order="tolerance:Q"
        ),
        *_solve_marks(base, styles, work, legend),
    ]
    if floor is not None:
        rule = alt.Chart(pd.DataFrame({"floor": [floor]})).mark_rule(strokeDash=[5, 3], color="#666666")
        layers.append(rule.encode(x=alt.X("floor:Q", title=titles["x"])))
    return alt.LayerChart(layer=layers)


def convergence_panel(styles: Mapping[str, SolverStyle], data: Any, legend: alt.Legend | None = None) -> alt.LayerChart:
    """Return judged residual over iterations of rows with the columns solver, iteration and residual."""
    data = data if not isinstance(data, pd.DataFrame) else data[["solver", "iteration", "residual"]]
    base = alt.Chart(data).encode(
        x=alt.X("iteration:Q", title="iteration", scale=log_scale(data, ["iteration"])).axis(
            **{**TIME_AXIS, "format": "~s"}
        ),
        y=alt.Y(
            "residual:Q",
            title="judged residual (velocity error, relative)",
            scale=log_scale(data, ["residual"], has_decades=True),
        ).axis(**RESIDUAL_AXIS),
        color=by_name(alt.Color, "solver", styles, "colour", legend),
        tooltip="solver:N",
    )
    dash = by_name(alt.StrokeDash, "solver", styles, "dash", legend)
    return alt.LayerChart(layer=[base.mark_line(strokeWidth=1.8).encode(strokeDash=dash)])


def _solve_marks(
    base: alt.Chart, styles: Mapping[str, SolverStyle], work: str, legend: alt.Legend | None
) -> list[alt.Chart]:
    """Return the marks of solves: filled for ``FILLED_OUTCOMES``, else hollow, and crossed if the claim is wrong."""
    shaped = base.encode(
        shape=by_name(alt.Shape, "solver", styles, "shape", legend),
        tooltip=["solver:N", "residual:Q", f"{work}:Q", "iterations:Q", "outcome:N"],
    )
    other_outcomes = [outcome.value for outcome in Outcome if outcome.value not in FILLED_OUTCOMES]
    is_filled = alt.FieldOneOfPredicate(field="outcome", oneOf=list(FILLED_OUTCOMES))
    is_hollow = alt.FieldOneOfPredicate(field="outcome", oneOf=other_outcomes)
    filled = shaped.transform_filter(is_filled).mark_point(filled=True, size=60, opacity=1)
    hollow = shaped.transform_filter(is_hollow).mark_point(fill="white", size=60, opacity=1, strokeWidth=1.8)
    wrong = (
        base.transform_filter(alt.datum.outcome == Outcome.WRONG.value)
        .mark_point(shape=CROSS, size=150, strokeWidth=2, opacity=1)
        .encode(color=alt.value("black"))
    )
    return [filled, hollow, wrong]


def _titled(panel: alt.LayerChart, title: str, notes: list[str]) -> alt.LayerChart:
    chart_title = heading(title, notes, WIDTH + LEGEND_WIDTH, 13)
    titled: alt.LayerChart = panel.properties(width=WIDTH, height=HEIGHT, title=chart_title)
    return titled


def _costs(frames: RunFrames, problem: str) -> pd.DataFrame:
    """Return the measured points of a problem with their times [ms] and quartiles."""
    points = _drawable(frames.points, problem)
    points = points[points["total_seconds"].notna()].sort_values("tolerance", ascending=False, kind="stable")
    times = {"milliseconds": "total_seconds", "low": "total_seconds_q1", "high": "total_seconds_q3"}
    return points.assign(**{name: 1e3 * points[time] for name, time in times.items()})


def _curves(frames: RunFrames, problem: str) -> pd.DataFrame:
    """Return the drawable iterates of a problem."""
    curves = _drawable(frames.iterations, problem)
    return curves[(curves["iteration"] > 0) & (curves["residual"] <= MAX_RESIDUAL)]


def _drawable(rows: pd.DataFrame, problem: str) -> pd.DataFrame:
    """Return the rows of a problem with a finite residual, which a logarithmic axis can show."""
    own = rows[rows["problem"] == problem]
    residual = own["residual"].astype(float).clip(lower=MIN_RESIDUAL)
    drawable: pd.DataFrame = own.assign(residual=residual)[np.isfinite(residual)]
    return drawable


def _omission_note(frames: RunFrames, problem: str, shown: pd.DataFrame) -> str:
    """Return a note on the solvers that are not among the ``shown`` rows, with the reasons; empty if there are none."""
    measured_solvers = set(_costs(frames, problem)["solver"])
    own = frames.only([problem])
    endings = case_endings(own).set_index(own.cases["solver"])
    reasons: dict[str, list[str]] = {}
    for solver in frames.info.plan.solvers:
        if solver in set(shown["solver"]):
            continue
        reason = "not measured yet"
        if solver in measured_solvers:
            reason = "no iterates"
        elif solver in endings.index:
            reason = "{outcome}: {reason}".format(**endings.loc[solver])
        reasons.setdefault(shorten(reason.rstrip("."), MAX_REASON_LENGTH, placeholder=" …"), []).append(solver)
    if not reasons:
        return ""
    return "not shown: " + "; ".join(f"{', '.join(names)} ({reason})" for reason, names in reasons.items())
