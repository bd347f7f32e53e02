"""The option ``--plugin FILE`` of every command that takes names of solvers or problems."""

from pathlib import Path
from typing import Annotated

import typer


def _take_into_use(paths: list[Path] | None) -> list[Path] | None:
    if paths:
        from ..measure.plugins import use_plugin_files

        use_plugin_files(paths)
    return paths


PluginFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin", help="Python file that offers solvers or problems; may be repeated.", callback=_take_into_use
    ),
]
"""Plugin files; they are in use when the command begins."""
