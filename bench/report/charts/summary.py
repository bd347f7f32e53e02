"""Charts of a whole run: the time to accuracy over all problems, and the number of problems that each solver solves."""

from collections.abc import Sequence
from typing import Any

import altair as alt
import pandas as pd

from ...store.condition import chart_notes
from ...store.fields import accuracy_tag, exponent
from ...store.frames import RunFrames
from ..accuracy import attempts, families, families_table, mean_time, summary_accuracies
from ..cells import duration, solved_texts
from ..layout.text import counted
from .drawing import FONT_SIZE, LEGEND_WIDTH, TIME_AXIS, TIME_TITLE, by_name, heading, log_scale, name_labels, stacked
from .palette import PALETTE, solver_styles

WIDTH = 300
"""Width of each of two adjacent panels [pixels]."""

ROW = 26
"""Height of the row of a solver [pixels]."""

FAMILY_ROW, FAMILY_COLUMN = 36, 64
"""Size of the cell of a solver and a family [pixels]."""

PALE, WHITE_TEXT_SHARE = "#eef3f7", 0.55
"""Colour of a zero share, and the share above which numbers are white."""


def summary_charts(frames: RunFrames) -> dict[str, alt.VConcatChart]:
    """Return the charts of a whole run by the names of their files; none if no solver supports a problem."""
    if attempts(frames, [1.0]).empty:
        return {}
    charts = {"summary-time": time_chart(frames), "summary-success": success_chart(frames)}
    return charts | ({"summary-families": families_chart(frames)} if families(frames) else {})


def time_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return the chart of the times to the accuracies of the summary, one row per solver: each problem, and the mean.

    The mean is the shifted geometric mean over the problems that all solvers support, with failures at the time limit.
    """
    limit = frames.info.plan.limits.solve_seconds
    results = attempts(frames, summary_accuracies(frames))
    results["milliseconds"] = 1e3 * results["seconds"].where(~results["excluded"])
    rows: list[dict[str, Any]] = []
    for (solver, accuracy), own in results.groupby(["solver", "accuracy"], sort=False):
        mean = 1e3 * mean_time(own["seconds"][own["compared"]].to_numpy(), limit)
        reached = f"{own['seconds'].notna().sum()} of {len(own)}"
        rows.append({"solver": solver, "accuracy": accuracy, "milliseconds": mean, "reached": reached})
    means = pd.DataFrame(rows)
    all_times = pd.concat([results[["milliseconds"]], means[["milliseconds"]]]).dropna()
    scale = log_scale(all_times if len(all_times) else pd.DataFrame({"milliseconds": [1e3 * limit]}), ["milliseconds"])
    panels = [
        _time_panel(frames, results, means, accuracy, scale, has_names=k == 0)
        for k, accuracy in enumerate(means["accuracy"].unique())
    ]
    common = counted(results["problem"][results["common"]].nunique(), "problem")
    left_out = ", without those with excluded times" if (results["common"] & ~results["compared"]).any() else ""
    note = (
        f"large marks: shifted geometric mean over the {common} that all these solvers support{left_out}; "
        f"failures count as {duration(limit)}; right: solved and supported problems"
    )
    return _run_chart("Time to accuracy", note, panels, frames, results)


def success_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return the chart of the numbers of problems solved to each tolerance by each solver, confirmed and claimed."""
    results = attempts(frames, sorted(frames.info.plan.tolerances, reverse=True))
    results["tolerance"] = results["accuracy"].map(exponent)
    counts = results.groupby(["solver", "tolerance"], sort=False).agg(
        confirmed=("seconds", "count"), claimed=("claimed", "sum"), n=("problem", "size")
    )
    counts = counts.reset_index().assign(all=[f"of {number}" for number in counts["n"]])
    panels: list[alt.LayerChart] = []
    for column, authority, title in (
        ("confirmed", "the judge", f"{frames.residual} residual"),
        ("claimed", "the solver", "tolerance"),
    ):
        across = _columns("tolerance", list(counts["tolerance"].unique()), title)
        cells = counts.assign(share=counts[column] / counts["n"])
        solvers = _rows(counts["solver"].unique(), has_names=not panels, has_lines=False)
        panel = _heat_panel(cells, across, solvers, {column: 0}, f"{column} by {authority}")
        panel.layer.append(_right_labels(cells.drop_duplicates("solver")).encode(y=solvers, text="all:N"))
        panels.append(panel)
    return _run_chart("Success", "problems solved, of those that the solver supports", panels, frames, results)


def families_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return the chart of the share of each family that each solver solves to each accuracy, with mean times."""
    accuracies, table, names = summary_accuracies(frames), families_table(frames), families(frames)
    results = attempts(frames, accuracies)
    across = _columns("family", names, None, angle=-30)
    panels: list[alt.LayerChart] = []
    for accuracy in accuracies:
        tag = accuracy_tag(accuracy)
        cells = table[["family", "solver"]].assign(
            share=table[f"correct_{tag}"],
            solved=solved_texts(table, f"correct_{tag}"),
            mean=table[f"mean_time_{tag}"].map(duration),
        )
        title = f"to a {frames.residual} residual of {exponent(accuracy)}"
        width = max(WIDTH, FAMILY_COLUMN * len(names))
        solvers = _rows(results["solver"].unique(), has_names=not panels, has_lines=False)
        panels.append(_heat_panel(cells, across, solvers, {"solved": -6, "mean": 7}, title, width))
    note = "solved and supported problems (white: none supported); mean time over those that all solvers support"
    return _run_chart("Success by family", note, panels, frames, results)


def _run_chart(
    title: str, note: str, panels: list[alt.LayerChart], frames: RunFrames, results: pd.DataFrame
) -> alt.VConcatChart:
    """Return adjacent panels below a note, the solvers that support no problem, and the state of the run."""
    absent = [solver for solver in frames.info.plan.solvers if solver not in set(results["solver"])]
    notes = [
        f"{counted(results['problem'].nunique(), 'problem')}; {note}",
        f"not shown: {', '.join(absent)} (no supported problem)" if absent else "",
        *chart_notes(frames),
    ]
    chart_title = heading(title, notes, len(panels) * WIDTH + LEGEND_WIDTH)
    return stacked([alt.hconcat(*panels, spacing=40)], chart_title, {"color": "shared"}, label_width=0)


def _time_panel(
    frames: RunFrames, results: pd.DataFrame, means: pd.DataFrame, accuracy: float, scale: alt.Scale, has_names: bool
) -> alt.LayerChart:
    """Return the times to one accuracy: a tick for each problem, and a large mark for the mean of each solver."""
    styles = solver_styles(frames.info.plan.solvers)
    colour = by_name(alt.Color, "solver", styles, "colour")
    columns = ["solver", "accuracy", "problem", "milliseconds"]
    dots, mean = results[results["accuracy"] == accuracy][columns], means[means["accuracy"] == accuracy]
    rows = _rows(means["solver"].unique(), has_names=has_names, has_lines=True)
    across = alt.X("milliseconds:Q", title=TIME_TITLE, scale=scale).axis(**TIME_AXIS)
    tick = alt.Chart(dots.dropna()).mark_tick(thickness=1.5, height=10, opacity=0.75)
    mark = alt.Chart(mean.dropna()).mark_point(filled=True, size=95, opacity=1)
    layers = [
        tick.encode(x=across, y=rows, color=colour, tooltip=["solver", "problem", "milliseconds"]),
        mark.encode(x=across, y=rows, color=colour, shape=by_name(alt.Shape, "solver", styles, "shape")),
        _right_labels(mean).encode(y=rows, text="reached:N"),
    ]
    return _panel(layers, f"to a {frames.residual} residual of {exponent(accuracy)}")


def _heat_panel(
    cells: pd.DataFrame, across: alt.X, solvers: alt.Y, texts: dict[str, int], title: str, width: int = WIDTH
) -> alt.LayerChart:
    """Return shares as coloured cells, with texts that are shifted down by a number of pixels."""
    base = alt.Chart(cells).encode(x=across, y=solvers)
    fill = alt.Color("share:Q", legend=None).scale(domain=[0.0, 1.0], range=[PALE, PALETTE[0]])
    text_colour = alt.condition(alt.datum.share > WHITE_TEXT_SHARE, alt.value("white"), alt.value("#222222"))
    layers = [base.mark_rect(stroke="white", strokeWidth=2).encode(color=fill)]
    for text, shift in texts.items():
        layers.append(base.mark_text(fontSize=FONT_SIZE, dy=shift).encode(text=f"{text}:N", color=text_colour))
    return _panel(layers, title, ROW if len(texts) == 1 else FAMILY_ROW, width)


def _columns(field: str, names: Sequence[str], title: str | None, angle: int = 0) -> alt.X:
    """Return columns with their names above them."""
    return alt.X(f"{field}:N", sort=list(names), title=title).axis(
        orient="top",
        labelAngle=angle,
        labelAlign="left" if angle else "center",
        **name_labels(names),
        ticks=False,
        domain=False,
        grid=False,
    )


def _right_labels(rows: pd.DataFrame) -> alt.Chart:
    """Return texts to the right of a panel."""
    text: alt.Chart = alt.Chart(rows).mark_text(align="left", fontSize=FONT_SIZE, color="#444444", x=WIDTH + 5)
    return text


def _panel(layers: list[alt.Chart], title: str, row: int = ROW, width: int = WIDTH) -> alt.LayerChart:
    chart_title = alt.TitleParams(title, anchor="start", frame="group", fontSize=13)
    panel: alt.LayerChart = alt.LayerChart(layer=layers, width=width, height=alt.Step(row), title=chart_title)
    return panel


def _rows(solvers: Any, has_names: bool, has_lines: bool) -> alt.Y:
    """Return the rows of solvers in the order of the run, with or without their names and lines through them."""
    labels = name_labels(solvers)
    axis = alt.Axis(labels=has_names, ticks=False, domain=False, labelPadding=8, grid=has_lines, **labels)
    return alt.Y("solver:N", sort=list(solvers), title=None, axis=axis)
