"""The motion over time with its switching points, and the step size below: figure 2 of the paper.

Coordinates that have names are drawn with switching points as dots. Where they have none, as those of many balls, no
few of them say what happens: energies are drawn, and how many switching points there are.
"""

from collections.abc import Mapping
from pathlib import Path

import altair as alt
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ...problems.arrays import FloatArray
from ..report.drawing import stacked, write_drawing
from ..report.palette import PALETTE
from ..report.text import counted
from .incidents import Incident, incidents, switching_words
from .simulation import VariableSimulation

WIDTH, HEIGHT = 620, 120

POINTS_PER_STEP = 8
"""Points of a curve within one step."""

BINS = 100
"""Parts of the time in which switching points are counted."""

ENERGIES = {"kinetic_energy": "kinetic energy [J]", "potential_energy": "potential energy [J]"}

NOISE = 1e-6
"""Range of a curve, relative to its largest value, below which it is a straight line and what it does is rounding."""

KINDS = {"unilateral": "contact opens or closes", "friction": "slips or sticks"}
"""What switching points are called, by law."""


def motion_chart(simulation: VariableSimulation, begin: float = -np.inf) -> alt.VConcatChart:
    """Return the motion over time from ``begin`` [s] on with its switching points, and the step size below."""
    scene, plan = simulation.plan.scene, simulation.plan
    steps = simulation.steps
    shown = steps["time"] >= begin
    found = [incident for incident in incidents(simulation) if incident.time >= begin]
    time = steps["time"][shown]
    if scene.coordinates:
        panels = _coordinate_panels(simulation, begin, found)
    else:
        panels = [_line(pd.DataFrame({"time": time, "value": steps[name][shown]}), ENERGIES[name]) for name in ENERGIES]
        panels.append(_count_panel(found, steps[shown]))
    panels.append(_step_panel(pd.DataFrame({"time": time, "length": steps["length"][shown]})))
    part = "" if shown.all() else f"from {begin:.4g} s on: "
    title = alt.TitleParams(
        f"{scene.name.capitalize()}: motion, switching points and step size",
        subtitle=f"{plan.stepper.name}, {part}{counted(int(shown.sum()), 'step')}, "
        f"{counted(int(steps['solves'][shown].sum()), 'one-step solve')}, {switching_words(found)}",
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


def _coordinate_panels(
    simulation: VariableSimulation, begin: float, found: list[Incident]
) -> list[alt.Chart | alt.LayerChart]:
    """Return a panel for each coordinate with a name, switching points as dots."""
    drawn = simulation.plan.scene.coordinates
    times = simulation.times
    shown = times >= begin
    curves = _curves(times[shown], simulation.trajectory[shown], simulation, drawn)
    dots = _dots(simulation, found, drawn)
    return [_panel(curves, dots, name) for name in drawn]


def _curves(
    time: FloatArray, trajectory: FloatArray, simulation: VariableSimulation, drawn: Mapping[str, int]
) -> pd.DataFrame:
    """Return the coordinates over time; long steps are filled in by the cubics that have q and q̇ = u at their ends."""
    position, velocity = np.split(trajectory, [len(simulation.plan.scene.start.position)], axis=1)
    columns = list(drawn.values())
    if velocity.shape != position.shape or len(time) < 2:
        return pd.DataFrame(position[:, columns], columns=list(drawn)).assign(time=time)
    share = np.arange(POINTS_PER_STEP) / POINTS_PER_STEP
    dense = time[:-1, None] + np.diff(time)[:, None] * share
    all_times = np.append(dense.ravel(), time[-1])
    curves = CubicHermiteSpline(time, position[:, columns], velocity[:, columns])(all_times)
    return pd.DataFrame(curves, columns=list(drawn)).assign(time=all_times)


def _dots(simulation: VariableSimulation, found: list[Incident], drawn: Mapping[str, int]) -> pd.DataFrame:
    """Return one row a switching point: its time, what switches, and the coordinates there."""
    times = np.array([incident.time for incident in found])
    at = np.searchsorted(simulation.times, times)
    frame = pd.DataFrame(simulation.trajectory[at][:, list(drawn.values())], columns=list(drawn))
    frame["time"] = times
    frame["law"] = [KINDS[incident.law] for incident in found]
    return frame


def _panel(frame: pd.DataFrame, dots: pd.DataFrame, name: str) -> alt.LayerChart:
    curve = frame[["time", name]].rename(columns={name: "value"})
    points = dots[["time", "law", name]].rename(columns={name: "value"})
    line = _line(curve, name)
    marks = alt.Chart(points).mark_circle(size=42, opacity=1.0).encode(x=_time(), y=line.encoding.y, color=_colour())
    layer: alt.LayerChart = line + marks
    return layer


def _line(curve: pd.DataFrame, title: str) -> alt.Chart:
    """Return the curve of "value" over "time"."""
    scale = alt.Scale(zero=False)
    low, high = curve["value"].min(), curve["value"].max()
    size = max(abs(low), abs(high))
    if high - low <= NOISE * size:  # an axis of that range would show rounding
        middle, room = 0.5 * (low + high), 0.05 * size or 1.0
        scale = alt.Scale(zero=False, domain=[middle - room, middle + room])
    panel: alt.Chart = (
        alt.Chart(curve, width=WIDTH, height=HEIGHT)
        .mark_line(color="#4d4d4d", strokeWidth=1.4)
        .encode(x=_time(), y=alt.Y("value:Q", title=title, scale=scale))
    )
    return panel


def _count_panel(found: list[Incident], steps: NDArray[np.void]) -> alt.Chart:
    """Return how many switching points there are in each part of the time, as bars."""
    borders = np.linspace(steps["time"][0] - steps["length"][0], steps["time"][-1], BINS + 1)
    rows = []
    for law, kind in KINDS.items():
        times = np.array([incident.time for incident in found if incident.law == law])
        counts, _ = np.histogram(np.clip(times, borders[0], borders[-1]), borders)
        rows.append(pd.DataFrame({"time": borders[:-1], "end": borders[1:], "count": counts, "law": kind}))
    frame = pd.concat(rows)
    axis = alt.Y("count:Q", title=["switching points", f"per {borders[1] - borders[0]:.2g} s"]).axis(
        format="d", tickMinStep=1
    )
    panel: alt.Chart = (
        alt.Chart(frame[frame["count"] > 0], width=WIDTH, height=HEIGHT)
        .mark_bar()
        .encode(
            x=alt.X("time:Q", title=None).bin("binned").scale(nice=False),
            x2="end:Q",
            y=axis.scale(domainMin=0, domainMax=max(1, int(frame.groupby("time")["count"].sum().max()))),
            color=_colour(),
        )
    )
    return panel


def _time() -> alt.X:
    return alt.X("time:Q", title=None).scale(nice=False)


def _colour() -> alt.Color:
    kinds = list(KINDS.values())
    return alt.Color("law:N", sort=kinds, scale=alt.Scale(domain=kinds, range=[PALETTE[3], PALETTE[0]]), title=None)


def _step_panel(frame: pd.DataFrame) -> alt.Chart:
    panel: alt.Chart = (
        alt.Chart(frame, width=WIDTH, height=HEIGHT)
        .mark_line(color=PALETTE[0], strokeWidth=1.0, interpolate="step-before", point=alt.OverlayMarkDef(size=8))
        .encode(
            x=alt.X("time:Q", title="time [s]").scale(nice=False),
            y=alt.Y("length:Q", title="step size [s]").scale(type="log", nice=False).axis(format=".0e", tickCount=6),
        )
    )
    return panel
