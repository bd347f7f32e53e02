"""Vega specifications of the charts of a page, which inserts the data and the width."""

from collections.abc import Mapping
from typing import Any

import altair as alt

from .drawing import compiled
from .palette import SolverStyle
from .problems import convergence_panel, cost_panel
from .profiles import CURVES, ROW, profile_panel

ROWS = "rows"
"""Name of the data that the page inserts."""

WIDTH, HEIGHT = 480, 280
"""Size of a chart before the page adapts it [pixels]."""


def templates(styles: dict[str, SolverStyle], residual: str) -> dict[str, dict[str, Any]]:
    """Return the Vega specifications of a page by name: the profiles, and "cost" and "convergence" of a problem.

    The data of a profile have the columns of ``profile_tables``. The data of "cost" have the columns solver, tolerance,
    residual, milliseconds, low, high, iterations and outcome; those of "convergence" solver, iteration and residual.

    Args:
        styles: the style of each solver.
        residual: kind of residual, "judged" or "local".
    """
    rows = alt.NamedData(name=ROWS)
    panels: Mapping[str, Any] = {
        **{name: profile_panel(name, styles, rows).properties(height=HEIGHT) for name in CURVES},
        "speedup": profile_panel("speedup", styles, rows).properties(height=alt.Step(ROW)),
        "cost": cost_panel(styles, rows, f"{residual} residual", "milliseconds").properties(height=HEIGHT),
        "convergence": convergence_panel(styles, rows).properties(height=HEIGHT),
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
