"""Tables and notes that fit the terminal.

Wide tables omit their least important columns and wrap the names of solvers between options.
"""

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
"""Indentation of a note; its continuation lines are indented twice as far."""


def print_table(
    console: Console,
    table: pd.DataFrame,
    *,
    left_aligned: Sequence[str] = (),
    optional: Sequence[str] = (),
    bold: Collection[tuple[Any, str]] = (),
) -> None:
    """Print a table, and omit as many optional columns as necessary to fit the width of the console.

    Args:
        console: where to print.
        table: the table; names of solvers in a column "solver" are wrapped at spaces.
        left_aligned: columns aligned to the left, in addition to "solver"; others are aligned to the right.
        optional: columns that may be omitted, the least important first.
        bold: index and column of bold cells.
    """
    for n_omitted, gap in product(range(len(optional) + 1), (2, 1)):
        shown = table.drop(columns=list(optional[:n_omitted]), errors="ignore").astype(str)
        if sum(_min_width(shown[column]) + gap for column in shown) - gap <= console.width:
            break
    printed = Table(
        box=box.SIMPLE_HEAD, header_style="dim", pad_edge=False, padding=(0, gap - 1, 0, 0), show_edge=False
    )
    for column in shown.columns:
        is_left_aligned = column == "solver" or column in left_aligned
        printed.add_column(
            Text(column), justify="left" if is_left_aligned else "right", no_wrap=column != "solver", overflow="fold"
        )
    for index, row in zip(shown.index, shown.itertuples(index=False), strict=True):
        cells = zip(shown.columns, row, strict=True)
        printed.add_row(*(Text(cell, style="bold green" if (index, column) in bold else "") for column, cell in cells))
    console.print(printed)


def _min_width(column: "pd.Series[str]") -> int:
    """Return the smallest width of a column [characters]; names of solvers are wrapped at spaces."""
    texts = (str(column.name), *column)
    return max(len(part) for text in texts for part in (text.split() if column.name == "solver" else [text]))


def column_groups(table: pd.DataFrame, width: int) -> list[list[str]]:
    """Return the names of all columns except "solver" in groups.

    A table of the column "solver" and one group has at most ``width`` characters per line, unless a single column is
    wider.
    """
    available = width - _min_width(table["solver"]) - 2
    groups: list[list[str]] = []
    remaining = 0
    for name in table.columns.drop("solver"):
        needed = _min_width(table[name]) + 2
        if not groups or needed > remaining:
            groups.append([])
            remaining = available
        groups[-1].append(name)
        remaining -= needed
    return groups


def wrap_note(note: str, width: int) -> str:
    """Return an indented note in lines of at most ``width`` characters, with continuation lines indented further."""
    return textwrap.fill(note, width, initial_indent=INDENT, subsequent_indent=2 * INDENT, break_on_hyphens=False)
