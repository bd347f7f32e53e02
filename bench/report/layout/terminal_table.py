"""Tables and notes that fit the terminal: columns that matter least are left out, names are wrapped between options."""

import textwrap
from collections.abc import Collection, Sequence
from itertools import product
from typing import Any

import pandas as pd
from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

INDENT = "  "
"""Before a note; its further lines have two."""


def print_table(
    console: Console,
    shown: pd.DataFrame,
    *,
    words: Sequence[str] = (),
    optional: Sequence[str] = (),
    bold: Collection[tuple[Any, str]] = (),
) -> None:
    """Print a table of texts that fits the console.

    Args:
        console: where to print.
        shown: the table, with a column "solver".
        words: columns of words, which are aligned to the left; the others are aligned to the right.
        optional: columns that may be left out, those first that matter least.
        bold: index and column of the cells that are marked.
    """
    unbounded = console.options.update_width(10_000)  # a measurement is cut to the width that it is given
    for left_out, padding in product(range(len(optional) + 1), (1, 0)):
        table = _table(shown.drop(columns=list(optional[:left_out]), errors="ignore"), words, bold, padding)
        if Measurement.get(console, unbounded, table).minimum < console.width:
            break
    console.print(table)


def _table(shown: pd.DataFrame, words: Sequence[str], bold: Collection[tuple[Any, str]], padding: int) -> Table:
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, padding, 0, 0), show_edge=False)
    for column in shown.columns:
        is_text = column == "solver" or column in words
        table.add_column(column, justify="left" if is_text else "right", no_wrap=column != "solver", overflow="fold")
    for index, row in zip(shown.index, shown.astype(str).itertuples(index=False), strict=True):
        cells = zip(shown.columns, row, strict=True)
        table.add_row(*(Text(cell, style="bold green" if (index, column) in bold else "") for column, cell in cells))
    return table


def abreast(shown: pd.DataFrame, width: int) -> list[list[str]]:
    """Return the columns of a table beside that of the solvers in groups that fit side by side."""
    room = width - max(len(word) for name in shown["solver"] for word in name.split()) - 2
    groups: list[list[str]] = []
    left = 0
    for name in shown.columns.drop("solver"):
        size = max(map(len, (name, *shown[name]))) + 2
        if not groups or size > left:
            groups.append([])
            left = room
        groups[-1].append(name)
        left -= size
    return groups


def hanging(note: str, width: int) -> str:
    """Return a note in lines of at most ``width`` characters, the further ones indented."""
    return textwrap.fill(note, width, initial_indent=INDENT, subsequent_indent=2 * INDENT, break_on_hyphens=False)
