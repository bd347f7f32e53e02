"""How a command prints its result: JSON, or tables and the files that were written."""

import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

from ..report.text import print_json

FILE_WIDTH = 120
"""Columns of a table that goes to a file or a pipe."""


def present(
    document: Callable[[], Mapping[str, Any]],
    show: Callable[[Console], None],
    files: Iterable[tuple[str, str | Path]],
    as_json: bool,
    width: int = FILE_WIDTH,
    quiet: bool = False,
) -> None:
    """Print one JSON document, or tables and a line for each file.

    Args:
        document: makes what ``--json`` prints.
        show: prints the tables.
        files: what each file is, and its path or how it is opened; those that take long to make, or may fail to be
            made, are best yielded last, when everything else is printed already.
        as_json: print the document and nothing else; the files are made all the same.
        width: columns of tables that go to a file or a pipe.
        quiet: leave the tables out.
    """
    console = Console(width=None if sys.stdout.isatty() else width, quiet=as_json)
    if as_json:
        print_json(document())
    elif not quiet:
        show(console)
        console.print()
    for what, path in files:
        console.print(f"{what:<8}{path}", soft_wrap=True, highlight=False)
