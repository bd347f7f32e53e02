"""A study in words: every point with what it costs, and what came to nothing."""

from dataclasses import asdict
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ...problems.trajectories.pour import UNITS
from .measuring import ERROR
from .points import Point
from .running import failures, points, spreads
from .study import Study


def print_study(study: Study, console: Console) -> None:
    """Print the points, the spread of the reference, and failures."""
    plan = study.plan
    head = f"{plan.scene} · {plan.duration:g} s · {len(study.measured)} of {plan.n_runs} simulations"
    console.print(Text(head, style="bold"))
    found = points(study)
    is_pour = any(point.quantity != ERROR for point in found)
    quantities = list(dict.fromkeys(point.quantity for point in found))
    rows: dict[tuple[Any, ...], list[Point]] = {}
    for point in found:
        rows.setdefault((point.series, point.setting, point.solver, point.tolerance), []).append(point)
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, 1, 0, 0))
    for name in ("curve", "stepper", "solver to"):
        table.add_column(Text(name), overflow="fold")
    for name in (*quantities, *(() if is_pour else ("from", "to")), "wall [s]", "solves", "missed", "failed"):
        table.add_column(Text(name), justify="right", no_wrap=True)
    for group in rows.values():
        first = group[0]
        of = {point.quantity: point for point in group}
        errors = [_error(of.get(quantity)) for quantity in quantities]
        bounds = [] if is_pour else [f"{first.low:.1e}", f"{first.high:.1e}"]
        words = (first.series, _brief(first.setting), f"{first.tolerance:.0e}")
        costs = (f"{first.wall:.3g}", f"{first.solves:.0f}", str(first.unsolved or "–"), str(first.failed or "–"))
        table.add_row(*map(Text, (*words, *errors, *bounds, *costs)))
    console.print(table)
    for quantity, (mean, spread) in spreads(study).items():
        text = f"reference  {quantity} {mean:.5g} {UNITS[quantity]}, standard error over seeds {spread:.1e} of it"
        console.print(Text(text))
    for sentence in failures(study):
        console.print(Text(f"failed  {sentence}", style="yellow"))


def study_document(study: Study) -> dict[str, Any]:
    """Return plan, points, spreads and failures as values that JSON can write."""
    return {
        "file": None if study.file is None else str(study.file),
        "finished": study.is_finished,
        "plan": study.plan.document(),
        "points": [asdict(point) for point in points(study)],
        "reference": {name: {"mean": mean, "error": error} for name, (mean, error) in spreads(study).items()},
        "failures": failures(study),
    }


def _error(point: Point | None) -> str:
    if point is None:
        return "–"
    return f"{point.error:.1e}" if point.quantity == ERROR else f"{point.error:.1e} ± {point.high - point.error:.0e}"


def _brief(setting: str) -> str:
    """Return a stepper without its class, which the curve names, and without spaces."""
    inside = setting[setting.find("(") + 1 : -1] if "(" in setting else setting
    return inside.replace("tolerance=", "").replace("min_step=", "")
