"""How charts look and are written: panels one below the other, as SVG and PNG, drawn without a browser."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import altair as alt
import numpy as np
import pandas as pd
import vl_convert
from numpy.typing import NDArray

from ..layout.output_file import picture_files, write_file
from .palette import Look

PNG_SCALE = 2.0

Panel = alt.Chart | alt.LayerChart | alt.HConcatChart

KEY_ROW = 20
"""Height of one row of a key [pixels]."""


def write_drawing(chart: alt.TopLevelMixin, path: Path) -> list[Path]:
    """Write a chart as ``path`` with .svg and with .png; return the files.

    Raises:
        UnwritableError: if they cannot be written.
        BenchError: if one of them is a link out of its folder.
    """
    svg, png = picture_files(path)
    with alt.data_transformers.enable("default", max_rows=None):  # altair's limit is meant for pages that are sent
        drawn = vl_convert.vegalite_to_svg(chart.to_json())
    return [write_file(svg, drawn.encode()), write_file(png, vl_convert.svg_to_png(drawn, scale=PNG_SCALE))]


def compiled(chart: alt.TopLevelMixin) -> dict[str, Any]:
    """Return the Vega specification of a chart, which a page can draw without Vega-Lite."""
    specification: dict[str, Any] = vl_convert.vegalite_to_vega(chart.to_json())
    return specification


@cache
def drawing_script() -> str:
    """Return the script that draws Vega specifications in a page: it defines ``vegaEmbed`` and loads nothing."""
    script: str = vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;")
    return script


def stacked(
    panels: Sequence[Panel],
    title: alt.TitleParams,
    scales: Mapping[str, Literal["independent", "shared"]],
    spacing: int = 8,
    label: int = 52,
    **legend: Any,
) -> alt.VConcatChart:
    """Return panels one below the other.

    Args:
        panels: charts.
        title: of all of them.
        scales: whether the panels share them, by channel.
        spacing: between two panels [pixels].
        label: room left for the labels of vertical axes [pixels].
        legend: how the legend looks, beside its font.
    """
    chart: alt.VConcatChart = (
        alt.vconcat(*panels, spacing=spacing)
        .properties(title=title, background="white", padding=14)
        .configure_axis(labelFontSize=11, titleFontSize=12, titleFontWeight="normal", gridColor="#e8e8e8")
        .configure_axisY(minExtent=label)
        .configure_line(strokeJoin="round")  # pointed corners reach beyond the values
        .configure_view(stroke="#cccccc")
        .configure_legend(labelFontSize=11, title=None, **legend)
        .resolve_scale(**scales)
    )
    return chart


def heading(text: str, notes: Sequence[str], width: float, size: int = 16) -> alt.TitleParams:
    """Return a title with notes below it, each on lines of its own.

    Args:
        text: the title.
        notes: sentences or lists; empty ones are left out.
        width: that lines are wrapped to [pixels].
        size: of the title's font; notes are smaller.
    """
    characters = int(width / CHARACTER_WIDTH)
    lines = [line for note in notes for line in textwrap.wrap(note, characters)]
    return alt.TitleParams(
        text, subtitle=lines, anchor="start", fontSize=size, subtitleFontSize=FONT_SIZE + 1, offset=8
    )


def round_values(domain: Sequence[float]) -> list[float]:
    """Return where a logarithmic axis with the ends ``domain`` has ticks and labels: few enough to stand apart."""
    low, high = min(domain), max(domain)
    decades = np.log10(high / low)
    digits = (1, 2, 3, 5, 7) if decades < 1.2 else (1, 2, 5) if decades < 3.0 else (1, 3) if decades < 5.0 else (1,)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    values = [float(f"{digit}e{power}") for power in powers for digit in digits]
    return [value for value in values if low <= value <= high]


def log_axis(channel: Any, field: str, title: str, domain: Sequence[float]) -> Any:
    """Return an encoding of numbers on a logarithmic axis with the ends ``domain``."""
    return channel(f"{field}:Q", title=title).scale(type="log", domain=list(domain), nice=False)


def key(names: Mapping[str, Look], width: float) -> alt.LayerChart:
    """Return what colours, dashes and shapes stand for, as a panel: a line with a mark, and the name, in columns.

    Args:
        names: the look of each name, in their order.
        width: of the panel [pixels].
    """
    sample, gap = 34.0, 8.0
    longest = max(len(name) for name in names)
    columns = max(1, min(len(names), int(width / (sample + 3.0 * gap + CHARACTER_WIDTH * longest))))
    rows = -(-len(names) // columns)
    at = np.arange(len(names))
    left, middle = (at // rows) * width / columns, (at % rows + 0.5) * KEY_ROW
    frame = pd.DataFrame({"name": list(names), "left": left, "right": left + sample, "y": middle})
    frame["middle"], frame["text"] = left + sample / 2.0, left + sample + gap
    # two ends of a line, as rules draw dashes from their middle
    ends = pd.concat([frame.assign(x=frame["left"]), frame.assign(x=frame["right"])])
    across = alt.Scale(domain=[0.0, width], nice=False, zero=False)
    down = alt.Y("y:Q", axis=None).scale(domain=[rows * KEY_ROW, 0.0], nice=False, zero=False)
    colour = by_name(alt.Color, "name", names, "colour")
    line = alt.Chart(ends).mark_line(strokeWidth=2)
    dash, shape = by_name(alt.StrokeDash, "name", names, "dash"), by_name(alt.Shape, "name", names, "shape")
    line = line.encode(alt.X("x:Q", axis=None, scale=across), down, colour, dash)
    mark = alt.Chart(frame).mark_point(filled=True, size=60, opacity=1)
    mark = mark.encode(alt.X("middle:Q", axis=None, scale=across), down, colour, shape)
    text = alt.Chart(frame).mark_text(align="left", baseline="middle", fontSize=FONT_SIZE + 1, limit=0)
    text = text.encode(alt.X("text:Q", axis=None, scale=across), down, text="name:N")
    panel: alt.LayerChart = alt.LayerChart(
        layer=[line, mark, text], width=width, height=rows * KEY_ROW, view=alt.ViewBackground(stroke=None)
    )
    return panel


def by_name(channel: Any, field: str, names: Mapping[str, Look], part: Literal["colour", "shape", "dash"]) -> Any:
    """Return an encoding of ``field`` by one part of the looks of ``names``, without a legend."""
    scale = alt.Scale(domain=list(names), range=[getattr(one, part) for one in names.values()])
    return channel(f"{field}:N", scale=scale, sort=list(names), legend=None)


FONT_SIZE = 11
"""Of labels [pixels]."""

CHARACTER_WIDTH = 0.56 * FONT_SIZE
"""Mean width of a character of a sans serif [pixels], rather too large than too small."""

HEIGHT = 13.0
"""Of a label [pixels]."""

REACH = 7.0
"""From the end of a curve to its label [pixels]: a mark and a little room."""

CLEAR = 4.0
"""Room between a label and any curve [pixels], half the size of a mark."""

SPACING = 3.0
"""Distance of the points in which curves are looked at [pixels]."""

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Label:
    """Where the label of a curve stands.

    Attributes:
        x: its anchor [pixels].
        y: its middle [pixels].
        align: on which side of it the anchor is.
    """

    x: float
    y: float
    align: Literal["left", "center", "right"]


@dataclass(frozen=True)
class _Box:
    left: float
    top: float
    right: float
    bottom: float

    def gaps(self, points: Points) -> tuple[Points, Points]:
        """Return how far points are from the box across and up, each of shape (n,); 0 where they are level with it."""
        x, y = points.T
        across = np.maximum(0.0, np.maximum(self.left - x, x - self.right))
        return across, np.maximum(0.0, np.maximum(self.top - y, y - self.bottom))

    def overlaps(self, other: "_Box") -> bool:
        return not (
            self.right <= other.left or other.right <= self.left or self.bottom <= other.top or other.bottom <= self.top
        )


def placed_labels(curves: Mapping[str, Points], width: float, height: float, margin: float = 0.0) -> dict[str, Label]:
    """Return a label for each curve that has room for its name beside its end: it meets no curve and no other label.

    A curve that ends where another one does gets none, and no label is nearer to the end of another curve than to its
    own: nothing would say whose it is.

    Args:
        curves: points of each curve by its name, shape (n, 2), its end last [pixels].
        width: of the plot [pixels].
        height: of the plot [pixels]; a curve that ends above or below has left the plot and gets no label.
        margin: how far labels may stand out to the right of the plot [pixels].
    """
    ends = {name: points[-1] for name, points in curves.items()}
    drawn = np.concatenate([np.empty((0, 2)), *map(_sampled, curves.values())])
    taken: list[_Box] = []
    labels = {}
    for name, end in ends.items():
        if not (0.0 <= end[0] <= width and 0.0 <= end[1] <= height):
            continue
        others = np.array([other for label, other in ends.items() if label != name]).reshape(-1, 2)
        if (np.hypot(*(others - end).T) < REACH).any():
            continue
        for label in _candidates(float(end[0]), float(end[1])):
            box = _box(label, CHARACTER_WIDTH * len(name))
            inside = box.left >= 0.0 and box.right <= width + margin and box.top >= 0.0 and box.bottom <= height
            nearest = (np.hypot(*box.gaps(others)) > np.hypot(*box.gaps(end[None]))).all()
            clear = np.maximum(*box.gaps(drawn)) >= CLEAR
            if inside and nearest and clear.all() and not any(map(box.overlaps, taken)):
                labels[name] = label
                taken.append(box)
                break
    return labels


def _candidates(x: float, y: float) -> list[Label]:
    """Return where the label of a curve that ends at (x, y) may stand, the best place first."""
    step, above = HEIGHT / 2.0 + CLEAR + 1.0, REACH + HEIGHT / 2.0
    return [
        *(Label(x + REACH, y + shift, "left") for shift in (0.0, -step, step)),
        *(Label(x, y + shift, "center") for shift in (-above, above)),
        Label(x - REACH, y, "right"),
    ]


def _box(label: Label, length: float) -> _Box:
    left = label.x - {"left": 0.0, "center": length / 2.0, "right": length}[label.align]
    return _Box(left, label.y - HEIGHT / 2.0, left + length, label.y + HEIGHT / 2.0)


def _sampled(points: Points) -> Points:
    """Return points along a polyline, at most ``SPACING`` apart."""
    parts = [points[-1:]]
    for begin, end in pairwise(points):
        count = min(int(np.hypot(*(end - begin)) / SPACING) + 1, 10_000)
        parts.append(begin + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (end - begin))
    return np.concatenate(parts)
