"""Charts of a whole run: the time to accuracy over all problems, and how many problems each solver solves."""

from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from ...problems.spelling import for_command_line
from ..store.condition import run_state
from ..store.frames import RunFrames
from .drawing import FONT_SIZE, by_name, heading, round_values, stacked
from .palette import PALETTE, looks
from .tables import claims, common_problems, duration, mean_time, summary_accuracies, supported, time_to_accuracy
from .text import counted

WIDTH = 300
"""Of each of two panels side by side [pixels]."""

ROW = 26
"""Height of the row of a solver [pixels]."""

LONGEST_NAME = 300
"""Room for the names of solvers [pixels]."""

PALE, TEXT_TURNS = "#eef3f7", 0.55
"""The colour of none, and the share above which numbers on the colour are white."""


def summary_charts(frames: RunFrames) -> dict[str, alt.VConcatChart]:
    """Return the charts of a whole run by the names of their files; none if no solver supports anything."""
    cases = supported(frames)
    if cases.empty:
        return {}
    return {"summary-time": time_chart(frames), "summary-success": success_chart(frames)}


def time_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return the time to the accuracies of the summary, one row a solver: each problem, and their mean.

    The mean is the shifted geometric one over the problems that all solvers support, failures at the time limit.
    """
    cases = supported(frames)
    problems, means = _times(frames, cases)
    limit = frames.info.plan.limits.solve_seconds
    both = pd.concat([problems["milliseconds"], means["milliseconds"]]).dropna().to_numpy()
    if not len(both):
        both = np.array([1e3 * limit])
    domain = [float(0.7 * both.min()), float(1.4 * both.max())]
    accuracies = list(means["accuracy"].unique())
    panels = [
        _time_panel(frames, problems, means, accuracy, domain, first=k == 0) for k, accuracy in enumerate(accuracies)
    ]
    common = counted(len(common_problems(frames)), "problem")
    notes = [
        f"{counted(cases['problem'].nunique(), 'problem')}; large marks: shifted geometric mean over the {common} that "
        f"all these solvers support, failures at {duration(limit)}; right: how many of its own each solves",
        _unsupported(frames, cases),
        *map(for_command_line, run_state(frames)),
    ]
    title = heading("Time to accuracy", notes, len(panels) * WIDTH + 150)
    return stacked([alt.hconcat(*panels, spacing=40)], title, {"color": "shared"}, label=0)


def success_chart(frames: RunFrames) -> alt.VConcatChart:
    """Return how many problems each solver solves to each tolerance of the run: as the judge says, as itself says."""
    cases = supported(frames)
    counts = _counts(frames, cases)
    panels = [
        _count_panel(counts, "confirmed", "confirmed by the judge", "judged residual"),
        _count_panel(counts, "claimed", "claimed by the solver", "tolerance"),
    ]
    notes = [
        f"{counted(cases['problem'].nunique(), 'problem')}; how many of those that a solver supports it solves",
        _unsupported(frames, cases),
        *map(for_command_line, run_state(frames)),
    ]
    title = heading("Success", notes, 2 * WIDTH + 150)
    return stacked([alt.hconcat(*panels, spacing=40)], title, {"color": "shared"}, label=0)


def _unsupported(frames: RunFrames, cases: pd.DataFrame) -> str:
    """Name the solvers that support no problem of the run."""
    absent = [solver for solver in frames.info.plan.solvers if solver not in _solvers(frames, cases)]
    return f"not shown: {', '.join(absent)} (no supported problem)" if absent else ""


def _solvers(frames: RunFrames, cases: pd.DataFrame) -> list[str]:
    """Return the solvers that support a problem, in the order of the run."""
    return [solver for solver in frames.info.plan.solvers if (cases["solver"] == solver).any()]


def _of_cases(frames: RunFrames, cases: pd.DataFrame, solver: str) -> dict[str, pd.DataFrame]:
    """Return the points of a solver by problem."""
    mine = frames.points[frames.points["solver"] == solver]
    return {problem: mine[mine["problem"] == problem] for problem in cases[cases["solver"] == solver]["problem"]}


def _times(frames: RunFrames, cases: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return times to accuracy, one row a problem and solver, NaN if it is not reached; and their means."""
    limit = frames.info.plan.limits.solve_seconds
    common = set(common_problems(frames))
    problems: list[dict[str, Any]] = []
    means: list[dict[str, Any]] = []
    for solver in _solvers(frames, cases):
        of_cases = _of_cases(frames, cases, solver)
        for accuracy in summary_accuracies(frames):
            times = np.array([time_to_accuracy(points, accuracy) for points in of_cases.values()])
            row = {"solver": solver, "accuracy": accuracy}
            problems += [
                {**row, "problem": problem, "milliseconds": 1e3 * time}
                for problem, time in zip(of_cases, times, strict=True)
            ]
            reached = f"{np.isfinite(times).sum()} of {len(times)}"
            shared = np.array([time for problem, time in zip(of_cases, times, strict=True) if problem in common])
            means.append({**row, "milliseconds": 1e3 * mean_time(shared, limit), "reached": reached})
    return pd.DataFrame(problems), pd.DataFrame(means)


def _time_panel(
    frames: RunFrames, problems: pd.DataFrame, means: pd.DataFrame, accuracy: float, domain: list[float], first: bool
) -> alt.LayerChart:
    named = looks(frames.info.plan.solvers)
    colour = by_name(alt.Color, "solver", named, "colour")
    dots, mean = (frame[frame["accuracy"] == accuracy] for frame in (problems, means))
    rows = _rows(means["solver"].unique(), named=first, grid=True)
    across = (
        alt.X("milliseconds:Q", title="time, preparing included [ms]")
        .scale(type="log", domain=domain, nice=False)
        .axis(format="~g", values=round_values(domain))
    )
    tick = alt.Chart(dots[dots["milliseconds"].notna()]).mark_tick(thickness=1.5, height=10, opacity=0.75)
    mark = alt.Chart(mean[mean["milliseconds"].notna()]).mark_point(filled=True, size=95, opacity=1)
    text = alt.Chart(mean).mark_text(align="left", fontSize=FONT_SIZE, color="#444444", x=WIDTH + 5)
    layers = [
        tick.encode(x=across, y=rows, color=colour, tooltip=["solver", "problem", "milliseconds"]),
        mark.encode(x=across, y=rows, color=colour, shape=by_name(alt.Shape, "solver", named, "shape")),
        text.encode(y=rows, text="reached:N"),
    ]
    panel: alt.LayerChart = alt.LayerChart(
        layer=layers,
        width=WIDTH,
        height=alt.Step(ROW),
        title=alt.TitleParams(
            f"to a judged residual of {_exponent(accuracy)}", anchor="start", frame="group", fontSize=13
        ),
    )
    return panel


def _counts(frames: RunFrames, cases: pd.DataFrame) -> pd.DataFrame:
    """Return one row a solver and tolerance: how many problems it solves, as the judge and as itself says."""
    rows = []
    for solver in _solvers(frames, cases):
        of_cases = list(_of_cases(frames, cases, solver).values())
        for tolerance in sorted(frames.info.plan.tolerances, reverse=True):
            confirmed = sum(bool(np.isfinite(time_to_accuracy(points, tolerance))) for points in of_cases)
            claimed = sum(claims(points, tolerance) for points in of_cases)
            rows.append(
                {
                    "solver": solver,
                    "tolerance": _exponent(tolerance),
                    "confirmed": confirmed,
                    "claimed": claimed,
                    "all": f"of {len(of_cases)}",
                    "n": len(of_cases),
                }
            )
    return pd.DataFrame(rows)


def _exponent(tolerance: float) -> str:
    """Return a tolerance with the digits that it has: ``"1e-4"``, ``"2.5e-4"``."""
    return np.format_float_scientific(tolerance, precision=3, trim="-", exp_digits=1)


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
    ends = alt.Chart(cells.drop_duplicates("solver"))
    layers = [
        base.mark_rect(stroke="white", strokeWidth=2).encode(color=fill),
        base.mark_text(fontSize=FONT_SIZE).encode(text=f"{column}:Q", color=ink),
        ends.mark_text(align="left", fontSize=FONT_SIZE, color="#444444", x=WIDTH + 5).encode(y=rows, text="all:N"),
    ]
    panel: alt.LayerChart = alt.LayerChart(
        layer=layers,
        width=WIDTH,
        height=alt.Step(ROW),
        title=alt.TitleParams(title, anchor="start", frame="group", fontSize=13),
    )
    return panel


def _rows(solvers: Any, named: bool, grid: bool) -> alt.Y:
    """Return the rows of solvers in the order of the run, with or without their names and lines through them."""
    axis = alt.Axis(labels=named, ticks=False, domain=False, labelLimit=LONGEST_NAME, labelPadding=8, grid=grid)
    return alt.Y("solver:N", sort=list(solvers), title=None, axis=axis)
