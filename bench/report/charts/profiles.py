"""Charts of performance, data, accuracy and speed-up profiles, for the folder of a run and for its page."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import altair as alt
import pandas as pd

from ...store.condition import chart_notes, excluded_points
from ...store.fields import exponent
from ...store.frames import RunFrames
from ..accuracy import summary_accuracies
from ..layout.output_file import write_file
from ..layout.text import counted, csv_content
from ..profiles import ALL, BUDGETS, COMMON, EVERY, RESIDUALS, other_threads_note, profile_accuracies, profile_tables
from .drawing import (
    FONT_SIZE,
    SEPARATE_LEGENDS,
    by_name,
    heading,
    name_labels,
    side_by_side,
    solver_legend,
    stacked,
    write_drawing,
)
from .palette import SolverStyle, solver_styles

WIDTH, HEIGHT = 300, 220
"""Size of a panel [pixels]."""

ROW = 24
"""Height of the row of a solver [pixels]."""

CURVES = ("performance", "data", "accuracy")
"""Kinds of profiles whose curves are shares of problems."""

SHARE = "share of problems"
"""Title of the axis of shares; a page replaces it by one that names the problems."""

_FAMILY_VIEWS = {
    COMMON: "over the problems of a family that all solvers support (without solvers that support none)",
    EVERY: "over all problems of a family; unsupported ones count as not solved",
}
"""Meaning of the shares of a family in each view."""

_TITLES = {
    "performance": "Performance profile",
    "data": "Data profile",
    "accuracy": "Accuracy profile",
    "speedup": "Speed-up",
}
"""Titles of charts by kind of profile."""

_NOTES = {
    "performance": "share of problems solved within a ratio to the least time of any solver shown; higher is better",
    "data": "share of problems solved within a time; dotted lines mark 1, 10 and 100 ms and 1 s",
    "accuracy": "share of problems solved to a residual of at most ε within the time limit",
    "speedup": "time of {} over that of the solver; ticks are problems that both solve, large marks geometric means",
}
"""Explanations of charts by kind of profile; that of speed-ups takes the baseline."""


def write_profiles(frames: RunFrames, baseline: str, folder: Path, view: str = COMMON) -> list[Path]:
    """Write the charts of all profiles as SVG and PNG, and their numbers as CSV; return the files.

    Args:
        frames: the run.
        baseline: reference solver of speed-ups.
        folder: output folder.
        view: view of the charts, one of ``VIEWS``; the numbers contain both.

    Raises:
        UnwritableError: if a file cannot be written.
        BenchError: if a link in the folder points outside.
    """
    tables = profile_tables(frames, baseline)
    files = []
    for name, chart in profile_charts(frames, tables, baseline, view).items():
        files += write_drawing(chart, folder / f"profile-{name}")
    for name, table in tables.items():
        files.append(write_file(folder / f"profile-{name}.csv", csv_content(table)))
    return files


def profile_charts(
    frames: RunFrames, tables: Mapping[str, pd.DataFrame], baseline: str, view: str = COMMON
) -> dict[str, alt.VConcatChart]:
    """Return the charts of profiles by name: one of each kind, and one of all ``CURVES`` by family.

    Args:
        frames: the run.
        tables: its ``profile_tables``.
        baseline: reference solver of speed-ups.
        view: one of ``VIEWS``; if no problem is common, the charts show all problems and the title says so.
    """
    shown = {name: _rows_of_view(table[table["family"] == ALL], view) for name, table in tables.items()}
    solvers = shown["accuracy"]["solver"].unique()
    charts = {}
    for name in (*CURVES, "speedup"):
        table, parts = shown[name], [(name, "", shown[name])]
        if "accuracy" in table:
            levels = [(level, table[table["accuracy"] == level]) for level in profile_accuracies(frames)]
            parts = [(name, f"to a {frames.residual} residual of {exponent(level)}", own) for level, own in levels]
        row = _row(frames, parts, set(table["solver"]))
        shares_note = [_shares_text(frames, shown["accuracy"], view, table["problems"])] if name in CURVES else []
        lines = [*shares_note, _NOTES[name].format(baseline)]
        notes = _with_threads_note(
            lines, name, other_threads_note(frames, solvers, baseline if name == "speedup" else "")
        )
        reason = _no_speedups_note(frames, levels, baseline) if name == "speedup" else ""
        charts[name] = _titled_chart(frames, _TITLES[name], notes, [row], len(parts), reason)
    families = [name for name in tables["accuracy"]["family"].unique() if name != ALL]
    return charts | ({"families": _families_chart(frames, tables, families, view)} if families else {})


def _families_chart(
    frames: RunFrames, tables: Mapping[str, pd.DataFrame], families: list[str], view: str
) -> alt.VConcatChart:
    """Return the three kinds of curves side by side, one row per family."""
    levels, level = profile_accuracies(frames), summary_accuracies(frames)[-1]
    level = level if level in levels else levels[-1]
    rows: list[alt.HConcatChart] = []
    for family in families:
        parts = []
        for name in CURVES:
            own = _rows_of_view(tables[name][tables[name]["family"] == family], view)
            own = own[own["accuracy"] == level] if "accuracy" in own else own
            level_text = f" to {exponent(level)}" if name != "accuracy" else ""
            parts.append((name, f"{family}: {_TITLES[name].split()[0].lower()}{level_text}", own))
        rows.append(_row(frames, parts, set() if rows else set(tables["accuracy"]["solver"])))
    notes = [_FAMILY_VIEWS[view], "; ".join(f"{name}: {_NOTES[name]}" for name in CURVES)]
    notes = _with_threads_note(notes, "performance", other_threads_note(frames, tables["accuracy"]["solver"].unique()))
    return _titled_chart(frames, "Profiles by family", notes, rows, len(CURVES))


def _with_threads_note(notes: list[str], name: str, threads_note: str) -> list[str]:
    """Return the notes of a chart; append ``threads_note``, if any, to those of performance profiles and speed-ups."""
    return (
        [*notes[:-1], f"{notes[-1]}; {threads_note}"] if threads_note and name in ("performance", "speedup") else notes
    )


def _row(frames: RunFrames, parts: list[tuple[str, str, pd.DataFrame]], in_legend: set[str]) -> alt.HConcatChart:
    """Return panels side by side, one per (kind, title, rows), with a legend at the last one."""
    styles = solver_styles(frames.info.plan.solvers)
    panels = [
        profile_panel(name, styles, rows, in_legend if index == len(parts) - 1 else ()).properties(
            width=WIDTH, height=alt.Step(ROW) if name == "speedup" else HEIGHT, title=title
        )
        for index, (name, title, rows) in enumerate(parts)
    ]
    return side_by_side(panels, spacing=30)


def _no_speedups_note(frames: RunFrames, levels: Sequence[tuple[float, pd.DataFrame]], baseline: str) -> str:
    """Return why there are no speed-ups at some accuracies; empty if there are some at all accuracies.

    Args:
        frames: the run.
        levels: the accuracies, each with its speed-ups.
        baseline: reference solver.
    """
    empty = [exponent(level) for level, rows in levels if rows.empty]
    if not empty:
        return ""
    where = f" to {', '.join(empty)}" if len(empty) < len(levels) else ""
    without = " without excluded times" if excluded_points(frames) else ""
    return f"no speed-ups{where}: no problem{without} is solved by both {baseline} and another solver"


def _rows_of_view(table: pd.DataFrame, view: str) -> pd.DataFrame:
    """Return the rows of a view, those of all problems if it has none, or all rows of a table without views."""
    if "view" not in table:
        return table
    rows = table[table["view"] == view]
    return rows if len(rows) else table[table["view"] == EVERY]


def _shares_text(frames: RunFrames, shown: pd.DataFrame, view: str, n_problems: "pd.Series[int]") -> str:
    """Return the meaning of the shares of a view, for a title.

    Args:
        frames: the run.
        shown: accuracy profiles of the view.
        view: one of ``VIEWS``.
        n_problems: number of problems of each row of the chart, from which problems with excluded times are omitted.
    """
    count, solvers = int(shown["problems"].iloc[0]), shown["solver"].nunique()
    all_problems = counted(frames.cases["problem"].nunique(), "problem")
    min_count = int(n_problems.min()) if len(n_problems) else 0
    fewer = f"; {min_count} of them without excluded times" if min_count < count else ""
    if (shown["view"] == COMMON).all():
        left_out = frames.cases["solver"].nunique() - solvers
        without = f"; without {counted(left_out, 'solver')} that support none" if left_out else ""
        return f"over the {count} of {all_problems} that all {solvers} solvers support{without}{fewer}"
    prefix = "no problem is supported by all solvers: " if view == COMMON else ""
    return f"{prefix}over all {all_problems}; unsupported ones count as not solved{fewer}"


def _titled_chart(
    frames: RunFrames, title: str, notes: list[str], rows: list[alt.HConcatChart], columns: int, reason: str = ""
) -> alt.VConcatChart:
    """Return rows of panels under a title, with the reason why some are empty, if any, and the state of the run."""
    width = max(columns * (WIDTH + 60), 620)
    problems = counted(frames.cases["problem"].nunique(), "problem")
    lines = notes if notes[1:] else [f"{problems}; {notes[0]}"]
    chart_title = heading(title, [*lines, reason, *chart_notes(frames)], width)
    return stacked(rows, chart_title, SEPARATE_LEGENDS, spacing=20)


def profile_panel(name: str, styles: Mapping[str, SolverStyle], data: Any, legend_of: Collection[str] = ()) -> Any:
    """Return the chart of one kind of profile.

    Args:
        name: "performance", "data", "accuracy" or "speedup".
        styles: the style of each solver.
        data: rows of ``profile_tables``, or altair data that are filled in later.
        legend_of: solvers in the legend to its right; speed-ups have no legend.
    """
    if name == "speedup":
        return _speedup_panel(styles, data)
    shares = f"share of {_problems_text(data)}" if isinstance(data, pd.DataFrame) else SHARE
    column, title, scale = {
        "performance": ("ratio", "time relative to the fastest solver", alt.Scale(type="log", nice=False)),
        "data": ("seconds", "time, preparation included [s]", alt.Scale(type="log", nice=False)),
        "accuracy": ("residual", "residual at most (finer to the right)", alt.Scale(type="log", reverse=True)),
    }[name]
    form = {"performance": "~g", "data": "~g", "accuracy": ".0e"}[name]
    legend = solver_legend(styles, legend_of, name == "accuracy") if legend_of else None
    across = alt.X(f"{column}:Q", title=title, scale=scale)
    ticks = {"values": list(RESIDUALS)} if name == "accuracy" else {"tickCount": 6}
    base = alt.Chart(data).encode(
        x=across.axis(format=form, labelOverlap=True, **ticks),
        y=alt.Y("share:Q", title=shares).scale(domain=[0.0, 1.0]).axis(format="%", tickCount=5),
        color=by_name(alt.Color, "solver", styles, "colour", legend),
        tooltip="solver:N",
    )
    steps: Literal["linear", "step-after"] = "linear" if name == "accuracy" else "step-after"
    dash = by_name(alt.StrokeDash, "solver", styles, "dash", legend)
    layers = [base.mark_line(strokeWidth=2, interpolate=steps).encode(strokeDash=dash)]
    if name == "accuracy":
        shape = by_name(alt.Shape, "solver", styles, "shape", legend)
        layers.append(base.mark_point(filled=True, size=40, opacity=1).encode(shape=shape))
    if name == "data":
        rules = alt.Chart(pd.DataFrame({"seconds": BUDGETS})).mark_rule(strokeDash=[2, 3], color="#777777")
        layers.append(rules.encode(x=alt.X("seconds:Q")))
    return alt.layer(*layers)


def _speedup_panel(styles: Mapping[str, SolverStyle], data: Any) -> alt.LayerChart:
    """Return ticks of problems and a mark at their geometric mean, one row per solver; a line marks equal times.

    Without speed-ups, the panel contains a sentence.
    """
    if isinstance(data, pd.DataFrame) and data.empty:
        sentence = pd.DataFrame({"sentence": ["no times to compare"]})
        text = alt.Chart(sentence).mark_text(fontSize=FONT_SIZE)
        return alt.LayerChart(layer=[text.encode(y=alt.Y("sentence:N", axis=None), text="sentence:N")])
    rows = alt.Y("solver:N", sort=list(styles), title=None)
    rows = rows.axis(ticks=False, domain=False, grid=True, **name_labels(styles))
    across = alt.X("speedup:Q", title="speed-up (faster to the right)").scale(type="log", nice=True)
    across = across.axis(format="~g", tickCount=6, labelOverlap=True)
    colour = by_name(alt.Color, "solver", styles, "colour")
    base = alt.Chart(data).encode(y=rows, color=colour)
    tick = base.mark_tick(thickness=1.5, height=10, opacity=0.7).encode(
        x=across, tooltip=["solver:N", "problem:N", "speedup:Q"]
    )
    mean = base.transform_calculate(exponent="log(datum.speedup)")
    mean = mean.transform_aggregate(exponent="mean(exponent)", groupby=["solver"])
    mean = mean.transform_calculate(speedup="exp(datum.exponent)").mark_point(filled=True, size=80, opacity=1)
    mean = mean.encode(x=across, shape=by_name(alt.Shape, "solver", styles, "shape"), tooltip=["solver:N", "speedup:Q"])
    equal_times = alt.Chart(pd.DataFrame({"speedup": [1.0]})).mark_rule(color="#777777").encode(x=alt.X("speedup:Q"))
    return alt.LayerChart(layer=[equal_times, tick, mean])


def _problems_text(rows: pd.DataFrame) -> str:
    """Return the number of problems that the shares count: ``"5 common problems"``, or "problems" without rows."""
    if rows.empty:
        return "problems"
    count, kind = int(rows["problems"].iloc[0]), "common " if (rows["view"] == COMMON).all() else ""
    return counted(count, f"{kind}problem")
