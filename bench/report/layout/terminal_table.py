"""Tables and notes that fit the terminal: names wrapped at options, columns that matter least left out."""

import re
import textwrap
from collections.abc import Collection, Sequence
from typing import Any

import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

INDENT = "  "
"""Before the further lines of a name."""


def wrapped_name(name: str, width: int) -> str:
    """Return the name of a solver in lines of at most ``width`` characters, broken between options only.

    A piece that is longer than that has a line of its own.
    """
    lines: list[str] = []
    for piece in _pieces(name):
        if lines and len(lines[-1]) + len(piece.rstrip()) <= width:
            lines[-1] += piece
        else:
            lines.append((INDENT if lines else "") + piece)
    return "\n".join(line.rstrip() for line in lines)


def narrowest(name: str) -> int:
    """Return the least width to which ``wrapped_name`` can wrap a name."""
    first, *rest = (len(piece.rstrip()) for piece in _pieces(name))
    return max([first, *(len(INDENT) + length for length in rest)])


def fitted(shown: pd.DataFrame, width: int, optional: Sequence[str]) -> pd.DataFrame:
    """Return a table of texts that fits ``width`` characters, as far as it can.

    Args:
        shown: the table; its column "solver" holds names with options.
        width: of the terminal.
        optional: columns that may be left out, those first that matter least.
    """
    shown = shown.astype(str)
    least = max(map(narrowest, shown["solver"]), default=0)
    widths = {column: _width(shown, column) + 1 for column in shown.columns if column != "solver"}
    for column in optional:
        if least + sum(widths.values()) > width:
            widths.pop(column, None)
    room = max(least, width - sum(widths.values()))
    names = [wrapped_name(name, room) for name in shown["solver"]]
    return shown[[column for column in shown.columns if column in ("solver", *widths)]].assign(solver=names)


def print_table(
    console: Console,
    shown: pd.DataFrame,
    *,
    words: Sequence[str] = (),
    optional: Sequence[str] = (),
    bold: Collection[tuple[Any, str]] = (),
) -> None:
    """Print a table, fitted to the width of the console.

    Args:
        console: where to.
        shown: the table, with a column "solver".
        words: columns of words, which stand on the left; the others stand on the right.
        optional: columns that may be left out, as in ``fitted``.
        bold: index and column of the cells that are marked.
    """
    fitting = fitted(shown, console.width, optional)
    is_loose = sum(_width(fitting, column) + 2 for column in fitting.columns) <= console.width
    table = Table(
        box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, int(is_loose), 0, 0), show_edge=False
    )
    for column in fitting.columns:
        is_text = column == "solver" or column in words
        table.add_column(column, justify="left" if is_text else "right", no_wrap=column != "solver", overflow="fold")
    for index, row in zip(fitting.index, fitting.itertuples(index=False), strict=True):
        cells = zip(fitting.columns, row, strict=True)
        styled = (Text(cell, style="bold green" if (index, column) in bold else "") for column, cell in cells)
        table.add_row(*styled)
    console.print(table)


def hanging(note: str, width: int) -> str:
    """Return a note in lines of at most ``width`` characters, the further ones indented."""
    return textwrap.fill(note, width, initial_indent=INDENT, subsequent_indent=2 * INDENT, break_on_hyphens=False)


def _pieces(name: str) -> list[str]:
    """Return the parts between which a name may be broken: behind an opening bracket, and between options."""
    return re.split(r"(?<=\()|(?<=, )", name)


def _width(shown: pd.DataFrame, column: str) -> int:
    lines = [line for text in (column, *shown[column]) for line in text.splitlines()]
    return max(map(len, lines), default=0)
