"""Layout and files of charts: stacked panels, written as SVG and PNG without a browser."""

import json
import math
import textwrap
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import altair as alt
import numpy as np
import pandas as pd
import vl_convert

from ..layout.output_file import picture_files, write_file
from .palette import SolverStyle

PNG_SCALE = 2.0
"""Pixels of a PNG file per unit of length of a chart."""

Panel = alt.Chart | alt.LayerChart | alt.HConcatChart
"""A part of a figure."""

FONT_SIZE = 11
"""Font size of small texts [pixels]."""

CHARACTER_WIDTH = 0.56 * FONT_SIZE
"""Estimated mean width of a character of a sans serif [pixels]."""

MAX_NAME_WIDTH = 300
"""Width above which names on axes are shortened [pixels]."""

SEPARATE_LEGENDS: dict[str, Literal["independent", "shared"]] = {
    "color": "independent",
    "shape": "independent",
    "strokeDash": "independent",
}
"""Scales with which each panel keeps its own legend, which combines colour, shape and dash."""

TIME_TITLE = "time, preparation included [ms]"
"""Title of axes of times to solve a problem."""

LEGEND_WIDTH = 150
"""Space for the legend to the right of a panel [pixels]."""

TIME_AXIS: dict[str, Any] = {"format": "~g", "tickCount": 6, "labelOverlap": True, "gridOpacity": 0.5}
"""Ticks of axes of times and counts."""

MAX_LEGEND_ROWS = 16
"""Largest number of names in one column of a legend."""


def write_drawing(chart: alt.TopLevelMixin, path: Path) -> list[Path]:
    """Write a chart as ``path`` with .svg and with .png; return the files.

    Raises:
        UnwritableError: if the files cannot be written.
        BenchError: if one of the files is a link out of its folder.
    """
    svg, png = picture_files(path)
    with alt.data_transformers.enable("default", max_rows=None):  # altair limits the rows for web pages
        svg_text = vl_convert.vegalite_to_svg(chart.to_json(validate=False))
    return [write_file(svg, svg_text.encode()), write_file(png, vl_convert.svg_to_png(svg_text, scale=PNG_SCALE))]


def compiled(chart: alt.TopLevelMixin) -> dict[str, Any]:
    """Return the Vega specification of a chart, which a page draws without Vega-Lite."""
    specification: dict[str, Any] = vl_convert.vegalite_to_vega(chart.to_json(validate=False))
    return specification


def stacked(
    panels: Sequence[Panel],
    title: alt.TitleParams,
    scales: Mapping[str, Literal["independent", "shared"]],
    spacing: int = 8,
    label_width: int = 52,
) -> alt.VConcatChart:
    """Return stacked panels.

    Args:
        panels: the panels.
        title: title of the chart.
        scales: "shared" or "independent" scales of the panels, by channel.
        spacing: distance between two panels [pixels].
        label_width: width of the labels of vertical axes [pixels].
    """
    config = alt.Config(
        axis=alt.AxisConfig(labelFontSize=11, titleFontSize=12, titleFontWeight="normal", gridColor="#e8e8e8"),
        axisY=alt.AxisConfig(minExtent=label_width),
        line=alt.LineConfig(strokeJoin="round"),  # pointed corners extend beyond the values
        view=alt.ViewConfig(stroke="#cccccc"),
        legend=alt.LegendConfig(labelFontSize=FONT_SIZE),
    )
    resolve = alt.Resolve(scale=alt.ScaleResolveMap(**scales))
    style: dict[str, Any] = {"title": title, "background": "white", "padding": 14, "config": config, "resolve": resolve}
    return alt.vconcat(*panels, spacing=spacing, **style)  # methods of a chart would copy all its rows each time


def side_by_side(panels: Sequence[Panel], spacing: int) -> alt.HConcatChart:
    """Return panels in a row, each with its own legend, if any."""
    row: alt.HConcatChart = alt.hconcat(*panels, spacing=spacing).resolve_scale(**SEPARATE_LEGENDS)
    return row


def heading(text: str, notes: Sequence[str], width: float, size: int = 16) -> alt.TitleParams:
    """Return a title with notes below it, each on its own lines.

    Args:
        text: the title.
        notes: sentences or lists; empty ones are omitted.
        width: width to which lines are wrapped [pixels].
        size: font size of the title; notes are smaller.
    """
    characters = int(width / CHARACTER_WIDTH)
    lines = [line for note in notes for line in textwrap.wrap(note, characters)]
    return alt.TitleParams(
        text, subtitle=lines, anchor="start", fontSize=size, subtitleFontSize=FONT_SIZE + 1, offset=8
    )


def log_scale(
    data: Any, columns: Sequence[str], other: float | None = None, reverse: bool = False, has_decades: bool = False
) -> alt.Scale:
    """Return a logarithmic scale slightly wider than the range of the values in ``columns`` and of ``other``.

    If the data are filled in later, the scale adapts to them. With ``has_decades`` it contains at least two powers of
    ten, for axes that have no other ticks.
    """
    if not isinstance(data, pd.DataFrame):
        return alt.Scale(type="log", nice=False, padding=8, reverse=reverse)
    values = [*data[list(columns)].min(), *data[list(columns)].max(), *([] if other is None else [other])]
    room = max((max(values) / min(values)) ** 0.03, 1.2)
    domain = [min(values) / room, max(values) * room]
    below, above = np.floor(np.log10(domain[0])), np.ceil(np.log10(domain[1]))
    if has_decades and above - below <= 2.0:  # otherwise two powers of ten are inside
        domain = [10.0**below, 10.0**above]
    return alt.Scale(type="log", nice=False, domain=domain, reverse=reverse)


def by_name(
    channel: Any,
    field: str,
    styles: Mapping[str, SolverStyle],
    style_property: Literal["colour", "shape", "dash"],
    legend: alt.Legend | None = None,
) -> Any:
    """Return an encoding of ``field`` by one property of the styles of solvers."""
    scale = alt.Scale(domain=list(styles), range=[getattr(style, style_property) for style in styles.values()])
    return channel(f"{field}:N", scale=scale, sort=list(styles), legend=legend)


def short_names(names: Iterable[str], width: float = MAX_NAME_WIDTH) -> dict[str, str]:
    """Return a label for each name; different names have different labels.

    A name that is wider than ``width`` [pixels] is shortened in the middle. If this gives several names the same label,
    these names are not shortened.
    """
    characters = int(width / CHARACTER_WIDTH)
    head = characters // 2
    labels = {
        name: name if len(name) <= characters else f"{name[:head]}…{name[len(name) - (characters - head - 1) :]}"
        for name in names
    }
    counts = Counter(labels.values())
    return {name: label if counts[label] == 1 else name for name, label in labels.items()}


def name_labels(names: Iterable[str]) -> dict[str, Any]:
    """Return the settings of an axis that shows names, by their ``short_names``."""
    shortened = {name: label for name, label in short_names(names).items() if label != name}
    rule = {"labelExpr": f"{json.dumps(shortened)}[datum.value] || datum.label"} if shortened else {}
    return {"labelLimit": 0, **rule}


def solver_legend(styles: Mapping[str, SolverStyle], shown: Iterable[str], has_marks: bool = True) -> alt.Legend:
    """Return a legend to the right of a panel, with the ``shown`` solvers in the order of ``styles``.

    The legend shows the marks of the panel, or the dashes of its lines if it has no marks.
    """
    shown_names = set(shown)
    values = [name for name in styles if name in shown_names]
    columns = math.ceil(len(values) / MAX_LEGEND_ROWS)
    return alt.Legend(
        title=None,
        orient="right",
        values=values,
        columns=columns,
        labelLimit=0,
        symbolStrokeWidth=0 if has_marks else 2,
    )
