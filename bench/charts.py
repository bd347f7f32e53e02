"""Charts of a run: work–precision diagrams and convergence curves, as SVG and PNG, drawn without a browser."""

from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from .drawing import write_drawing
from .errors import BenchError
from .frames import RunFrames
from .outcome import Outcome
from .palette import PALETTE
from .store import plain_name

DASHES = ([1, 0], [6, 3], [2, 2], [8, 3, 2, 3])
SHAPES = ("circle", "square", "triangle-up", "diamond", "cross", "triangle-down")
SMALLEST_RESIDUAL = 1e-16
"""Residuals of zero are drawn here: a logarithmic axis has no place for them."""

POWERS = [10.0**power for power in range(-16, 4)]
"""Where residual axes have ticks and grid lines."""

CROSS = "M-1,-1L1,1M-1,1L1,-1"
"""Two strokes, as an SVG path, for wrong claims."""

LARGEST_RESIDUAL = 1e3
"""Curves of diverging solvers leave the chart here, so that those of the others keep their shape."""

_TIME_TITLE = "time to solve, preparing included [ms] (better below)"


def work_precision(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return median time over judged residual, one line a solver, accuracy growing to the right.

    The tolerance that was asked for appears nowhere. A filled mark is a solve that ended solved, at its true residual;
    a hollow one is the best iterate of a solve that did not; a cross is a wrong claim.
    """
    points = _drawable(frames.points[frames.points["total_seconds"].notna()], problem)
    points["milliseconds"] = 1e3 * points["total_seconds"]
    points["low"] = 1e3 * points["total_seconds_q1"]
    points["high"] = 1e3 * points["total_seconds_q3"]
    columns = ["solver", "tolerance", "residual", "milliseconds", "low", "high", "iterations", "outcome"]
    base = alt.Chart(points[columns]).encode(
        x=alt.X("residual:Q", title="judged residual (velocity error, relative; better to the right)")
        .scale(type="log", reverse=True, nice=False, padding=12)
        .axis(format=".0e", values=POWERS, labelOverlap=True),
        y=alt.Y("milliseconds:Q", title=_TIME_TITLE)
        .scale(type="log", nice=False, padding=12)
        .axis(format="~g", labelOverlap=True),
        color=_by_solver(alt.Color, PALETTE, frames, points),
    )
    spread = base.mark_rule(strokeWidth=1).encode(y=alt.Y("low:Q", title=_TIME_TITLE), y2="high:Q")
    line = base.mark_line(strokeWidth=2).encode(
        strokeDash=_by_solver(alt.StrokeDash, DASHES, frames, points), order="tolerance:Q"
    )
    title = _title(
        frames, problem, "what accuracy costs", "hollow: ended short of the tolerance asked for, ×: wrong claim"
    )
    chart = _styled([spread, line, *_marks(base, frames, points)], title)
    return _with_legend(chart, stroke=0)  # dashes would fray the symbols


def _marks(base: alt.Chart, frames: RunFrames, points: pd.DataFrame) -> list[alt.Chart]:
    """Marks of the solves by how they ended: filled, hollow, crossed."""
    shaped = base.encode(
        shape=_by_solver(alt.Shape, SHAPES, frames, points),
        tooltip=["solver", "residual", "milliseconds", "iterations", "outcome"],
    )
    answered = [Outcome.SOLVED.value, Outcome.RELAXED.value]
    ended = alt.FieldOneOfPredicate(field="outcome", oneOf=answered)
    open_ended = alt.FieldOneOfPredicate(
        field="outcome", oneOf=[outcome.value for outcome in Outcome if outcome.value not in answered]
    )
    filled = shaped.transform_filter(ended).mark_point(filled=True, size=60, opacity=1)
    hollow = shaped.transform_filter(open_ended).mark_point(fill="white", size=60, opacity=1, strokeWidth=1.8)
    wrong = (
        base.transform_filter(alt.datum.outcome == Outcome.WRONG.value)
        .mark_point(shape=CROSS, size=150, strokeWidth=2, opacity=1)
        .encode(color=alt.value("black"))
    )
    return [filled, hollow, wrong]


def convergence(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return the judged residual over iterations of the observed solves, one line a solver.

    Curves that grow beyond LARGEST_RESIDUAL leave the chart there.
    """
    curves = _drawable(frames.iterations, problem)
    largest = min(2.0 * curves["residual"].max(), LARGEST_RESIDUAL)
    smallest = min(curves["residual"].min(), LARGEST_RESIDUAL) / 2.0
    line = (
        alt.Chart(curves[["solver", "iteration", "residual"]])
        .mark_line(strokeWidth=1.8, clip=True)
        .encode(
            x=alt.X("iteration:Q", title="iteration")
            .scale(type="log", nice=False)
            .axis(format="~s", labelOverlap=True),
            y=alt.Y("residual:Q", title="judged residual (velocity error, relative)")
            .scale(type="log", nice=False, domain=[float(smallest), float(largest)])
            .axis(format=".0e", values=POWERS, labelOverlap=True),
            color=_by_solver(alt.Color, PALETTE, frames, curves),
            strokeDash=_by_solver(alt.StrokeDash, DASHES, frames, curves),
        )
    )
    chart = _styled([line], _title(frames, problem, "how the iterations converge"))
    return _with_legend(chart, stroke=2)


def write_charts(frames: RunFrames, folder: Path) -> list[Path]:
    """Write both charts of every problem as SVG and PNG, those that have anything to show; return the files.

    Raises:
        BenchError: if the folder cannot be written.
    """
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)  # it is named to users even if there is nothing to draw
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; choose another folder.") from None
    for problem in frames.cases["problem"].unique():
        charts = {}
        if len(_drawable(frames.points, problem)):
            charts["work-precision"] = work_precision(frames, problem)
        if len(_drawable(frames.iterations, problem)):
            charts["convergence"] = convergence(frames, problem)
        for kind, chart in charts.items():
            files += write_drawing(chart, folder / f"{plain_name(problem)}-{kind}")
    return files


def _drawable(rows: pd.DataFrame, problem: str) -> pd.DataFrame:
    """Rows of a problem with a finite residual, which a logarithmic axis can show."""
    chosen: pd.DataFrame = rows[rows["problem"] == problem]
    residual = chosen["residual"].astype(float).clip(lower=SMALLEST_RESIDUAL)
    return chosen.assign(residual=residual)[np.isfinite(residual)]


def _by_solver(channel: Any, values: tuple[Any, ...], frames: RunFrames, shown: pd.DataFrame) -> Any:
    """Encode solvers by ``values`` in the order of the run, the same in every chart; name those that are shown."""
    solvers = list(frames.info["plan"]["solvers"])
    scale = alt.Scale(domain=solvers, range=[values[index % len(values)] for index in range(len(solvers))])
    present = [solver for solver in solvers if (shown["solver"] == solver).any()]
    legend = alt.Legend(values=present)
    return channel("solver:N", title=None, sort=solvers, scale=scale, legend=legend)


def _title(frames: RunFrames, problem: str, text: str, *notes: str) -> alt.TitleParams:
    case: pd.Series[Any] = frames.cases[frames.cases["problem"] == problem].iloc[0]
    contacts = int(case["n_contacts"])
    size = f"{problem}: {contacts} contact{'s' if contacts != 1 else ''}, {int(case['n_rows'])} rows"
    subtitle = " · ".join((size, *notes))
    return alt.TitleParams(
        text[0].upper() + text[1:], subtitle=subtitle, anchor="start", fontSize=16, subtitleFontSize=13
    )


def _styled(layers: list[alt.Chart], title: alt.TitleParams) -> alt.LayerChart:
    styled: alt.LayerChart = (
        alt.LayerChart(layer=layers)
        .properties(width=620, height=400, title=title, background="white", padding=14)
        .configure_axis(labelFontSize=12, titleFontSize=13, titleFontWeight="normal", gridColor="#e8e8e8")
        .configure_view(stroke="#cccccc")
    )
    return styled


def _with_legend(chart: alt.LayerChart, stroke: float) -> alt.LayerChart:
    """Set the legend, whose symbols are outlined with a stroke of the given width."""
    finished: alt.LayerChart = chart.configure_legend(
        labelFontSize=12, labelLimit=360, symbolSize=110, symbolStrokeWidth=stroke, rowPadding=6
    )
    return finished
