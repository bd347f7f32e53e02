"""Charts that a page draws itself: Vega specifications whose rows the page fills in and whose width it chooses."""

from collections.abc import Mapping
from typing import Any

import altair as alt

from .drawing import by_name, compiled
from .palette import Look
from .problems import POWERS, RESIDUAL_AXIS, solve_marks
from .profiles import CURVES, ROW, profile_panel

ROWS = "rows"
"""Name of the data that the page fills in."""

WIDTH, HEIGHT = 480, 280
"""Of a chart before the page fits it [pixels]."""


def templates(named: dict[str, Look], residual: str) -> dict[str, dict[str, Any]]:
    """Return the charts of a page by name: those of profiles, "cost" and "convergence" of a problem.

    The rows of profiles have the columns of ``profile_tables``; those of "cost" solver, tolerance, residual,
    milliseconds, low, high, iterations and outcome; those of "convergence" solver, iteration and residual.

    Args:
        named: the look of each solver.
        residual: which residual that is, "judged" or "local".
    """
    rows = alt.NamedData(name=ROWS)
    panels: Mapping[str, Any] = {
        **{name: profile_panel(name, named, rows).properties(height=HEIGHT) for name in CURVES},
        "speedup": profile_panel("speedup", named, rows).properties(height=alt.Step(ROW)),
        "cost": _cost_panel(named, residual, rows).properties(height=HEIGHT),
        "convergence": _convergence_panel(named, rows).properties(height=HEIGHT),
    }
    fit = alt.AutoSizeParams(type="fit-x", contains="padding")
    return {
        name: compiled(
            panel.properties(width=WIDTH, autosize=fit, background="transparent", padding=4)
            .configure_axis(labelFontSize=11, titleFontSize=12, titleFontWeight="normal", gridColor="#e8e8e8")
            .configure_line(strokeJoin="round")
            .configure_view(stroke="#cccccc")
        )
        for name, panel in panels.items()
    }


def _cost_panel(named: dict[str, Look], residual: str, rows: Any) -> alt.LayerChart:
    """Return time over residual, as ``work_precision`` has it, of rows that come later."""
    title = "time, preparation included [ms] (better below)"
    across = alt.X("residual:Q", title=f"{residual} residual (better to the right)")
    up = alt.Y("milliseconds:Q", title=title).scale(type="log", nice=False, padding=8)
    base = alt.Chart(rows).encode(
        x=across.scale(type="log", nice=False, reverse=True, padding=8).axis(**RESIDUAL_AXIS),
        y=up.axis(format="~g", labelOverlap=True, tickCount=6),
        color=by_name(alt.Color, "solver", named, "colour"),
    )
    spread = base.mark_rule(strokeWidth=1).encode(y=alt.Y("low:Q", title=title), y2="high:Q")
    line = base.mark_line(strokeWidth=2).encode(
        strokeDash=by_name(alt.StrokeDash, "solver", named, "dash"), order="tolerance:Q"
    )
    return alt.LayerChart(layer=[spread, line, *solve_marks(base, named)])


def _convergence_panel(named: dict[str, Look], rows: Any) -> alt.LayerChart:
    """Return judged residual over iterations of rows that come later."""
    across = alt.X("iteration:Q", title="iteration").scale(type="log", nice=False)
    up = alt.Y("residual:Q", title="judged residual").scale(type="log", nice=False, padding=8)
    base = alt.Chart(rows).encode(
        x=across.axis(format="~s", labelOverlap=True, tickCount=6),
        y=up.axis(format=".0e", values=POWERS, labelOverlap=True),
        color=by_name(alt.Color, "solver", named, "colour"),
        tooltip="solver:N",
    )
    dash = by_name(alt.StrokeDash, "solver", named, "dash")
    return alt.LayerChart(layer=[base.mark_line(strokeWidth=1.8).encode(strokeDash=dash)])
