"""Charts of a whole run: the time to accuracy over all problems, and how many problems each solver solves."""

from typing import Any

import altair as alt
import pandas as pd

from ...store.condition import run_state
from ...store.frames import RunFrames
from ..accuracy import accuracy_tag, attempts, families, families_table, mean_time, summary_accuracies
from ..cells import duration, exponent
from ..layout.text import counted
from .drawing import FONT_SIZE, by_name, heading, log_axis, round_values, stacked
from .palette import PALETTE, looks

WIDTH = 300
"""Of each of two panels side by side [pixels]."""

ROW = 26
"""Height of the row of a solver [pixels]."""

FAMILY_ROW, FAMILY_COLUMN = 36, 64
"""Size of the cell of a solver and a family [pixels]."""

LONGEST_NAME = 300
"""Room for the names of solvers [pixels]."""

PALE, TEXT_TURNS = "#eef3f7", 0.55
"""The colour of none, and the share above which numbers on the colour are white."""


def summary_charts(frames: RunFrames) -> dict[str, alt.VConcatChart]:
    """Return the charts of a whole run by the names of their files; none if no solver supports anything."""
    if attempts(frames, [1.0]).empty:
        return {}
    charts = {"summary-time": time_chart(frames), "summary-success": success_chart(frames)}
    return charts | ({"summary-families": families_chart(frames)} if families(frames) else {})


def time_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return the time to the accuracies of the summary, one row a solver: each problem, and their mean.

    The mean is the shifted geometric one over the problems that all solvers support, failures at the time limit.
    """
    limit = frames.info.plan.limits.solve_seconds
    tried = attempts(frames, summary_accuracies(frames))
    tried["milliseconds"] = 1e3 * tried["seconds"].where(~tried["excluded"])
    rows: list[dict[str, Any]] = []
    for (solver, accuracy), own in tried.groupby(["solver", "accuracy"], sort=False):
        mean = 1e3 * mean_time(own["seconds"][own["compared"]].to_numpy(), limit)
        reached = f"{own['seconds'].notna().sum()} of {len(own)}"
        rows.append({"solver": solver, "accuracy": accuracy, "milliseconds": mean, "reached": reached})
    means = pd.DataFrame(rows)
    both = pd.concat([tried["milliseconds"], means["milliseconds"]]).dropna().to_numpy()
    least, largest = (both.min(), both.max()) if len(both) else (1e3 * limit, 1e3 * limit)
    domain = [float(0.7 * least), float(1.4 * largest)]
    panels = [
        _time_panel(frames, tried, means, accuracy, domain, first=k == 0)
        for k, accuracy in enumerate(means["accuracy"].unique())
    ]
    common = counted(tried["problem"][tried["common"]].nunique(), "problem")
    note = (
        f"large marks: shifted geometric mean over the {common} that all these solvers support, "
        f"failures at {duration(limit)}; right: how many of its own each solves"
    )
    return _of_run("Time to accuracy", note, panels, frames, tried)


def success_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return how many problems each solver solves to each tolerance of the run: as the judge says, as itself says."""
    tried = attempts(frames, sorted(frames.info.plan.tolerances, reverse=True))
    tried["tolerance"] = tried["accuracy"].map(exponent)
    counts = tried.groupby(["solver", "tolerance"], sort=False).agg(
        confirmed=("seconds", "count"), claimed=("claimed", "sum"), n=("problem", "size")
    )
    counts = counts.reset_index().assign(all=[f"of {number}" for number in counts["n"]])
    panels = [
        _count_panel(counts, "confirmed", "confirmed by the judge", f"{frames.residual} residual"),
        _count_panel(counts, "claimed", "claimed by the solver", "tolerance"),
    ]
    return _of_run("Success", "how many of those that a solver supports it solves", panels, frames, tried)


def families_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return how much of each family every solver solves to the accuracies of the summary, and its mean time there."""
    shown, table = summary_accuracies(frames), families_table(frames)
    tried = attempts(frames, shown)
    panels: list[alt.LayerChart] = []
    for accuracy in shown:
        tag = accuracy_tag(accuracy)
        cells = table[["family", "solver"]].assign(
            share=table[f"correct_{tag}"],
            solved=[f"{round(s * n)}/{n}" for s, n in zip(table[f"correct_{tag}"], table["problems"], strict=True)],
            mean=table[f"mean_time_{tag}"].map(duration),
        )
        title = f"to a {frames.residual} residual of {exponent(accuracy)}"
        panels.append(_family_panel(frames, cells, title, first=not panels))
    note = "solved of those of a family that each supports (white: none); mean time over those that all support"
    return _of_run("Success by family", note, panels, frames, tried)


def _family_panel(frames: RunFrames, cells: pd.DataFrame, title: str, first: bool) -> alt.LayerChart:
    names, drawn = families(frames), set(cells["solver"])
    solvers = [solver for solver in frames.info.plan.solvers if solver in drawn]
    columns = alt.X("family:N", sort=names, title=None).axis(
        orient="top", labelAngle=-30, labelAlign="left", ticks=False, domain=False, grid=False, labelLimit=LONGEST_NAME
    )
    base = alt.Chart(cells).encode(x=columns, y=_rows(solvers, named=first, grid=False))
    fill = alt.Color("share:Q", legend=None).scale(domain=[0.0, 1.0], range=[PALE, PALETTE[0]])
    ink = alt.condition(alt.datum.share > TEXT_TURNS, alt.value("white"), alt.value("#222222"))
    layers = [base.mark_rect(stroke="white", strokeWidth=2).encode(color=fill)]
    layers += [
        base.mark_text(fontSize=size, dy=shift).encode(text=text, color=ink)
        for text, size, shift in (("solved:N", FONT_SIZE, -6), ("mean:N", FONT_SIZE - 2, 7))
    ]
    return _panel(layers, title, row=FAMILY_ROW, width=max(WIDTH, FAMILY_COLUMN * len(names)))


def _of_run(
    title: str, note: str, panels: list[alt.LayerChart], frames: RunFrames, tried: pd.DataFrame
) -> alt.VConcatChart:
    """Return panels side by side, under a note, the solvers that support no problem, and the state of the run."""
    absent = [solver for solver in frames.info.plan.solvers if solver not in set(tried["solver"])]
    notes = [
        f"{counted(tried['problem'].nunique(), 'problem')}; {note}",
        f"not shown: {', '.join(absent)} (no supported problem)" if absent else "",
        *run_state(frames),
    ]
    head = heading(title, notes, len(panels) * WIDTH + 150)
    return stacked([alt.hconcat(*panels, spacing=40)], head, {"color": "shared"}, label=0)


def _time_panel(
    frames: RunFrames, tried: pd.DataFrame, means: pd.DataFrame, accuracy: float, domain: list[float], first: bool
) -> alt.LayerChart:
    named = looks(frames.info.plan.solvers)
    colour = by_name(alt.Color, "solver", named, "colour")
    columns = ["solver", "accuracy", "problem", "milliseconds"]
    dots, mean = tried[tried["accuracy"] == accuracy][columns], means[means["accuracy"] == accuracy]
    rows = _rows(means["solver"].unique(), named=first, grid=True)
    across = log_axis(alt.X, "milliseconds", "time, preparation included [ms]", domain).axis(
        format="~g", values=round_values(domain)
    )
    tick = alt.Chart(dots.dropna()).mark_tick(thickness=1.5, height=10, opacity=0.75)
    mark = alt.Chart(mean.dropna()).mark_point(filled=True, size=95, opacity=1)
    layers = [
        tick.encode(x=across, y=rows, color=colour, tooltip=["solver", "problem", "milliseconds"]),
        mark.encode(x=across, y=rows, color=colour, shape=by_name(alt.Shape, "solver", named, "shape")),
        _behind(mean).encode(y=rows, text="reached:N"),
    ]
    return _panel(layers, f"to a {frames.residual} residual of {exponent(accuracy)}")


def _count_panel(counts: pd.DataFrame, column: str, title: str, across: str) -> alt.LayerChart:
    tolerances = list(counts["tolerance"].unique())
    cells = counts.assign(share=counts[column] / counts["n"])
    rows = _rows(counts["solver"].unique(), named=column == "confirmed", grid=False)
    columns = alt.X("tolerance:N", sort=tolerances, title=across).axis(
        orient="top", labelAngle=0, ticks=False, domain=False, grid=False
    )
    base = alt.Chart(cells).encode(x=columns, y=rows)
    fill = alt.Color("share:Q", legend=None).scale(domain=[0.0, 1.0], range=[PALE, PALETTE[0]])
    ink = alt.condition(alt.datum.share > TEXT_TURNS, alt.value("white"), alt.value("#222222"))
    layers = [
        base.mark_rect(stroke="white", strokeWidth=2).encode(color=fill),
        base.mark_text(fontSize=FONT_SIZE).encode(text=f"{column}:Q", color=ink),
        _behind(cells.drop_duplicates("solver")).encode(y=rows, text="all:N"),
    ]
    return _panel(layers, title)


def _behind(rows: pd.DataFrame) -> alt.Chart:
    """Return texts to the right of a panel."""
    text: alt.Chart = alt.Chart(rows).mark_text(align="left", fontSize=FONT_SIZE, color="#444444", x=WIDTH + 5)
    return text


def _panel(layers: list[alt.Chart], title: str, row: int = ROW, width: int = WIDTH) -> alt.LayerChart:
    head = alt.TitleParams(title, anchor="start", frame="group", fontSize=13)
    panel: alt.LayerChart = alt.LayerChart(layer=layers, width=width, height=alt.Step(row), title=head)
    return panel


def _rows(solvers: Any, named: bool, grid: bool) -> alt.Y:
    """Return the rows of solvers in the order of the run, with or without their names and lines through them."""
    axis = alt.Axis(labels=named, ticks=False, domain=False, labelLimit=LONGEST_NAME, labelPadding=8, grid=grid)
    return alt.Y("solver:N", sort=list(solvers), title=None, axis=axis)
