"""Text in reports: counts, JSON, and escaped text in Markdown, LaTeX and CSV."""

import json
import math
import re
import shutil
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from ....problems.representation import counted as counted
from ....problems.representation import first_names

PIPE_WIDTH = 1000
"""Line width for files and pipes, so that names and commands are not wrapped."""

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\n")
"""Characters that begin a formula in a spreadsheet, from OWASP's page on CSV injection, as in ``page/elements.js``."""


def output_width() -> int:
    """Return the width of standard output: COLUMNS if set, else that of the terminal, else ``PIPE_WIDTH``."""
    return shutil.get_terminal_size((PIPE_WIDTH, 24)).columns


def inline(value: object) -> str:
    """Return ``value`` as text in one line or table cell, with HTML markup and cell separators escaped."""
    line = re.sub(r"\s*[\r\n]\s*", " ", str(value))
    return escape(line, quote=False).replace("|", r"\|")


def markdown_table(headings: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """Return a Markdown table; the caller escapes the cells with ``inline``."""
    columns = list(map(str, headings))
    lines = (map(str, line) for line in (columns, ["---"] * len(columns), *rows))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def markdown_frame(shown: Any) -> str:
    """Return a pandas frame of strings as a Markdown table, with escaped cells."""
    return markdown_table(map(inline, shown.columns), shown.map(inline).itertuples(index=False))


def latex_table(shown: Any) -> str:
    """Return a pandas frame of strings as a LaTeX table with ``booktabs`` rules; text between ``**`` becomes bold."""
    columns = [str(column).replace("\n", " ") for column in shown.columns]
    styled = shown.set_axis(columns, axis="columns").style.hide(axis="index")
    latex: str = styled.format(escape="latex").format_index(escape="latex", axis="columns").to_latex(hrules=True)
    return re.sub(r"\*\*(.+?)\*\*", r"\\textbf{\1}", latex).replace("≈", r"$\approx$")


def csv_content(table: Any) -> bytes:
    """Return a pandas frame as CSV without cells that a spreadsheet would execute as formulas.

    An apostrophe is put before a string that begins like a formula, so that spreadsheets show it as text. Strings that
    are numbers, and all other values, do not change. Carriage returns become line feeds.
    """
    content: str = table.rename(columns=_inert).map(_inert).to_csv(index=False)
    return content.encode()


def _inert(value: Any) -> Any:
    """Return a value that a spreadsheet does not execute; see ``csv_content``."""
    if not isinstance(value, str):
        return value
    text = value.replace("\r\n", "\n").replace("\r", "\n")  # pandas does not quote \r, which would end the row
    if not text.startswith(FORMULA_STARTS):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def titled_names(title: str, names: Sequence[str], max_names: int) -> str:
    """Return a title with the ``first_names`` after a colon; empty without names."""
    return f"{title}: {first_names(names, max_names)}" if names else ""


def print_json(document: Any) -> None:
    """Print one JSON document, with null for numbers that are not finite."""
    print(json.dumps(_with_finite_numbers(document), indent=1, ensure_ascii=False, allow_nan=False), flush=True)


def _with_finite_numbers(document: Any) -> Any:
    """Return a document whose NaN and infinite numbers are None, because JSON has none."""
    if isinstance(document, dict):
        return {key: _with_finite_numbers(value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [_with_finite_numbers(value) for value in document]
    return None if isinstance(document, float) and not math.isfinite(document) else document


def json_records(table: Any) -> list[dict[str, Any]]:
    """Return the rows of a pandas frame as JSON values, with null for numbers that are not finite."""
    rows: list[dict[str, Any]] = json.loads(table.to_json(orient="records"))
    return rows


def unsolved_words(number: int, steps: int, tolerance: str) -> str:
    """Return a clause on the number of unsolved steps, as in ``"1 of 20 steps is not solved to 1e-04"``."""
    return f"{number} of {counted(steps, 'step')} {'is' if number == 1 else 'are'} not solved to {tolerance}"


def overlap_words(number: int) -> str:
    """Return a clause on the number of steps whose projection of positions did not reach its tolerance."""
    steps = counted(number, "step")
    return f"bodies overlap too deeply after {steps}: the projection of positions did not reach its tolerance"
