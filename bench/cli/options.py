"""Options that commands share: plugin files, what is printed, and which solvers."""

from pathlib import Path
from typing import Annotated

import typer

from .help import OUTPUT

SELECTION, LIMITS = "Problems and solvers", "Limits"
"""Topics that several help pages have."""


def _take_into_use(paths: list[Path] | None) -> list[Path] | None:
    if paths:
        from ..measure.plugins import use_plugin_files

        use_plugin_files(paths)
    return paths


def refuse_two_prints(quiet: bool, as_json: bool) -> None:
    """Raise a BenchError if a command is called with both ``--quiet`` and ``--json``."""
    from ..errors import BenchError

    if quiet and as_json:
        raise BenchError("--quiet and --json exclude each other; give one of them.")


PluginFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin",
        metavar="FILE",
        help="Python file with solvers, problems or scenes; repeatable.",
        rich_help_panel=SELECTION,
        callback=_take_into_use,
    ),
]
"""Plugin files; they are in use when the command begins."""

Solvers = Annotated[
    list[str] | None,
    typer.Option(
        "--solver", metavar="SOLVER", help='Like "SORprox(relaxation=1.5)"; repeatable.', rich_help_panel=SELECTION
    ),
]
"""Names of solvers with options."""

Problems = Annotated[
    list[str] | None,
    typer.Option(
        "--problem", metavar="PROBLEM", help="Problem instead of a suite; repeatable.", rich_help_panel=SELECTION
    ),
]
"""Names of problems."""

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document.", rich_help_panel=OUTPUT)]
"""Print one JSON document on standard output and nothing else."""

Charts = Annotated[bool, typer.Option("--charts/--no-charts", help="Draw charts.", rich_help_panel=OUTPUT)]
"""Draw charts beside the tables."""

Progress = Annotated[bool, typer.Option("--progress/--no-progress", help="Show the progress.", rich_help_panel=OUTPUT)]
"""Show on standard error how far the command is."""

Quiet = Annotated[
    bool, typer.Option("--quiet", help="Print errors and the places of files only.", rich_help_panel=OUTPUT)
]
"""Print nothing but errors and where the files are."""
