"""A comparison on the terminal, as Markdown for a pull request, and as one JSON document."""

from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.text import Text

from ...store.fields import accuracy_tag
from ..cells import duration
from ..layout.terminal_table import print_table
from ..layout.text import inline, json_records, markdown_frame
from .comparison import Comparison


def comparison_document(comparison: Comparison, failures: list[str]) -> dict[str, Any]:
    """Return a comparison as one JSON object."""
    frames = {name: getattr(comparison, name) for name in ("solvers", "cases", "points", "changes")}
    return {
        "before": str(comparison.before.folder),
        "after": str(comparison.after.folder),
        "verdict": comparison.verdict,
        "failures": failures,
        "incomparable_reason": comparison.incomparable_reason,
        "notes": list(comparison.notes),
        "scale": comparison.scale,
        **{name: json_records(frame) for name, frame in frames.items()},
    }


def print_comparison(comparison: Comparison, failures: list[str], console: Console) -> None:
    """Print the notes, the differences, the verdict and the failures."""
    for note in comparison.notes:
        console.print(Text(note, style="yellow"))
    for title, table in _tables(comparison):
        console.print(Text(title, style="bold"))
        print_table(console, table, left_aligned=("problem", "change", "reason"), optional=("reason", "before"))
        console.print()
    if len(comparison.solvers):
        console.print(Text(_legend(comparison), style="dim"))
    console.print(Text(comparison.verdict, style="bold"))
    for failure in failures:
        console.print(Text(f"FAILED {failure}", style="bold red"))


def markdown_page(comparison: Comparison, failures: list[str]) -> str:
    """Return a comparison as Markdown: the verdict, the changes, and the ratios of all cases in a collapsed section."""
    names = (inline(run.info.run_id) for run in (comparison.before, comparison.after))
    parts = ["### Proxbench: {} → {}".format(*names), f"**{inline(comparison.verdict)}**"]
    parts += [f"❌ {inline(failure)}" for failure in failures]
    parts += [f"{inline(note)}" for note in comparison.notes]
    parts += [f"{inline(title)}\n\n{markdown_frame(table)}" for title, table in _tables(comparison)]
    if len(comparison.solvers):
        cases = markdown_frame(_shown_times(comparison, comparison.cases))
        parts += [_legend(comparison), f"<details><summary>All cases</summary>\n\n{cases}\n</details>"]
    return "\n\n".join(part.rstrip("\n") for part in parts) + "\n"


def _tables(comparison: Comparison) -> list[tuple[str, pd.DataFrame]]:
    """Return titles and non-empty tables: solvers, single cases that differ, accuracies that only one run reaches."""
    bounds = 1.0 / (1.0 + comparison.slowdown), 1.0 + comparison.slowdown
    cases = comparison.cases
    single_cases = cases[(cases["high"] < bounds[0]) | (cases["low"] > bounds[1])]
    changes = comparison.changes.assign(accuracy=comparison.changes["accuracy"].map(accuracy_tag))
    shown = changes[["solver", "problem", "accuracy", "change", "reason"]]
    tables = [
        ("times of each solver, over its problems", _shown_times(comparison, comparison.solvers)),
        ("cases that are individually slower or faster", _shown_times(comparison, single_cases)),
        ("accuracies that only one run reaches", shown),
    ]
    return [(title, table) for title, table in tables if len(table)]


def _shown_times(comparison: Comparison, frame: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of solvers or cases as text, slowest first."""
    bound = 1.0 + comparison.slowdown
    frame = frame.sort_values("ratio", ascending=False, kind="stable")
    shown = frame[[name for name in ("solver", "problem", "problems") if name in frame]].astype(str)
    for column in ("before", "after"):
        shown[column] = frame[column].map(duration)
    shown["ratio"] = frame["ratio"].map("{:.2f}".format)
    ends = zip(frame["low"], frame["high"], strict=True)
    shown["interval"] = [f"{low:.2f} to {high:.2f}" if np.isfinite(high) else "–" for low, high in ends]
    shown["change"] = np.select([frame["low"] > bound, frame["high"] < 1.0 / bound], ["slower", "faster"], "")
    return shown


def _legend(comparison: Comparison) -> str:
    threshold = f"{100 * comparison.slowdown:g} %"
    return (
        f"ratio: times after over times before, divided by {comparison.scale:.3f}, the common factor of all solvers. "
        f"slower, faster: by more than {threshold}, with simultaneous 95 % confidence over all cases."
    )
