"""Charts of a run: work–precision diagrams and convergence curves, as SVG and PNG, drawn without a browser."""

from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd
import vl_convert

from .errors import BenchError
from .frames import RunFrames
from .outcome import Outcome
from .store import plain_name

PALETTE = ("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#7f7f7f", "#332288", "#999933", "#882255")
"""Colours that colour-blind readers can tell apart (Okabe & Ito, Tol), in the order of the solvers of the run."""

DASHES = ([1, 0], [6, 3], [2, 2], [8, 3, 2, 3])
SHAPES = ("circle", "square", "triangle-up", "diamond", "cross", "triangle-down")
SMALLEST_RESIDUAL = 1e-16
"""Residuals of zero are drawn here: a logarithmic axis has no place for them."""

POWERS = [10.0**power for power in range(-16, 4)]
"""Where residual axes have ticks and grid lines."""

PNG_SCALE = 2.0

_TIME_TITLE = "time to solve, preparing included [ms] (better below)"


def work_precision(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return median time over judged residual, one line a solver, accuracy growing to the right.

    The tolerance that was asked for appears nowhere; wrong claims are marked with a cross at their true residual.
    """
    points = frames.points[(frames.points["problem"] == problem) & frames.points["total_seconds"].notna()].copy()
    points["residual"] = points["residual"].astype(float).clip(lower=SMALLEST_RESIDUAL)
    points = points[np.isfinite(points["residual"])]
    points["milliseconds"] = 1e3 * points["total_seconds"]
    points["low"] = 1e3 * points["total_seconds_q1"]
    points["high"] = 1e3 * points["total_seconds_q3"]
    columns = ["solver", "tolerance", "residual", "milliseconds", "low", "high", "iterations", "outcome"]
    base = alt.Chart(points[columns]).encode(
        x=alt.X("residual:Q", title="judged residual (velocity error, relative; better to the right)")
        .scale(type="log", reverse=True, nice=False, padding=12)
        .axis(format=".0e", values=POWERS, labelOverlap=True),
        color=_colour(frames),
    )
    y = alt.Y("milliseconds:Q", title=_TIME_TITLE)
    y = y.scale(type="log", nice=False, padding=12).axis(format="~g", labelOverlap=True)
    line = base.mark_line(strokeWidth=2).encode(y=y, strokeDash=_dash(frames), order="tolerance:Q")
    marks = base.mark_point(filled=True, size=55, opacity=1).encode(
        y=y, shape=_shape(frames), tooltip=["solver", "residual", "milliseconds", "iterations", "outcome"]
    )
    wrong = (
        base.transform_filter(alt.datum.outcome == Outcome.WRONG.value)
        .mark_point(shape="cross", size=200, color="black", angle=45)
        .encode(y=y, color=alt.value("black"))
    )
    spread = base.mark_rule(strokeWidth=1).encode(y=alt.Y("low:Q", title=_TIME_TITLE), y2="high:Q")
    return _styled([spread, line, marks, wrong], _title(frames, problem, "what accuracy costs"))


def convergence(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return the judged residual over iterations of the observed solves, one line a solver."""
    curves = frames.iterations[frames.iterations["problem"] == problem].copy()
    curves = curves[np.isfinite(curves["residual"])]
    curves["residual"] = curves["residual"].clip(SMALLEST_RESIDUAL, 1e3)
    line = (
        alt.Chart(curves[["solver", "iteration", "residual"]])
        .mark_line(strokeWidth=1.8, clip=True)
        .encode(
            x=alt.X("iteration:Q", title="iteration")
            .scale(type="log", nice=False)
            .axis(format="~s", labelOverlap=True),
            y=alt.Y("residual:Q", title="judged residual (velocity error, relative)")
            .scale(type="log", nice=False)
            .axis(format=".0e", values=POWERS, labelOverlap=True),
            color=_colour(frames),
            strokeDash=_dash(frames),
        )
    )
    return _styled([line], _title(frames, problem, "how the iterations converge"))


def write_charts(frames: RunFrames, folder: Path) -> list[Path]:
    """Write both charts of every problem as SVG and PNG; return the files.

    Raises:
        BenchError: if the folder cannot be written.
    """
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for problem in frames.cases["problem"].unique():
            charts = {}
            if (frames.points["problem"] == problem).any():
                charts["work-precision"] = work_precision(frames, problem)
            if (frames.iterations["problem"] == problem).any():
                charts["convergence"] = convergence(frames, problem)
            for kind, chart in charts.items():
                specification = chart.to_json()
                svg, png = (folder / f"{plain_name(problem)}-{kind}.{suffix}" for suffix in ("svg", "png"))
                drawn = vl_convert.vegalite_to_svg(specification)
                svg.write_text(drawn, encoding="utf-8")
                png.write_bytes(vl_convert.svg_to_png(drawn, scale=PNG_SCALE))
                files += [svg, png]
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; choose another folder.") from None
    return files


def _domain(frames: RunFrames) -> list[str]:
    return list(frames.info["plan"]["solvers"])


def _cycled(values: Any, frames: RunFrames) -> list[Any]:
    return [values[index % len(values)] for index in range(len(_domain(frames)))]


def _colour(frames: RunFrames) -> alt.Color:
    return alt.Color("solver:N", title=None, sort=_domain(frames)).scale(
        domain=_domain(frames), range=_cycled(PALETTE, frames)
    )


def _dash(frames: RunFrames) -> alt.StrokeDash:
    return alt.StrokeDash("solver:N", title=None, sort=_domain(frames)).scale(
        domain=_domain(frames), range=_cycled(DASHES, frames)
    )


def _shape(frames: RunFrames) -> alt.Shape:
    return alt.Shape("solver:N", title=None, sort=_domain(frames)).scale(
        domain=_domain(frames), range=_cycled(SHAPES, frames)
    )


def _title(frames: RunFrames, problem: str, text: str) -> alt.TitleParams:
    case: pd.Series[Any] = frames.cases[frames.cases["problem"] == problem].iloc[0]
    contacts = int(case["n_contacts"])
    subtitle = f"{problem}: {contacts} contact{'s' if contacts != 1 else ''}, {int(case['n_rows'])} rows"
    return alt.TitleParams(
        text[0].upper() + text[1:], subtitle=subtitle, anchor="start", fontSize=16, subtitleFontSize=13
    )


def _styled(layers: list[alt.Chart], title: alt.TitleParams) -> alt.LayerChart:
    styled: alt.LayerChart = (
        alt.LayerChart(layer=layers)
        .properties(width=620, height=400, title=title, background="white", padding=14)
        .configure_axis(labelFontSize=12, titleFontSize=13, titleFontWeight="normal", gridColor="#e8e8e8")
        .configure_legend(labelFontSize=12, labelLimit=360, symbolSize=110, symbolStrokeWidth=2, rowPadding=6)
        .configure_view(stroke="#cccccc")
    )
    return styled
