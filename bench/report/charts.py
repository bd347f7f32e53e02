"""Charts of a run's problems: what accuracy costs, and how the iterations converge, one file a problem."""

from pathlib import Path
from textwrap import shorten

import altair as alt
import numpy as np
import pandas as pd

from ...problems.spelling import for_command_line
from ..errors import BenchError
from ..store.condition import run_state
from ..store.frames import RunFrames
from ..store.outcome import Outcome
from ..store.store import plain_name
from .drawing import (
    FONT_SIZE,
    Label,
    Points,
    by_name,
    heading,
    key,
    placed_labels,
    round_values,
    stacked,
    write_drawing,
)
from .palette import Look, looks
from .summary_charts import summary_charts
from .tables import ending
from .text import counted

SMALLEST_RESIDUAL = 1e-16
"""Residuals of zero are drawn here: a logarithmic axis has no place for them."""

POWERS = [10.0**power for power in range(-16, 4)]
"""Where residual axes have ticks and grid lines."""

CROSS = "M-1,-1L1,1M-1,1L1,-1"
"""Two strokes, as an SVG path, for wrong claims."""

LARGEST_RESIDUAL = 1e3
"""Curves of diverging solvers leave the chart here, so that those of the others keep their shape."""

WIDTH, HEIGHT = 620, 330

MARGIN = 150
"""How far labels may stand out to the right of a panel [pixels]."""

MARKS = 3
"""Marks along a curve of iterations, each solver's at places of its own, so that curves that coincide are seen."""

LONGEST_REASON = 70
"""Characters of the reason why a solver is not shown; the tables have all of it."""

ANSWERED = (Outcome.SOLVED.value, Outcome.RELAXED.value)

_TIME_TITLE = "time, preparing included [ms] (better below)"


def write_charts(frames: RunFrames, folder: Path) -> list[Path]:
    """Write a chart of every problem that has anything to show, and those of the whole run, as SVG and PNG.

    Returns:
        The files.

    Raises:
        BenchError: if the folder cannot be written.
    """
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)  # it is named to users even if there is nothing to draw
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; choose another folder.") from None
    for problem in frames.cases["problem"].unique():
        if len(_drawable(frames.points, problem)) or len(_drawable(frames.iterations, problem)):
            files += write_drawing(problem_chart(frames, problem), folder / plain_name(problem))
    for name, chart in summary_charts(frames).items():
        files += write_drawing(chart, folder / name)
    return files


def problem_chart(frames: RunFrames, problem: str) -> alt.VConcatChart:
    """Return what accuracy costs on a problem above how the iterations converge, as far as there is anything to show.

    A solver has the same colour, shape and dashes in all charts of a run. Its name stands at the end of its curve where
    there is room; unless all do, a key below names all.
    """
    panels, named = [], []
    if len(points := _drawable(frames.points, problem)):
        panels.append(work_precision(frames, problem))
        named.append((set(points["solver"]), set(_work_labels(points))))
    if len(curves := _drawable(frames.iterations, problem)):
        panels.append(convergence(frames, problem))
        named.append((set(curves["solver"]), set(_convergence_labels(curves))))
    if any(labelled != shown for shown, labelled in named):
        shown = set().union(*(shown for shown, _ in named))
        panels.append(key({name: look for name, look in _looks(frames).items() if name in shown}, WIDTH + MARGIN))
    case = frames.cases[frames.cases["problem"] == problem].iloc[0]
    size = f"{counted(int(case['n_contacts']), 'contact')}, {counted(int(case['n_rows']), 'row')}"
    title = heading(problem, [size, *map(for_command_line, run_state(frames))], WIDTH + MARGIN)
    return stacked(panels, title, {"color": "independent"}, spacing=20)


def work_precision(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return median time over judged residual, one line a solver, accuracy growing to the right.

    The tolerance of a solve appears nowhere. A filled mark is a solve that ended solved, at its true residual;
    a hollow one is the best iterate of a solve that did not; a cross is a wrong claim.
    """
    points = _drawable(frames.points, problem)
    columns = ["solver", "tolerance", "residual", "milliseconds", "low", "high", "iterations", "outcome"]
    residuals, times = _work_domains(points)
    base = alt.Chart(points[columns], width=WIDTH, height=HEIGHT).encode(
        x=alt.X("residual:Q", title="judged residual (velocity error, relative; better to the right)")
        .scale(type="log", domain=residuals, nice=False)
        .axis(format=".0e", values=POWERS, labelOverlap=True),
        y=alt.Y("milliseconds:Q", title=_TIME_TITLE)
        .scale(type="log", domain=times, nice=False)
        .axis(format="~g", values=round_values(times)),
        color=by_name(alt.Color, "solver", _looks(frames), "colour"),
    )
    spread = base.mark_rule(strokeWidth=1).encode(y=alt.Y("low:Q", title=_TIME_TITLE), y2="high:Q")
    dash = by_name(alt.StrokeDash, "solver", _looks(frames), "dash")
    line = base.mark_line(strokeWidth=2).encode(strokeDash=dash, order="tolerance:Q")
    legend = "upright lines: quartiles; hollow: ended short of its tolerance; ×: wrong claim"
    notes = [legend, _absent(frames, problem)]
    layers = [spread, line, *_marks(base, frames), *_label_layer(_work_labels(points), frames)]
    return _panel(layers, "What accuracy costs", notes)


def convergence(frames: RunFrames, problem: str) -> alt.LayerChart:
    """Return the judged residual over iterations of the observed solves, one line a solver.

    Curves that grow beyond LARGEST_RESIDUAL leave the chart there.
    """
    curves = _drawable(frames.iterations, problem)
    iterations, residuals = _convergence_domains(curves)
    base = alt.Chart(curves[["solver", "iteration", "residual"]], width=WIDTH, height=HEIGHT).encode(
        x=alt.X("iteration:Q", title="iteration")
        .scale(type="log", domain=iterations, nice=False)
        .axis(format="~s", values=round_values(iterations)),
        y=alt.Y("residual:Q", title="judged residual (velocity error, relative)")
        .scale(type="log", domain=residuals, nice=False)
        .axis(format=".0e", values=POWERS, labelOverlap=True),
        color=by_name(alt.Color, "solver", _looks(frames), "colour"),
    )
    line = base.mark_line(strokeWidth=1.8, clip=True)
    line = line.encode(strokeDash=by_name(alt.StrokeDash, "solver", _looks(frames), "dash"))
    marks = base.mark_point(filled=True, size=45, opacity=1, clip=True)
    marks = marks.properties(data=_marked(curves)).encode(shape=by_name(alt.Shape, "solver", _looks(frames), "shape"))
    notes = [_absent(frames, problem, curves=True)]
    layers = [line, marks, *_label_layer(_convergence_labels(curves), frames)]
    return _panel(layers, "How the iterations converge", notes)


def _marks(base: alt.Chart, frames: RunFrames) -> list[alt.Chart]:
    """Marks of the solves by how they ended: filled, hollow, crossed."""
    shaped = base.encode(
        shape=by_name(alt.Shape, "solver", _looks(frames), "shape"),
        tooltip=["solver", "residual", "milliseconds", "iterations", "outcome"],
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
    return pd.concat(rows)[["solver", "iteration", "residual"]]


def _drawable(rows: pd.DataFrame, problem: str) -> pd.DataFrame:
    """Rows of a problem with a finite residual, which a logarithmic axis can show, with times in milliseconds."""
    chosen = rows[rows["problem"] == problem]
    residual = chosen["residual"].astype(float).clip(lower=SMALLEST_RESIDUAL)
    chosen = chosen.assign(residual=residual)[np.isfinite(residual)]
    if "iteration" in chosen:
        return chosen[chosen["iteration"] > 0]
    chosen = chosen[chosen["total_seconds"].notna()].sort_values("tolerance", ascending=False, kind="stable")
    for name, time in (("milliseconds", "total_seconds"), ("low", "total_seconds_q1"), ("high", "total_seconds_q3")):
        chosen[name] = 1e3 * chosen[time] if len(chosen) else []
    return chosen


def _work_domains(points: pd.DataFrame) -> tuple[list[float], list[float]]:
    residuals = _padded(points["residual"].min(), points["residual"].max())[::-1]
    return residuals, _padded(points["low"].min(), points["high"].max())


def _convergence_domains(curves: pd.DataFrame) -> tuple[list[float], list[float]]:
    largest = min(2.0 * float(curves["residual"].max()), LARGEST_RESIDUAL)
    smallest = min(float(curves["residual"].min()), LARGEST_RESIDUAL) / 2.0
    return [1.0, 1.05 * max(float(curves["iteration"].max()), 2.0)], [smallest, largest]


def _padded(low: float, high: float) -> list[float]:
    """Return the ends of a logarithmic axis with a little room beyond the values."""
    room = max((high / low) ** 0.03, 1.2)
    return [float(low) / room, float(high) * room]


def _work_labels(points: pd.DataFrame) -> dict[str, Label]:
    residuals, times = _work_domains(points)
    return _labels(points, "residual", residuals, "milliseconds", times)


def _convergence_labels(curves: pd.DataFrame) -> dict[str, Label]:
    iterations, residuals = _convergence_domains(curves)
    return _labels(curves, "iteration", iterations, "residual", residuals)


def _labels(rows: pd.DataFrame, x: str, across: list[float], y: str, up: list[float]) -> dict[str, Label]:
    """Place the names of solvers at the ends of their curves, as far as there is room."""
    curves: dict[str, Points] = {}
    for solver, curve in rows.groupby("solver", sort=False):
        columns = (_pixels(curve[x], across, WIDTH), HEIGHT - _pixels(curve[y], up, HEIGHT))
        curves[str(solver)] = np.column_stack(columns)
    return placed_labels(curves, WIDTH, HEIGHT, MARGIN)


def _pixels(values: "pd.Series[float]", domain: list[float], length: float) -> Points:
    """Return where a logarithmic axis has values [pixels]."""
    begin, end = np.log(domain)
    pixels: Points = length * (np.log(values.to_numpy(dtype=float)) - begin) / (end - begin)
    return pixels


def _label_layer(labels: dict[str, Label], frames: RunFrames) -> list[alt.Chart]:
    layers = []
    for align in sorted({label.align for label in labels.values()}):
        rows = [{"solver": name, "x": label.x, "y": label.y} for name, label in labels.items() if label.align == align]
        text = alt.Chart(pd.DataFrame(rows)).mark_text(align=align, baseline="middle", fontSize=FONT_SIZE)
        layers.append(
            text.encode(
                x=alt.X("x:Q", scale=None),
                y=alt.Y("y:Q", scale=None),
                text="solver:N",
                color=by_name(alt.Color, "solver", _looks(frames), "colour"),
            )
        )
    return layers


def _looks(frames: RunFrames) -> dict[str, Look]:
    return looks(frames.info.plan.solvers)


def _absent(frames: RunFrames, problem: str, curves: bool = False) -> str:
    """Say which solvers have no points on a problem, or no curve although they have points, and why."""
    points = _drawable(frames.points, problem)
    shown = set((_drawable(frames.iterations, problem) if curves else points)["solver"])
    reasons: dict[str, list[str]] = {}
    cases = frames.cases[frames.cases["problem"] == problem]
    for solver in frames.info.plan.solvers:
        if solver in shown:
            continue
        reason = "not measured yet"
        if solver in set(points["solver"]):
            reason = "no iterates"
        elif (cases["solver"] == solver).any():
            case = cases[cases["solver"] == solver].iloc[0].to_dict()
            mine = frames.points[(frames.points["problem"] == problem) & (frames.points["solver"] == solver)]
            reason = ": ".join(ending(case, mine[mine["total_seconds"].notna()]))
        reasons.setdefault(shorten(reason.rstrip("."), LONGEST_REASON, placeholder=" …"), []).append(solver)
    if not reasons:
        return ""
    return "not shown: " + "; ".join(f"{', '.join(names)} ({reason})" for reason, names in reasons.items())


def _panel(layers: list[alt.Chart], title: str, notes: list[str]) -> alt.LayerChart:
    panel: alt.LayerChart = alt.LayerChart(
        layer=layers, width=WIDTH, height=HEIGHT, title=heading(title, notes, WIDTH + MARGIN, 13)
    )
    return panel
