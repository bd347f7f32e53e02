"""Charts of the cost of accuracy in scenes of rigid bodies, from the tables of ``costs_of_accuracy.py``."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import altair as alt
import pandas as pd
from proxbench.bench.report.charts.drawing import TIME_AXIS, heading, stacked, write_drawing
from proxbench.bench.report.charts.palette import SolverStyle, solver_styles

EVEN_DECADES = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10]

STEP = 5e-3
"""Δt [s] of the charts over the tolerance."""

STEPS = (1e-2, 5e-3, 2e-3)
"""Δt [s] of the panels of work–precision diagrams, from left to right."""

RECOMMENDED = 1e-6
"""Tolerance that work–precision diagrams mark."""

MAX_TICKS = 6
"""Largest number of ticks of an axis of errors."""


@dataclass(frozen=True)
class Quantity:
    """A measured quantity.

    Attributes:
        title: its name, with its unit.
        rows: measurements with ``solver``, ``step`` and ``tolerance``.
        column: the column of its error.
        least: smallest error that is drawn; smaller ones are drawn there.
        most: largest error that is drawn.
        duration: simulated time of a motion that is complete or ended by a fall [s]; 0 for motions of any duration.
    """

    title: str
    rows: pd.DataFrame
    column: str
    least: float
    most: float
    duration: float = 0.0

    @property
    def axis(self) -> alt.Axis:
        """The axis of the error, with ticks at powers of ten."""
        low, high = round(math.log10(self.least)), round(math.log10(self.most))
        between = math.ceil((high - low) / (MAX_TICKS - 1))
        return alt.Axis(format=".0e", values=[10.0**power for power in range(high, low - 1, -between)])

    def cut(self) -> pd.DataFrame:
        """Return the rows with the error within the limits in the column ``cut``."""
        return self.rows.assign(cut=self.rows[self.column].clip(self.least, self.most))

    def work(self, styles: Mapping[str, SolverStyle]) -> pd.DataFrame:
        """Return rows of these solvers with ``work``, the processor time per simulated second.

        Motions that ran out of processor time are left out.
        """
        rows = self.cut().assign(work=self.rows["seconds"] / self.rows["time"])
        is_complete = (rows["time"] >= self.duration * (1.0 - 1e-9)) | (rows[self.column] > self.most)
        return rows[is_complete & rows["solver"].isin(list(styles))]


def quantities(measured: pd.DataFrame) -> dict[str, Quantity]:
    """Return the quantities of a file of measurements by the name of their table."""

    def rows(table: str) -> pd.DataFrame:
        return measured[measured["table"] == table]

    arches = rows("arch").assign(error=lambda table: (table["ratio"] - 1.0).abs())
    return {
        "arch": Quantity("error of the least thickness", arches, "error", 1e-4, 0.1),
        "creep": Quantity("movement in 10 s [m]", rows("creep"), "largest", 1e-11, 0.1, 10.0),
        "drift": Quantity("drift of the stack in 2 s [m]", rows("drift"), "largest", 1e-12, 0.1, 2.0),
        "cube": Quantity("lift of the cube [m]", rows("cube"), "lift", 1e-12, 1.0, 1.5),
        "chain": Quantity("error of the energy in 2 s", rows("chain"), "largest", 1e-14, 1.0, 2.0),
    }


def by_solver(names: Mapping[str, SolverStyle]) -> tuple[alt.Color, alt.StrokeDash]:
    """Return the encodings of solvers by colour and by dash."""
    legend = alt.Legend(symbolType="stroke", symbolSize=500)
    colours, dashes = [one.colour for one in names.values()], [one.dash for one in names.values()]
    return (
        alt.Color("solver:N", title=None, sort=list(names), legend=legend).scale(domain=list(names), range=colours),
        alt.StrokeDash("solver:N", title=None, sort=list(names), legend=legend).scale(domain=list(names), range=dashes),
    )


def tolerance_panel(quantity: Quantity, styles: Mapping[str, SolverStyle]) -> alt.LayerChart:
    """Return the error over the tolerance, a line for each solver."""
    rows, (colour, dash) = quantity.cut()[["solver", "step", "tolerance", "cut"]], by_solver(styles)
    even = alt.Axis(format=".0e", values=EVEN_DECADES)
    limits = (quantity.least, quantity.most)
    base = alt.Chart(rows[rows["step"] == STEP]).encode(
        x=alt.X("tolerance:Q", title="tolerance", axis=even).scale(type="log", reverse=True, nice=False),
        y=alt.Y("cut:Q", title=quantity.title, axis=quantity.axis).scale(type="log", domain=limits, nice=False),
        color=colour,
    )
    layers = [
        base.mark_line(strokeWidth=2).encode(strokeDash=dash),
        base.mark_point(filled=True, size=45, opacity=1),
    ]
    return alt.LayerChart(layer=layers).properties(width=210, height=200)


def work_panels(quantity: Quantity, styles: Mapping[str, SolverStyle]) -> Sequence[alt.LayerChart]:
    """Return the error over the processor time, a panel for each step, with a line for each solver."""
    rows, (colour, dash) = quantity.work(styles)[["solver", "step", "tolerance", "cut", "work"]], by_solver(styles)
    times = (0.8 * float(rows["work"].min()), 1.25 * float(rows["work"].max()))
    panels = []
    for number, step in enumerate(STEPS):
        base = alt.Chart(rows[rows["step"] == step]).encode(
            x=alt.X("work:Q", title="processor time per simulated second [s]", axis=alt.Axis(**TIME_AXIS)).scale(
                type="log", domain=times, nice=False
            ),
            y=alt.Y("cut:Q", title=None if number else quantity.title, axis=quantity.axis).scale(
                type="log", domain=(quantity.least, quantity.most), nice=False
            ),
            color=colour,
            order=alt.Order("tolerance:Q", sort="descending"),
        )
        layers = [
            base.mark_line(strokeWidth=2, clip=False).encode(strokeDash=dash),
            base.mark_point(filled=True, size=30, opacity=1),
            base.transform_filter(alt.datum.tolerance == RECOMMENDED).mark_point(size=130, strokeWidth=1.5, opacity=1),
        ]
        title = alt.TitleParams(f"Δt = {1e3 * step:g} ms", fontSize=12, fontWeight="normal", anchor="middle", offset=4)
        panels.append(alt.LayerChart(layer=layers).properties(width=200, height=170, title=title))
    return panels


def draw(measured: pd.DataFrame, folder: Path, solvers: Iterable[str]) -> None:
    """Draw the charts of the documentation, with styles by the order of the solvers."""
    all_styles, found = solver_styles(solvers), quantities(measured)
    scales = {"color": "shared", "strokeDash": "shared"}
    for name, title, tables in (
        ("arch-by-tolerance", "An arch of seven stones, steps of 5 ms", ("arch", "creep")),
        (
            "stack-cube-chain-by-tolerance",
            "A stack, a thrown cube and a chain, steps of 5 ms",
            ("drift", "cube", "chain"),
        ),
    ):
        shown = [found[table] for table in tables]
        drawn = {solver for one in shown for solver in one.rows["solver"]}
        styles = {solver: style for solver, style in all_styles.items() if solver in drawn}
        row = alt.hconcat(*(tolerance_panel(one, styles) for one in shown), spacing=30)
        write_drawing(stacked([row], heading(title, [], 700), scales), folder / name)
    for name, title, tables in (
        ("standing-work-precision", "An arch of seven stones and a stack of ten boxes", ("arch", "drift")),
        ("moving-work-precision", "A thrown cube and a chain of five rods", ("cube", "chain")),
    ):
        shown = [found[table] for table in tables]
        stepped = {solver for one in shown for solver in one.rows[one.rows["step"] == STEPS[0]]["solver"]}
        styles = {solver: style for solver, style in all_styles.items() if solver in stepped}
        rows = [alt.hconcat(*work_panels(one, styles), spacing=16) for one in shown]
        notes = ["Marks on a line are tolerances, from 1e-2 to the smallest one; circles mark 1e-6."]
        write_drawing(stacked(rows, heading(title, notes, 700), scales, spacing=16), folder / name)
