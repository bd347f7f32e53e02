"""``proxbench suggest``."""

import math
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import options


def suggest(
    problems: Annotated[list[str], typer.Argument(metavar="PROBLEM|FOLDER", help="Problems, files or folders.")],
    run: Annotated[
        Path | None, options.selection(metavar="RUN", help="Run to go by; the table of the package if left out.")
    ] = None,
    accuracy: Annotated[float, options.selection(metavar="NUMBER", help="Judged residual to reach.")] = 1e-4,
    plugin: options.PluginFiles = None,
    as_json: options.Json = False,
) -> int:
    """Say which solver to take for problems like these, from what was measured on those most like them."""
    from rich.console import Console
    from rich.text import Text

    from ....problems.spelling import for_command_line
    from ...measure.selection import select
    from ...plugins.problems import resolved
    from ...report.layout.fitting import print_table
    from ...report.layout.text import json_records, output_width, print_json
    from ...report.suggestion.suggest import suggest as suggested

    chosen = select(problems, "")
    for sentence in chosen.left_out:
        print(f"proxbench: {for_command_line(sentence)}", file=sys.stderr)
    found = suggested([resolved(one) for one in chosen.problems], run, accuracy)
    if as_json:
        frames = {name: json_records(getattr(found, name)) for name in ("problems", "solvers")}
        regrets = {name: _as_json(getattr(found, name)) for name in ("regret", "regret_of_families", "single")}
        print_json(
            {"solver": found.solver, "accuracy": found.accuracy, "source": found.source, "far": found.far}
            | frames
            | regrets
        )
        return int(bool(chosen.left_out))
    console = Console(width=output_width())
    numbers = {name: found.problems[name].map("{:.2g}".format) for name in ("factor", "distance")}
    shown = found.problems.assign(**numbers)
    print_table(console, shown, words=("problem", "nearest"), optional=("distance", "nearest"))
    console.print(Text(found.words, style="dim"))
    for name in found.far:
        console.print(Text(f"nothing measured is like {name}; measure solvers on it", style="yellow"))
    together = f" for all of these together, factor {found.solvers['factor'].iloc[0]:.2g}" if len(shown) > 1 else ""
    console.print(Text(f"take     {found.solver}{together}", style="bold"))
    return int(bool(chosen.left_out))


def _as_json(regret: Any) -> dict[str, float | None]:
    """Return the numbers of a regret, those that are not known as null."""
    return {name: value if math.isfinite(value) else None for name, value in regret._asdict().items()}
