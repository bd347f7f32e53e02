"""Tables and notes that fit the terminal: less important columns are omitted, names are wrapped between options."""

import textwrap
from collections.abc import Collection, Sequence
from itertools import product
from typing import Any

import pandas as pd
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

INDENT = "  "
"""Indentation of a note; its continuation lines have twice as much."""


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
        words: columns of words, aligned to the left; other columns are aligned to the right.
        optional: columns that may be omitted, the least important first.
        bold: index and column of bold cells.
    """
    for left_out, gap in product(range(len(optional) + 1), (2, 1)):
        chosen = shown.drop(columns=list(optional[:left_out]), errors="ignore").astype(str)
        if sum(_least_width(chosen[column]) + gap for column in chosen) - gap <= console.width:
            break
    table = Table(box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, gap - 1, 0, 0), show_edge=False)
    for column in chosen.columns:
        is_text = column == "solver" or column in words
        table.add_column(
            Text(column), justify="left" if is_text else "right", no_wrap=column != "solver", overflow="fold"
        )
    for index, row in zip(chosen.index, chosen.itertuples(index=False), strict=True):
        cells = zip(chosen.columns, row, strict=True)
        table.add_row(*(Text(cell, style="bold green" if (index, column) in bold else "") for column, cell in cells))
    console.print(table)


def _least_width(column: "pd.Series[str]") -> int:
    """Return the width of the longest text of a column; names of solvers are wrapped at spaces."""
    texts = (str(column.name), *column)
    return max(len(part) for text in texts for part in (text.split() if column.name == "solver" else [text]))


def abreast(shown: pd.DataFrame, width: int) -> list[list[str]]:
    """Return the columns of a table, except for the solvers, in groups that fit the width."""
    room = width - _least_width(shown["solver"]) - 2
    groups: list[list[str]] = []
    left = 0
    for name in shown.columns.drop("solver"):
        size = _least_width(shown[name]) + 2
        if not groups or size > left:
            groups.append([])
            left = room
        groups[-1].append(name)
        left -= size
    return groups


def hanging(note: str, width: int) -> str:
    """Return a note in lines of at most ``width`` characters, with indented continuation lines."""
    return textwrap.fill(note, width, initial_indent=INDENT, subsequent_indent=2 * INDENT, break_on_hyphens=False)
