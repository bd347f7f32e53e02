"""Words and text in reports: numbers of things, JSON, and text of others that stays text in Markdown and CSV."""

import json
import re
import shutil
from collections.abc import Iterable
from html import escape
from typing import Any

from ....problems.representation import counted as counted

PIPE_WIDTH = 1000
"""Characters of a line that goes to a file or a pipe: names and commands stay in one piece there."""


FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\n")
"""What a spreadsheet takes as the beginning of a formula, after OWASP's page on CSV injection."""


def output_width() -> int:
    """Return the width of standard output: of the terminal, else ``PIPE_WIDTH``; COLUMNS goes before both."""
    return shutil.get_terminal_size((PIPE_WIDTH, 24)).columns


def inline(value: object) -> str:
    """Return ``value`` as text for a line or a table cell, in which nothing is markup of HTML or ends the cell."""
    return escape(str(value), quote=False).replace("|", r"\|")


def markdown_table(head: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """Return a table in Markdown, of texts that ``inline`` has been through."""
    heads = list(map(str, head))
    lines = (map(str, line) for line in (heads, ["---"] * len(heads), *rows))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def markdown_frame(shown: Any) -> str:
    """Return a frame of texts as a table in Markdown, none of whose cells is markup of HTML."""
    heads = [inline(column).replace("\n", " ") for column in shown.columns]
    return markdown_table(heads, shown.map(inline).itertuples(index=False))


def latex_table(shown: Any) -> str:
    """Return a frame of texts as a LaTeX table with rules of ``booktabs``; texts between ``**`` become bold."""
    heads = [str(column).replace("\n", " ") for column in shown.columns]
    styled = shown.set_axis(heads, axis="columns").style.hide(axis="index")
    made: str = styled.format(escape="latex").format_index(escape="latex", axis="columns").to_latex(hrules=True)
    return re.sub(r"\*\*(.+?)\*\*", r"\\textbf{\1}", made).replace("≈", r"$\approx$")


def csv_content(table: Any) -> bytes:
    """Return a frame of pandas as a CSV file, in which a spreadsheet runs nothing.

    A text that begins like a formula gets an apostrophe before it, by which spreadsheets show it as text; texts that
    are numbers, and all other values, stay as they are. Carriage returns become line feeds.
    """
    content: str = table.rename(columns=_inert).map(_inert).to_csv(index=False)
    return content.encode()


def _inert(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    text = value.replace("\r\n", "\n").replace("\r", "\n")  # pandas quotes no \r, which would end the row
    if not text.startswith(FORMULA_STARTS):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def print_json(document: Any) -> None:
    """Print one JSON document."""
    print(json.dumps(document, indent=1, ensure_ascii=False), flush=True)


def json_records(table: Any) -> list[dict[str, Any]]:
    """Return the rows of a frame of pandas as a JSON document has them, numbers that are not finite as null."""
    rows: list[dict[str, Any]] = json.loads(table.to_json(orient="records"))
    return rows


def unsolved_words(number: int, steps: int, tolerance: str) -> str:
    """Say how many of all steps are not solved: ``"1 of 20 steps is not solved to 1e-04"``."""
    return f"{number} of {counted(steps, 'step')} {'is' if number == 1 else 'are'} not solved to {tolerance}"
