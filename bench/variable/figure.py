"""The motion over time with its switching points as dots, and the step size below: figure 2 of the paper."""

from collections.abc import Mapping
from pathlib import Path

import altair as alt
import numpy as np
import pandas as pd
from scipy.interpolate import CubicHermiteSpline

from ...problems.laws import FloatArray
from ..drawing import stacked, write_drawing
from ..palette import PALETTE
from .incidents import incidents
from .simulation import VariableSimulation

WIDTH, HEIGHT = 620, 120

MOST_COORDINATES = 6
"""Coordinates that are drawn; a system of many bodies has too many to look at."""

POINTS_PER_STEP = 8
"""Points of a curve within one step."""


def motion_chart(simulation: VariableSimulation, begin: float = -np.inf) -> alt.VConcatChart:
    """Return the coordinates over time from ``begin`` [s] on, switching points as dots, and the step size below."""
    scene, plan = simulation.plan.scene, simulation.plan
    steps, trajectory = simulation.steps, simulation.trajectory
    shown = steps["time"] >= begin
    n_coordinates = len(scene.start.position)
    drawn = scene.coordinates or {f"q{k + 1}": k for k in range(min(n_coordinates, MOST_COORDINATES))}
    lengths = pd.DataFrame({"time": steps["time"][shown], "length": steps["length"][shown]})
    curves = _curves(lengths["time"].to_numpy(), trajectory[shown], n_coordinates, drawn)
    dots = _dots(simulation, begin, drawn)
    panels: list[alt.Chart | alt.LayerChart] = [_panel(curves, dots, name) for name in drawn]
    panels.append(_step_panel(lengths))
    title = alt.TitleParams(
        f"{scene.name.capitalize()}: motion, switching points and step size",
        subtitle=f"{plan.stepper.name}: {int(shown.sum())} steps, {int(steps['solves'][shown].sum())} one-step solves, "
        f"{dots['time'].nunique()} switching points",
        anchor="start",
        fontSize=16,
        subtitleFontSize=12,
    )
    return stacked(panels, title, {"x": "shared", "color": "shared"})


def write_motion_chart(simulation: VariableSimulation, path: Path, begin: float = -np.inf) -> list[Path]:
    """Write the chart as ``path`` with .svg and with .png; return the files.

    Raises:
        BenchError: if they cannot be written.
    """
    return write_drawing(motion_chart(simulation, begin), path)


def _curves(time: FloatArray, trajectory: FloatArray, n_coordinates: int, drawn: Mapping[str, int]) -> pd.DataFrame:
    """Return the coordinates over time; long steps are filled in by the cubics that have q and q̇ = u at their ends."""
    position, velocity = trajectory[:, :n_coordinates], trajectory[:, n_coordinates:]
    columns = list(drawn.values())
    if velocity.shape != position.shape or len(time) < 2:
        return pd.DataFrame(position[:, columns], columns=list(drawn)).assign(time=time)
    share = np.arange(POINTS_PER_STEP) / POINTS_PER_STEP
    dense = time[:-1, None] + np.diff(time)[:, None] * share
    all_times = np.append(dense.ravel(), time[-1])
    curves = CubicHermiteSpline(time, position[:, columns], velocity[:, columns])(all_times)
    return pd.DataFrame(curves, columns=list(drawn)).assign(time=all_times)


def _dots(simulation: VariableSimulation, begin: float, drawn: Mapping[str, int]) -> pd.DataFrame:
    """Return one row a switching point: its time, what switches, and the coordinates there."""
    found = [incident for incident in incidents(simulation) if incident.time >= begin]
    times = np.array([incident.time for incident in found])
    at = np.minimum(np.searchsorted(simulation.steps["time"], times), max(0, simulation.n_steps - 1))
    frame = pd.DataFrame(simulation.trajectory[at][:, list(drawn.values())], columns=list(drawn))
    frame["time"] = times
    frame["law"] = ["contact opens or closes" if one.law == "unilateral" else "slips or sticks" for one in found]
    return frame


def _panel(frame: pd.DataFrame, dots: pd.DataFrame, name: str) -> alt.LayerChart:
    curve = frame[["time", name]].rename(columns={name: "value"})
    points = dots[["time", "law", name]].rename(columns={name: "value"})
    y = alt.Y("value:Q", title=name).scale(zero=False)
    x = alt.X("time:Q", title=None).scale(nice=False)
    line = alt.Chart(curve, width=WIDTH, height=HEIGHT).mark_line(color="#4d4d4d", strokeWidth=1.4).encode(x=x, y=y)
    kinds = ["contact opens or closes", "slips or sticks"]
    colour = alt.Color("law:N", sort=kinds, scale=alt.Scale(domain=kinds, range=[PALETTE[3], PALETTE[0]]), title=None)
    layer: alt.LayerChart = line + alt.Chart(points).mark_circle(size=42, opacity=1.0).encode(x=x, y=y, color=colour)
    return layer


def _step_panel(frame: pd.DataFrame) -> alt.Chart:
    panel: alt.Chart = (
        alt.Chart(frame[["time", "length"]], width=WIDTH, height=HEIGHT)
        .mark_line(color=PALETTE[0], strokeWidth=1.0, interpolate="step-before", point=alt.OverlayMarkDef(size=8))
        .encode(
            x=alt.X("time:Q", title="time [s]").scale(nice=False),
            y=alt.Y("length:Q", title="step size [s]").scale(type="log", nice=False).axis(format=".0e", tickCount=6),
        )
    )
    return panel
