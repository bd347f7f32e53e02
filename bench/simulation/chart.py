"""The chart of a simulation: what happens over time, one curve below the other, as SVG and PNG."""

from pathlib import Path
from typing import Any, Literal

import altair as alt
import numpy as np
import pandas as pd

from ..report.drawing import stacked, write_drawing
from ..report.palette import PALETTE
from .trajectory import Simulation

POINTS = 500
"""Intervals of time that curves are gathered in, so that charts of any length stay light."""

WIDTH, HEIGHT = 620, 105


def simulation_chart(simulation: Simulation) -> alt.VConcatChart:
    """Return balls through the outlet, active contacts, iterations, penetration and energy over simulated time.

    Balls that have left fall for ever: their kinetic and potential energy, which cancel, would hide the total.
    """
    curves = _curves(simulation)
    plan, scene = simulation.plan, simulation.plan.scene
    energies = {"energy": "total"}
    if scene.balls_through is None:
        energies |= {"potential_energy": "potential", "kinetic_energy": "kinetic"}
    panels = [
        _panel(curves, "contacts", {"contacts": "active contacts"}, steps=True),
        _panel(curves, "iterations", {"iterations": "mean", "most_iterations": "most"}, "sqrt", steps=True),
        _panel(curves, "depth / r", {"penetration": "of states", "impact_depth": "at midpoints"}),
        _panel(curves, "energy [J]", energies),
    ]
    if scene.balls_through is not None:
        panels.insert(0, _panel(curves, "balls through", {"balls_through": "through the outlet"}, steps=True))
    panels[-1].encoding.x.title = "simulated time [s]"
    panels[-1].encoding.x.axis = alt.Axis()
    balls = f", {scene.n_balls} balls" if scene.n_balls else ""
    tolerance, missed = np.format_float_scientific(plan.tolerance, trim="-", exp_digits=1), simulation.unsolved.sum()
    solver = plan.solver.name.partition("(")[0]
    title = alt.TitleParams(
        f"{scene.name.capitalize()}{balls}: what happens over time",
        subtitle=f"Δt {plan.step_size:g} s, steps solved to {tolerance}, {missed} missed, by {solver}",
        anchor="start",
        fontSize=16,
        subtitleFontSize=12,
    )
    return stacked(panels, title, {"color": "independent", "strokeDash": "independent", "x": "shared"}, label=44)


def write_chart(simulation: Simulation, path: Path) -> list[Path]:
    """Write the chart as ``path`` with .svg and with .png; return the files.

    Raises:
        BenchError: if they cannot be written.
    """
    return write_drawing(simulation_chart(simulation), path)


def _curves(simulation: Simulation) -> pd.DataFrame:
    """Gather steps in intervals: means of contacts and iterations, the largest penetration, the last of the rest."""
    steps = pd.DataFrame({name: simulation.steps[name] for name in simulation.steps.dtype.names or ()})
    steps["energy"] = steps["kinetic_energy"] + steps["potential_energy"]
    steps["most_iterations"] = steps["iterations"]
    length = max(1, -(-len(steps) // POINTS))
    last = ("time", "balls_through", "kinetic_energy", "potential_energy", "energy")
    how: dict[str, Any] = {name: "last" for name in last}
    how |= {"contacts": "mean", "iterations": "mean"}
    how |= {"most_iterations": "max", "penetration": "max", "impact_depth": "max"}
    gathered: pd.DataFrame = steps.groupby(np.arange(len(steps)) // length).agg(how)
    return gathered


def _panel(
    curves: pd.DataFrame,
    title: str,
    names: dict[str, str],
    scale: Literal["linear", "sqrt"] = "linear",
    steps: bool = False,
) -> alt.Chart:
    """Return one panel of curves, by column and what the legend calls it; in ``steps`` if values jump."""
    long = curves.melt("time", list(names), "column", "value")
    long["curve"] = long["column"].map(names)
    order = list(names.values())
    colours = alt.Scale(domain=order, range=[PALETTE[k] for k in (0, 3, 2)[: len(order)]])
    dashes = alt.Scale(domain=order, range=([1, 0], [5, 2], [2, 2])[: len(order)])
    panel: alt.Chart = (
        alt.Chart(long[["time", "value", "curve"]], width=WIDTH, height=HEIGHT)
        .mark_line(strokeWidth=1.5, interpolate="step-before" if steps else "linear")
        .encode(
            x=alt.X("time:Q", title=None).axis(labels=False, ticks=False).scale(nice=False),
            y=alt.Y("value:Q", title=title).scale(type=scale).axis(tickCount=4),
            color=alt.Color("curve:N", sort=order, scale=colours, title=None),
            strokeDash=alt.StrokeDash("curve:N", sort=order, scale=dashes, title=None),
        )
    )
    return panel
