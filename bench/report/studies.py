"""The points of a study: the cost of each step or tolerance, and its error in each quantity."""

import numpy as np
import pandas as pd
from rich.console import Console
from rich.text import Text

from ...problems.motion.trajectories.pour import UNITS
from ...problems.motion.trajectories.problem import Aggregates
from ..store.condition import EXCLUDED_MARK
from ..store.frames import POINT, RunFrames
from ..store.plans import PlanRecord, TrajectoryRecord
from .layout.terminal_table import print_table, wrap_note
from .layout.text import overlap_words

_COSTS = (
    "total_seconds",
    "processor_seconds",
    "is_excluded",
    "iterations",
    "repeats",
    "failed_members",
    "unsolved_steps",
    "overlapping_steps",
    "outcome",
    "reason",
)
"""Columns of a point that do not depend on the quantity."""

MIN_MOTION = 1e-6
"""Largest displacement of a coordinate, relative to the scale of errors, up to which a motion counts as rest."""

ERROR_MEANINGS = {
    "limit cycle": "error after one period of the limit cycle, over the range of each coordinate",
    "end position": "error of the last position, over the largest displacement, at least the length of the scene",
    "aggregates": "relative deviation of means over the second half from those of the reference",
}
"""Meaning of an error, by its kind."""


def points_table(frames: RunFrames) -> pd.DataFrame:
    """Return one row for each point and quantity, or for each point without a result.

    Columns: problem, solver, tolerance (the value of the ladder: a step [s] or a tolerance), quantity, error, low
    and high (ends of its error bar), total_seconds and processor_seconds (median times of the steps [s]; NaN if
    unknown), is_excluded (whether the point has only excluded rounds), iterations (median number of one-step solves),
    repeats (number of members that finished), failed_members, unsolved_steps, overlapping_steps, outcome, reason.
    """
    table = frames.points[[*POINT, *_COSTS]].merge(frames.errors, how="left", on=POINT)
    return table[[*POINT, "quantity", "error", "low", "high", *_COSTS]]


def headline(plan: PlanRecord, problem: str) -> str:
    """Return one line about a trajectory: its duration, the initial impulses of steps, and the meaning of errors."""
    trajectory, starts = plan.trajectory(problem), ", ".join(dict.fromkeys(method.start for method in plan.methods))
    return f"{trajectory.name} · {trajectory.duration:g} s · {starts} starts · {ERROR_MEANINGS[trajectory.error]}"


def motion_warning(trajectory: TrajectoryRecord) -> str:
    """Return a warning if the reference rests, so that errors have no scale; otherwise an empty text."""
    if trajectory.displacement is None or trajectory.displacement > MIN_MOTION * trajectory.scale:
        return ""
    return (
        f"no coordinate of {trajectory.name} changes within {trajectory.duration:g} s, so errors have no scale; "
        "choose a longer duration, or other options of the scene."
    )


def print_points(frames: RunFrames, trajectory: TrajectoryRecord, console: Console) -> None:
    """Print the points of a problem, the standard errors of its reference, failed members and remaining overlaps."""
    table = points_table(frames)
    table = table[table["problem"] == trajectory.name]
    is_single_motion = trajectory.error != "aggregates"
    rows = []
    for (solver, value), point in table.groupby(["solver", "tolerance"], sort=False):
        first = point.iloc[0]
        row = {"solver": solver, "at": f"{value:g}"}
        for quantity in table["quantity"].dropna().unique():
            of_quantity = point[point["quantity"] == quantity]
            row[str(quantity).replace(" ", "\n")] = (
                _error_text(of_quantity.iloc[0], is_single_motion) if len(of_quantity) else "–"
            )
        if is_single_motion:
            row |= {"from": f"{first['low']:.1e}", "to": f"{first['high']:.1e}"}
        counts = {
            heading: first[name] for heading, name in (("missed", "unsolved_steps"), ("failed", "failed_members"))
        }
        mark = EXCLUDED_MARK if first["is_excluded"] == 1 else ""
        row |= {"wall [s]": f"{first['total_seconds']:.3g}{mark}", "CPU [s]": f"{first['processor_seconds']:.3g}"}
        row["solves"] = _count_text(first["iterations"])
        rows.append(row | {heading: _count_text(count) if count else "–" for heading, count in counts.items()})
    if rows:
        print_table(
            console,
            pd.DataFrame(rows).fillna("–").replace("nan", "–"),
            optional=("missed", "failed", "from", "CPU [s]"),
        )
    warning = motion_warning(trajectory)
    if warning:
        console.print(Text(wrap_note(warning, console.width), style="bold yellow"))
    for quantity, (mean, spread) in reference_statistics(trajectory).items():
        unit = UNITS.get(quantity, "")
        text = f"reference  {quantity} {mean:.5g} {unit}, relative standard error over seeds {spread:.1e}"
        console.print(Text(text, style="dim"))
    for failed in table[table["reason"] != ""].drop_duplicates(["solver", "reason"]).to_dict("records"):
        note = f"{failed['solver']} at {failed['tolerance']:g}: {failed['reason']}"
        console.print(Text(wrap_note(note, console.width), style="yellow"))
    with_overlaps = table[table["overlapping_steps"] > 0].drop_duplicates(["solver", "tolerance"])
    for record in with_overlaps.to_dict("records"):
        note = f"{record['solver']} at {record['tolerance']:g}: {overlap_words(int(record['overlapping_steps']))}"
        console.print(Text(wrap_note(note, console.width), style="yellow"))


def reference_statistics(trajectory: TrajectoryRecord) -> dict[str, tuple[float, float]]:
    """Return the mean and the relative standard error of each aggregate of the reference; empty without aggregates."""
    if trajectory.error != "aggregates":
        return {}
    return Aggregates({member.member: member.values for member in trajectory.known if not member.failure}).spreads()


def _count_text(value: float) -> str:
    return f"{value:.0f}" if np.isfinite(value) else "–"


def _error_text(row: "pd.Series[float]", is_single_motion: bool) -> str:
    return f"{row['error']:.1e}" if is_single_motion else f"{row['error']:.1e} ± {row['high'] - row['error']:.0e}"
