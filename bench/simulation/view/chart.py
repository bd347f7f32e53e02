"""The chart of a simulation, as SVG and PNG: the motion with its switching points, its cost, and its step size.

Named coordinates are drawn over the last half second, with switching points as dots (Studer & Glocker 2005, figure 2).
For scenes without named coordinates, such as many balls, the chart shows contacts, iterations, penetration and energy
over the whole time, with counts of switching points.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import altair as alt
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ....problems.arrays import FloatArray
from ....problems.motion.trajectories.limit_cycle import SwitchEvent
from ...report.charts.drawing import LEGEND_WIDTH, heading, stacked, write_drawing
from ...report.charts.palette import PALETTE
from ...report.layout.text import counted
from ...store.fields import exponent
from ..history import Segment, planned_segment
from ..simulation import Simulation, describe_switches

POINTS = 500
"""Largest number of intervals over which curves are aggregated, to limit the size of charts."""

WIDTH, HEIGHT = 620, 110
"""Size of a panel [pixels]."""

SHOWN_SECONDS = 0.5
"""Simulated time before the end over which coordinates are drawn [s]: some periods of the woodpecker."""

POINTS_PER_STEP = 8
"""Number of points of a coordinate between two states."""

BINS = 100
"""Number of intervals in which switching points are counted."""

NOISE = 1e-6
"""Range of a curve, relative to its largest value, below which its variation is a rounding error."""

KINDS = {"unilateral": "contact opens or closes", "friction": "slips or sticks"}
"""Names of switching points by law."""

Panel = alt.Chart | alt.LayerChart
"""A part of the chart."""


def simulation_chart(simulation: Simulation, seconds: float = SHOWN_SECONDS) -> alt.VConcatChart:
    """Return the chart; coordinates that have names are drawn over the last ``seconds`` [s]."""
    scene, plan = simulation.plan.scene, simulation.plan
    has_names, is_variable = bool(scene.coordinates), plan.stepper.locates_switches
    steps = simulation.steps
    shown = steps["time"] >= (simulation.state.time - seconds if has_names else -np.inf)
    begin = -np.inf if shown.all() else float(simulation.state.time - seconds)
    switches = [event for event in simulation.switch_events if event.time >= begin]
    panels: list[Panel] = _coordinate_panels(simulation, begin, switches) if has_names else []
    if not (has_names and is_variable):
        panels += _work_panels(simulation, shown)
    if is_variable:
        if not has_names:
            panels.append(_count_panel(switches, steps[shown]))
        panels.append(_step_panel(pd.DataFrame({"time": steps["time"][shown], "length": steps["length"][shown]})))
    last = panels[-1].layer[0] if isinstance(panels[-1], alt.LayerChart) else panels[-1]
    last.encoding.x.title = "simulated time [s]"
    last.encoding.x.axis = alt.Axis()
    title = heading(_title(simulation, begin), [_subtitle(simulation, shown, switches)], WIDTH + LEGEND_WIDTH)
    resolve: dict[str, Any] = {"x": "shared", "color": "independent", "strokeDash": "independent"}
    return stacked(panels, title, resolve, label_width=44)


def write_chart(simulation: Simulation, path: Path) -> list[Path]:
    """Write the chart as ``path`` with .svg and with .png; return the files.

    Raises:
        BenchError: if the files cannot be written.
    """
    return write_drawing(simulation_chart(simulation), path)


def _title(simulation: Simulation, begin: float) -> str:
    """Return the title of the chart; ``begin`` is the start of the shown time [s], or -inf."""
    scene = simulation.plan.scene
    name = scene.name.replace("_", " ").capitalize()
    balls = f", {counted(scene.n_balls, 'ball')}" if scene.n_balls > 1 else ""
    suffix = "" if begin == -np.inf else f" after {begin:.4g} s"
    return f"{name}{balls} over time{suffix}"


def _subtitle(simulation: Simulation, shown: NDArray[np.bool_], switches: list[SwitchEvent]) -> str:
    """Return the settings, the work and the unsolved steps of the shown time; earlier unsolved steps are also counted.

    Args:
        simulation: the simulation.
        shown: whether each step is shown, shape (n_steps,).
        switches: the shown switching points.
    """
    parts = simulation.segments_with_steps()
    segments = [segment for segment, step_slice in parts if shown[step_slice].any()]
    segments = segments or [planned_segment(simulation.plan, 0)]
    steppers = {segment.stepper for segment in segments}
    earlier = int(simulation.unsolved[~shown].sum())
    solved = f"{_settings(segments)}, {counted(int(simulation.unsolved[shown].sum()), 'unsolved step')}"
    solved += f" and {earlier} earlier" if earlier else ""
    stepper = f"{steppers.pop()}, " if len(steppers) == 1 else ""
    if not simulation.plan.stepper.locates_switches:
        return f"{stepper}{solved}"
    solves = counted(int(simulation.steps["solves"][shown].sum()), "one-step solve")
    return f"{stepper}{counted(int(shown.sum()), 'step')}, {solves}, {describe_switches(switches)}; {solved}"


def _settings(segments: Sequence[Segment]) -> str:
    """Return the solvers and tolerances of segments in words, and those other settings that differ between them."""
    differing = {
        name for name in ("stepper", "start", "max_iterations") if len({getattr(one, name) for one in segments}) > 1
    }
    texts = []
    for segment in segments:
        words = {
            "stepper": segment.stepper,
            "solver": f"{segment.solver} to {exponent(segment.tolerance)}",
            "start": f"{segment.start} starts",
            "max_iterations": f"at most {counted(segment.max_iterations, 'iteration')}",
        }
        texts.append(", ".join(text for name, text in words.items() if name == "solver" or name in differing))
    return ", then ".join(texts)


def _work_panels(simulation: Simulation, shown: NDArray[np.bool_]) -> list[Panel]:
    """Return the panels of observables of the scene, active contacts, iterations, penetration and energy.

    Scenes with observables show only the total energy. Their balls may leave the scene and fall forever, so that the
    kinetic and the potential energy grow without bound and would hide the total.
    """
    observables = [observable for observable in simulation.plan.scene.observables if observable.label]
    curves = _aggregated(simulation.steps[shown], [observable.name for observable in observables])
    energies = {"energy": "total"}
    if simulation.plan.scene.potential_energy is None:
        energies = {"kinetic_energy": "kinetic"}
    elif not observables:
        energies |= {"potential_energy": "potential", "kinetic_energy": "kinetic"}
    panels: list[Panel] = [
        _curve_panel(curves, "contacts", {"contacts": "active contacts"}, has_jumps=True),
        _curve_panel(
            curves, "iterations", {"iterations": "mean", "most_iterations": "maximum"}, "sqrt", has_jumps=True
        ),
        _curve_panel(curves, "depth / r", {"penetration": "of states", "impact_depth": "at midpoints"}),
        _curve_panel(curves, "energy [J]", energies),
    ]
    observed_panels = [
        _curve_panel(curves, observable.label, {observable.name: observable.label}, has_jumps=observable.is_count)
        for observable in observables
    ]
    return [*observed_panels, *panels]


def _aggregated(rows: NDArray[np.void], observed: list[str]) -> pd.DataFrame:
    """Aggregate steps over intervals: mean contacts and iterations, largest penetration, last values of the rest."""
    steps = pd.DataFrame({name: rows[name] for name in rows.dtype.names or ()})
    steps["energy"] = steps["kinetic_energy"] + steps["potential_energy"]
    steps["most_iterations"] = steps["iterations"]
    length = max(1, -(-len(steps) // POINTS))
    last = ("time", *observed, "kinetic_energy", "potential_energy", "energy")
    aggregations: dict[str, Any] = {name: "last" for name in last}
    aggregations |= {"contacts": "mean", "iterations": "mean"}
    aggregations |= {"most_iterations": "max", "penetration": "max", "impact_depth": "max"}
    aggregated: pd.DataFrame = steps.groupby(np.arange(len(steps)) // length).agg(aggregations)
    return aggregated


def _curve_panel(
    curves: pd.DataFrame,
    title: str,
    names: dict[str, str],
    scale: Literal["linear", "sqrt"] = "linear",
    has_jumps: bool = False,
) -> alt.Chart:
    """Return one panel of curves.

    Args:
        curves: the curves, one row per interval of time, with a column "time" [s].
        title: title of the vertical axis.
        names: names in the legend by column.
        scale: scale of the vertical axis.
        has_jumps: whether values are constant between rows.
    """
    long = curves.melt("time", list(names), "column", "value")
    long["curve"] = long["column"].map(names)
    order = list(names.values())
    colours = alt.Scale(domain=order, range=[PALETTE[k] for k in (0, 3, 2)[: len(order)]])
    dashes = alt.Scale(domain=order, range=([1, 0], [5, 2], [2, 2])[: len(order)])
    lines = _sized_chart(long[["time", "value", "curve"]])
    panel: alt.Chart = lines.mark_line(strokeWidth=1.5, interpolate="step-before" if has_jumps else "linear").encode(
        x=_time_axis(),
        y=alt.Y("value:Q", title=title).scale(type=scale).axis(tickCount=4, format=".5~g"),
        color=alt.Color("curve:N", sort=order, scale=colours, title=None),
        strokeDash=alt.StrokeDash("curve:N", sort=order, scale=dashes, title=None),
    )
    return panel


def _coordinate_panels(simulation: Simulation, begin: float, switches: list[SwitchEvent]) -> list[Panel]:
    """Return a panel for each coordinate with a name, with switching points as dots."""
    coordinates, shown = simulation.plan.scene.coordinates, simulation.times >= begin
    curves = _curves(simulation.times[shown], simulation.trajectory[shown], simulation, coordinates)
    dots = _dots(simulation, switches, coordinates)
    has_dots = simulation.plan.stepper.locates_switches
    return [
        _coordinate_panel(curves, dots, name, has_legend=has_dots and not number)
        for number, name in enumerate(coordinates)
    ]


def _curves(
    time: FloatArray, trajectory: FloatArray, simulation: Simulation, coordinates: Mapping[str, int]
) -> pd.DataFrame:
    """Return the coordinates over time, interpolated by cubics that match q and q̇ = u at the ends of each step."""
    position, velocity = np.split(trajectory, [len(simulation.plan.scene.start.position)], axis=1)
    columns = list(coordinates.values())
    if velocity.shape != position.shape or len(time) < 2:
        return pd.DataFrame(position[:, columns], columns=list(coordinates)).assign(time=time)
    share = np.arange(POINTS_PER_STEP) / POINTS_PER_STEP
    dense = time[:-1, None] + np.diff(time)[:, None] * share
    all_times = np.append(dense.ravel(), time[-1])
    curves = CubicHermiteSpline(time, position[:, columns], velocity[:, columns])(all_times)
    return pd.DataFrame(curves, columns=list(coordinates)).assign(time=all_times)


def _dots(simulation: Simulation, switches: list[SwitchEvent], coordinates: Mapping[str, int]) -> pd.DataFrame:
    """Return one row per switching point: its time, the law that switches, and the coordinates."""
    times = np.array([event.time for event in switches])
    indices = np.searchsorted(simulation.times, times)
    frame = pd.DataFrame(simulation.trajectory[indices][:, list(coordinates.values())], columns=list(coordinates))
    frame["time"] = times
    frame["law"] = [KINDS[event.law] for event in switches]
    return frame


def _coordinate_panel(frame: pd.DataFrame, dots: pd.DataFrame, name: str, has_legend: bool) -> alt.LayerChart:
    """Return one coordinate over time, with its dots."""
    curve = frame[["time", name]].rename(columns={name: "value"})
    scale = alt.Scale(zero=False)
    low, high = curve["value"].min(), curve["value"].max()
    magnitude = max(abs(low), abs(high))
    if high - low <= NOISE * magnitude:  # an axis of this range would show rounding errors
        middle, margin = 0.5 * (low + high), 0.05 * magnitude or 1.0
        scale = alt.Scale(zero=False, domain=[middle - margin, middle + margin])
    axis = alt.Y("value:Q", title=name, scale=scale)
    line = _sized_chart(curve).mark_line(color="#4d4d4d", strokeWidth=1.4).encode(x=_time_axis(), y=axis)
    points = dots[["time", "law", name]].rename(columns={name: "value"})
    colour = _colour() if has_legend else _colour().legend(None)
    marks = alt.Chart(points).mark_circle(size=42, opacity=1.0).encode(x=_time_axis(), y=axis, color=colour)
    layer: alt.LayerChart = line + marks
    return layer


def _count_panel(switches: list[SwitchEvent], steps: NDArray[np.void]) -> alt.Chart:
    """Return a histogram of switching points over time."""
    borders = np.linspace(steps["time"][0] - steps["length"][0], steps["time"][-1], BINS + 1)
    rows = []
    for law, kind in KINDS.items():
        times = np.array([event.time for event in switches if event.law == law])
        counts, _ = np.histogram(np.clip(times, borders[0], borders[-1]), borders)
        rows.append(pd.DataFrame({"time": borders[:-1], "end": borders[1:], "count": counts, "law": kind}))
    frame = pd.concat(rows)
    axis = alt.Y("count:Q", title=["switching points", f"per {borders[1] - borders[0]:.2g} s"]).axis(
        format="d", tickMinStep=1
    )
    panel: alt.Chart = (
        _sized_chart(frame[frame["count"] > 0])
        .mark_bar()
        .encode(
            x=_time_axis().bin("binned"),
            x2="end:Q",
            y=axis.scale(domainMin=0, domainMax=max(1, int(frame.groupby("time")["count"].sum().max()))),
            color=_colour(),
        )
    )
    return panel


def _step_panel(frame: pd.DataFrame) -> alt.Chart:
    dots = alt.OverlayMarkDef(size=8)
    length = alt.Y("length:Q", title="step size [s]").scale(type="log", nice=False)
    marks = _sized_chart(frame).mark_line(color=PALETTE[0], strokeWidth=1.0, interpolate="step-before", point=dots)
    panel: alt.Chart = marks.encode(x=_time_axis(), y=length.axis(format=".0e", tickCount=6))
    return panel


def _sized_chart(frame: pd.DataFrame) -> alt.Chart:
    return alt.Chart(frame, width=WIDTH, height=HEIGHT)


def _time_axis() -> alt.X:
    return alt.X("time:Q", title=None).axis(labels=False, ticks=False).scale(nice=False)


def _colour() -> alt.Color:
    kinds = list(KINDS.values())
    return alt.Color("law:N", sort=kinds, scale=alt.Scale(domain=kinds, range=[PALETTE[3], PALETTE[0]]), title=None)
