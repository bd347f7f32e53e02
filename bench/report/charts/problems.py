"""Charts of a run's problems, one file a problem: what accuracy costs, and how the iterations converge.

Of a trajectory they show what accuracy costs in wall time and in one-step solves, for each quantity that has an error.
"""

from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from ...store.condition import run_state
from ...store.frames import RunFrames
from ...store.outcome import Outcome
from ...store.store import plain_name
from ..accuracy import measured_points
from ..layout.text import counted
from ..studies import headline, motion_warning, spreads
from ..tables import ending
from .drawing import (
    SEPARATE_LEGENDS,
    by_name,
    heading,
    log_axis,
    round_values,
    side_by_side,
    solver_legend,
    stacked,
    write_drawing,
)
from .palette import Look, looks
from .summary import summary_charts

MIN_RESIDUAL = 1e-16
"""Residuals of zero are drawn here: a logarithmic axis has no place for them."""

POWERS = [10.0**power for power in range(-16, 4)]
"""Where residual axes have ticks and grid lines."""

RESIDUAL_AXIS: dict[str, Any] = {"format": ".0e", "values": POWERS, "labelOverlap": True}

CROSS = "M-1,-1L1,1M-1,1L1,-1"
"""Two strokes, as an SVG path, for wrong claims."""

MAX_RESIDUAL = 1e3
"""Curves of diverging solvers leave the chart here, so that those of the others keep their shape."""

WIDTH, HEIGHT = 620, 330

MARGIN = 150
"""Room for the legend to the right of a panel [pixels]."""

MARKS = 3
"""Marks along a curve of iterations, each solver's at places of its own, so that curves that coincide are seen."""

MAX_REASON_LENGTH = 70
"""Characters of the reason why a solver is not shown; the tables have all of it."""

MIN_SHARE = 0.05
"""A mean deviation that is smaller than this part of the upper end of its bar is noise, and drawn there."""

WORKS = {"wall": "wall time [s]", "iterations": "one-step solves"}
"""What the errors of trajectories cost, by column."""

ANSWERED = (Outcome.SOLVED.value, Outcome.RELAXED.value)

_TIME_TITLE = "time, preparation included [ms] (better below)"


@dataclass(frozen=True)
class _Curves:
    """Rows of a chart of a problem, with the columns and ends of its two logarithmic axes."""

    rows: pd.DataFrame
    x: str
    y: str
    across: list[float]
    up: list[float]

    def panel(self, layers: list[alt.Chart], title: str, notes: list[str]) -> alt.LayerChart:
        """Return layers as a chart with a title and notes."""
        head = heading(title, notes, WIDTH + MARGIN, 13)
        panel: alt.LayerChart = alt.LayerChart(layer=layers, width=WIDTH, height=HEIGHT, title=head)
        return panel


def write_charts(frames: RunFrames, folder: Path) -> list[Path]:
    """Write a chart of every problem that has anything to show, and those of the whole run, as SVG and PNG.

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
    """Return whether a chart of a problem has anything to show."""
    costs = _drawable(frames.points, problem) if frames.is_study else _costs(frames, problem).rows
    return len(costs) > 0 or len(_iterations(frames, problem).rows) > 0


def trajectory_chart(frames: RunFrames, problem: str) -> alt.VConcatChart:
    """Return a row of panels for each quantity of a trajectory: wall time, and one-step solves, over the error.

    Bars go from the least to the largest error of a member, or are a standard error of the mean deviation; a dashed
    line is the standard error, over seeds, of the reference itself.
    """
    trajectory = frames.info.plan.trajectory(problem)
    points = frames.points[frames.points["problem"] == problem].merge(
        frames.errors, on=["problem", "solver", "tolerance"], suffixes=("", "_of")
    )
    least = np.maximum(MIN_SHARE * points["high"], MIN_RESIDUAL)
    shown = {name: np.maximum(points[own], least) for name, own in (("residual", "error"), ("low", "low"))}
    shown["high"] = np.maximum(points["high"], MIN_RESIDUAL)
    points = points.assign(wall=points["total_seconds"], **shown)
    floors = {quantity: floor for quantity, (_, floor) in spreads(trajectory).items() if floor > 0.0}
    rows: list[alt.HConcatChart] = []
    for quantity in points["quantity"].unique():
        of_one = points[points["quantity"] == quantity]
        name = "error" if len(points) == len(of_one) else f"error of {quantity}"
        in_legend = set() if rows else set(points["solver"])
        panels = [
            _cost_panel(frames, of_one, work, name, floors.get(quantity), in_legend if work == "iterations" else set())
            for work in WORKS
        ]
        rows.append(side_by_side(panels, spacing=40))
    state = run_state(frames)
    notes = [*state, _absent(frames, problem, points), motion_warning(trajectory)]
    title = heading(headline(frames.info.plan, problem), notes, 2 * WIDTH + MARGIN)
    return stacked(rows, title, SEPARATE_LEGENDS, spacing=20)


def _cost_panel(
    frames: RunFrames, points: pd.DataFrame, work: str, title: str, floor: float | None, in_legend: set[str]
) -> alt.LayerChart:
    """Return the cost over the error of a quantity, more accurate to the right."""
    named = _looks(frames)
    legend = solver_legend(named, in_legend) if in_legend else None
    ends = [points["low"].min(), points["high"].max(), *([] if floor is None else [floor])]
    errors, costs = _padded(min(ends), max(ends))[::-1], _padded(points[work].min(), points[work].max())
    columns = ["solver", "tolerance", "residual", "low", "high", "wall", "iterations", "outcome"]
    label = f"{title}, relative (better to the right)"
    across = alt.X("residual:Q", title=label).scale(type="log", domain=errors, nice=False)
    base = alt.Chart(points[columns], width=WIDTH, height=HEIGHT).encode(
        x=across.axis(format=".0e", values=POWERS, labelOverlap=True),
        y=alt.Y(f"{work}:Q", title=f"{WORKS[work]} (better below)")
        .scale(type="log", domain=costs, nice=False)
        .axis(format="~g", values=round_values(costs)),
        color=by_name(alt.Color, "solver", named, "colour", legend),
    )
    bars = base.mark_rule(strokeWidth=1, opacity=0.55).encode(x=alt.X("low:Q", title=label), x2="high:Q")
    dash = by_name(alt.StrokeDash, "solver", named, "dash", legend)
    layers = [
        bars,
        base.mark_line(strokeWidth=2).encode(strokeDash=dash, order="tolerance:Q"),
        *solve_marks(base, named, "wall", legend),
    ]
    if floor is not None:
        rule = alt.Chart(pd.DataFrame({"floor": [floor]})).mark_rule(strokeDash=[5, 3], color="#666666")
        layers.append(rule.encode(x=alt.X("floor:Q", title=label)))
    return alt.LayerChart(layer=layers, width=WIDTH, height=HEIGHT)


def problem_chart(frames: RunFrames, problem: str) -> alt.VConcatChart:
    """Return what accuracy costs on a problem above the convergence of its solvers, each if it has anything to show.

    A solver has the same colour, shape and dashes in all charts of a run.
    """
    panels = [
        draw(frames, problem)
        for curves, draw in ((_costs(frames, problem), work_precision), (_iterations(frames, problem), convergence))
        if len(curves.rows)
    ]
    case = frames.cases[frames.cases["problem"] == problem].iloc[0]
    size = f"{counted(int(case['n_contacts']), 'contact')}, {counted(int(case['n_rows']), 'row')}"
    title = heading(problem, [size, *run_state(frames)], WIDTH + MARGIN)
    return stacked(panels, title, SEPARATE_LEGENDS, spacing=20)


def work_precision(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return median time over the residual of the frames, one line for each solver, more accurate to the right.

    The tolerance of a solve appears nowhere. A filled mark is a solved solve at its judged residual; a hollow one is
    the best iterate of another solve; a cross is a wrong claim.
    """
    costs, named = _costs(frames, problem), _looks(frames)
    legend = solver_legend(named, costs.rows["solver"])
    columns = ["solver", "tolerance", "residual", "milliseconds", "low", "high", "iterations", "outcome"]
    residual = f"{frames.residual} residual (velocity error, relative; better to the right)"
    base = alt.Chart(costs.rows[columns], width=WIDTH, height=HEIGHT).encode(
        x=log_axis(alt.X, "residual", residual, costs.across).axis(**RESIDUAL_AXIS),
        y=log_axis(alt.Y, "milliseconds", _TIME_TITLE, costs.up).axis(format="~g", values=round_values(costs.up)),
        color=by_name(alt.Color, "solver", named, "colour", legend),
    )
    spread = base.mark_rule(strokeWidth=1).encode(y=alt.Y("low:Q", title=_TIME_TITLE), y2="high:Q")
    dash = by_name(alt.StrokeDash, "solver", named, "dash", legend)
    line = base.mark_line(strokeWidth=2).encode(strokeDash=dash, order="tolerance:Q")
    note = (
        "Each curve is a solver, each mark a solve: lower is faster, further to the right is more accurate. "
        "Vertical lines are quartiles, hollow marks stop short of their tolerance, × is a wrong claim."
    )
    layers = [spread, line, *solve_marks(base, named, legend=legend)]
    return costs.panel(layers, "What accuracy costs", [note, _absent(frames, problem, costs.rows)])


def convergence(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return the judged residual over iterations of the observed solves, one line a solver.

    Curves that grow beyond MAX_RESIDUAL leave the chart there.
    """
    curves, named = _iterations(frames, problem), _looks(frames)
    legend = solver_legend(named, curves.rows["solver"])
    columns = ["solver", "iteration", "residual"]
    values = round_values(curves.across)
    residual = "judged residual (velocity error, relative)"
    base = alt.Chart(curves.rows[columns], width=WIDTH, height=HEIGHT).encode(
        x=log_axis(alt.X, "iteration", "iteration", curves.across).axis(format="~s", values=values),
        y=log_axis(alt.Y, "residual", residual, curves.up).axis(**RESIDUAL_AXIS),
        color=by_name(alt.Color, "solver", named, "colour", legend),
    )
    line = base.mark_line(strokeWidth=1.8, clip=True)
    line = line.encode(strokeDash=by_name(alt.StrokeDash, "solver", named, "dash", legend))
    marks = base.mark_point(filled=True, size=45, opacity=1, clip=True).properties(data=_marked(curves.rows)[columns])
    marks = marks.encode(shape=by_name(alt.Shape, "solver", named, "shape", legend))
    note = "Each curve is a solver: the sooner it falls, the fewer iterations it needs."
    return curves.panel([line, marks], "Convergence", [note, _absent(frames, problem, curves.rows)])


def solve_marks(
    base: alt.Chart, named: dict[str, Look], time: str = "milliseconds", legend: alt.Legend | None = None
) -> list[alt.Chart]:
    """Return the marks of solves: filled if solved, hollow if not, crossed if the claim is wrong."""
    shaped = base.encode(
        shape=by_name(alt.Shape, "solver", named, "shape", legend),
        tooltip=["solver:N", "residual:Q", f"{time}:Q", "iterations:Q", "outcome:N"],
    )
    ended = alt.FieldOneOfPredicate(field="outcome", oneOf=list(ANSWERED))
    others = [outcome.value for outcome in Outcome if outcome.value not in ANSWERED]
    open_ended = alt.FieldOneOfPredicate(field="outcome", oneOf=others)
    filled = shaped.transform_filter(ended).mark_point(filled=True, size=60, opacity=1)
    hollow = shaped.transform_filter(open_ended).mark_point(fill="white", size=60, opacity=1, strokeWidth=1.8)
    wrong = (
        base.transform_filter(alt.datum.outcome == Outcome.WRONG.value)
        .mark_point(shape=CROSS, size=150, strokeWidth=2, opacity=1)
        .encode(color=alt.value("black"))
    )
    return [filled, hollow, wrong]


def _marked(curves: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of curves that get a mark: some apart on the logarithmic axis, and the ends."""
    rows = []
    of_solvers = curves.groupby("solver", sort=False)
    for rank, (_, curve) in enumerate(of_solvers):
        iterations = np.log(curve["iteration"].to_numpy(dtype=float))
        shares = (np.arange(MARKS) + (rank + 0.5) / of_solvers.ngroups) / MARKS
        at = np.searchsorted(iterations, iterations[0] + shares * (iterations[-1] - iterations[0]))
        rows.append(curve.iloc[np.unique(np.append(at, len(curve) - 1))])
    return pd.concat(rows)


def _costs(frames: RunFrames, problem: str) -> _Curves:
    """Return time [ms] with its quartiles over the residual."""
    points = _drawable(frames.points, problem)
    points = points[points["total_seconds"].notna()].sort_values("tolerance", ascending=False, kind="stable")
    times = {"milliseconds": "total_seconds", "low": "total_seconds_q1", "high": "total_seconds_q3"}
    points = points.assign(**{name: 1e3 * points[time] for name, time in times.items()})
    residuals = _padded(points["residual"].min(), points["residual"].max())[::-1]
    return _Curves(points, "residual", "milliseconds", residuals, _padded(points["low"].min(), points["high"].max()))


def _iterations(frames: RunFrames, problem: str) -> _Curves:
    """Return judged residual over iterations."""
    curves = _drawable(frames.iterations, problem)
    curves = curves[curves["iteration"] > 0]
    largest = min(2.0 * float(curves["residual"].max()), MAX_RESIDUAL)
    smallest = min(float(curves["residual"].min()), MAX_RESIDUAL) / 2.0
    last = max(float(curves["iteration"].max()), 2.0)
    # a little before the first one, whose mark would be cut
    return _Curves(curves, "iteration", "residual", [0.9, 1.05 * last], [smallest, largest])


def _drawable(rows: pd.DataFrame, problem: str) -> pd.DataFrame:
    """Return the rows of a problem with a finite residual, which a logarithmic axis can show."""
    chosen = rows[rows["problem"] == problem]
    residual = chosen["residual"].astype(float).clip(lower=MIN_RESIDUAL)
    drawable: pd.DataFrame = chosen.assign(residual=residual)[np.isfinite(residual)]
    return drawable


def _padded(low: float, high: float) -> list[float]:
    """Return the ends of a logarithmic axis with a little room beyond the values."""
    room = max((high / low) ** 0.03, 1.2)
    return [float(low) / room, float(high) * room]


def _looks(frames: RunFrames) -> dict[str, Look]:
    return looks(frames.info.plan.solvers)


def _absent(frames: RunFrames, problem: str, shown: pd.DataFrame) -> str:
    """Return which solvers have no points on a problem, or points and no curve, with the reasons."""
    with_points = set(_costs(frames, problem).rows["solver"])
    cases = frames.cases[frames.cases["problem"] == problem].set_index("solver", drop=False)
    reasons: dict[str, list[str]] = {}
    for solver in frames.info.plan.solvers:
        if solver in set(shown["solver"]):
            continue
        reason = "not measured yet"
        if solver in with_points:
            reason = "no iterates"
        elif solver in cases.index:
            case = cases.loc[solver].to_dict()
            reason = ": ".join(ending(case, measured_points(frames, case)))
        reasons.setdefault(shorten(reason.rstrip("."), MAX_REASON_LENGTH, placeholder=" …"), []).append(solver)
    if not reasons:
        return ""
    return "not shown: " + "; ".join(f"{', '.join(names)} ({reason})" for reason, names in reasons.items())
