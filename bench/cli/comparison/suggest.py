"""``proxbench suggest``."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from .. import options


def suggest(
    problems: Annotated[list[str], typer.Argument(metavar="PROBLEM|FOLDER", help="Problems, files or folders.")],
    run: Annotated[
        Path | None, options.selection(metavar="RUN", help="Run to go by; results/reference if left out.")
    ] = None,
    accuracy: Annotated[float, options.selection(metavar="NUMBER", help="Judged residual to reach.")] = 1e-4,
    plugin: options.PluginFiles = None,
    as_json: options.Json = False,
) -> int:
    """Say which solver to take for problems like these, from what a run measured on those most like them."""
    import json

    from rich.console import Console
    from rich.text import Text

    from ....problems.spelling import for_command_line
    from ... import runs
    from ...measure.selection import select
    from ...report.fitting import print_table
    from ...report.text import output_width, print_json

    chosen = select(problems, "")
    for sentence in chosen.left_out:
        print(f"proxbench: {for_command_line(sentence)}", file=sys.stderr)
    found = runs.suggest(chosen.problems, run, accuracy)
    if as_json:
        frames = {name: json.loads(getattr(found, name).to_json(orient="records")) for name in ("problems", "solvers")}
        regrets = {name: getattr(found, name)._asdict() for name in ("regret", "single")}
        print_json({"solver": found.solver, "accuracy": accuracy, **frames, **regrets})
        return int(bool(chosen.left_out))
    console = Console(width=output_width())
    shown = found.problems.assign(
        factor=found.problems["factor"].map("{:.2g}".format), distance=found.problems["distance"].map("{:.2g}".format)
    )
    print_table(console, shown, words=("problem", "nearest"), optional=("distance", "nearest"))
    console.print(Text(found.cost, style="dim"))
    console.print(Text(f"take     {found.solver}", style="bold"))
    return int(bool(chosen.left_out))
