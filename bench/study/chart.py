"""The work–precision diagram of a study: error against wall time and against one-step solves, as SVG and PNG."""

from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import altair as alt
import numpy as np
import pandas as pd

from ..report.drawing import stacked, write_drawing
from ..report.palette import looks
from .measuring import ERROR
from .plan import REFERENCE
from .running import points, reference, spreads
from .study import Study

WIDTH, HEIGHT = 330, 250

AXES = {
    "wall": alt.X("wall:Q", title="wall time [s]").axis(format="~g", labelOverlap=True, labelSeparation=5),
    "solves": alt.X("solves:Q", title="one-step solves").axis(format="~s", labelOverlap=True, labelSeparation=5),
    "tolerance": alt.X("tolerance:Q", title="tolerance of the solver").axis(
        format=".0e", labelOverlap=True, labelSeparation=5
    ),
}
"""What may stand on the horizontal axes."""

PARTS = {"steppers": "steppers, over step size or tolerance", "solvers": "solvers, over their tolerance"}

LEAST_SHARE = 0.05
"""A mean deviation that is smaller than this part of the upper end of its bar is noise, and drawn there."""


def study_chart(study: Study) -> alt.VConcatChart:
    """Return one row of panels for each part of the study, or for each aggregate of a pour."""
    frame = pd.DataFrame([asdict(point) for point in points(study)])
    for name in ("error", "low"):
        least = np.where(frame["quantity"] == ERROR, np.finfo(float).eps, LEAST_SHARE * frame["high"])
        frame[name] = np.maximum(frame[name], least)
    frame["rank"] = np.arange(len(frame))
    by_part = study.plan.scene == "woodpecker"
    column = "part" if by_part else "quantity"
    rows = [_row(frame[frame[column] == key], study, str(key), by_part) for key in frame[column].unique()]
    sharing: Literal["independent", "shared"] = "independent" if by_part else "shared"
    scales = {"color": sharing, "shape": sharing}
    return stacked(rows, _title(study), scales, spacing=18, labelLimit=300, symbolSize=70)


def write_study_chart(study: Study, path: Path) -> list[Path]:
    """Write the chart as ``path`` with .svg and with .png; return the files.

    Raises:
        BenchError: if they cannot be written.
    """
    return write_drawing(study_chart(study), path)


def _title(study: Study) -> alt.TitleParams:
    plan = study.plan
    if plan.scene == "woodpecker":
        text = "median over neighbouring step numbers or tolerances, bars from least to largest"
        subtitle = [f"Error after one period from the section, of the range of each coordinate: {text}"]
    else:
        seeds = len(reference(study))
        size = next(case.step_size for case in plan.cases if case.part == REFERENCE)
        subtitle = [
            f"{plan.options['balls']} balls, {plan.duration:g} s, {seeds} seeds: mean deviation from Δt {size:g} s;",
            "bars: its standard error; dashed: standard error over seeds of the reference itself",
        ]
    return alt.TitleParams(
        f"{plan.scene.capitalize()}: what accuracy costs", subtitle=subtitle, anchor="start", fontSize=16, offset=14
    )


def _row(frame: pd.DataFrame, study: Study, key: str, by_part: bool) -> alt.HConcatChart:
    series = list(frame["series"].unique())
    domain = [float(0.6 * frame["low"].min()), float(1.6 * frame["high"].max())]
    floor = spreads(study).get(key, (0.0, 0.0))[1]
    if floor:
        domain = [min(domain[0], 0.6 * floor), max(domain[1], 1.6 * floor)]
    title = f"error of {key}, relative" if not by_part else "error"
    # tolerances of solvers hardly change the number of solves
    works = ("wall", "tolerance") if by_part and key == "solvers" else ("wall", "solves")
    panels = [_panel(frame, work, title, domain, series, floor) for work in works]
    row: alt.HConcatChart = alt.hconcat(*panels, spacing=10)
    if by_part:
        row = row.properties(title=alt.TitleParams(PARTS[key], anchor="start", fontSize=12, fontWeight="normal"))
    return row


def _panel(
    frame: pd.DataFrame, work: str, title: str, domain: list[float], series: list[str], floor: float
) -> alt.LayerChart:
    drawn = looks(series).values()
    colours, shapes = [look.colour for look in drawn], [look.shape for look in drawn]
    colour = alt.Color("series:N", sort=series, scale=alt.Scale(domain=series, range=colours), title=None)
    shape = alt.Shape("series:N", sort=series, scale=alt.Scale(domain=series, range=shapes), title=None)
    shown = frame[["series", work, "error", "low", "high", "rank"]]
    scale: dict[str, Any] = {"type": "log", "nice": False, "domain": domain}
    spread = [float(0.8 * frame[work].min()), float(1.25 * frame[work].max())]
    base = alt.Chart(shown, width=WIDTH, height=HEIGHT).encode(
        x=AXES[work].scale(type="log", nice=False, domain=spread),
        y=alt.Y("error:Q", title=title).scale(**scale).axis(format=".0e", tickCount=6),
        color=colour,
    )
    bars = base.mark_rule(strokeWidth=1.0, opacity=0.55).encode(y=alt.Y("low:Q").scale(**scale), y2="high:Q")
    line = base.mark_line(strokeWidth=1.4).encode(order="rank:Q")
    dots = base.mark_point(filled=True, size=45, opacity=1.0).encode(shape=shape)
    layers = [bars, line, dots]
    if floor:
        rule = alt.Chart(pd.DataFrame({"floor": [floor]})).mark_rule(strokeDash=[5, 3], color="#666666")
        layers.append(rule.encode(y=alt.Y("floor:Q").scale(**scale)))
    panel: alt.LayerChart = alt.LayerChart(layer=layers)
    return panel
