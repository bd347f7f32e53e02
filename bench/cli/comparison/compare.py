"""The command ``proxbench compare``."""

from pathlib import Path
from typing import Annotated

import typer

from .. import options


def compare(
    before: Annotated[Path, typer.Argument(metavar="BEFORE", help="Folder or bundle of the baseline run.")],
    after: Annotated[Path, typer.Argument(metavar="AFTER", help="Folder or bundle of the run to check against it.")],
    fail_on: Annotated[
        list[str] | None,
        options.output(metavar="CONDITION", help='Exit with code 1 if "time>10%" or "solved<" holds; repeatable.'),
    ] = None,
    markdown: Annotated[
        Path | None, options.output(metavar="FILE", help="Markdown file for a pull request; - prints it.")
    ] = None,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Compare two runs: list the solvers that became faster or slower, and the cases that became solved or unsolved.

    Times are comparable only on one machine. Only problems with the same digest are compared.
    """
    from rich.console import Console

    from ... import runs
    from ...errors import BenchError
    from ...report.comparison.comparison import SLOWDOWN, read_conditions
    from ...report.comparison.page import comparison_document, markdown_page, print_comparison
    from ...report.layout.output_file import check_writable, write_file
    from ...report.layout.text import output_width, print_json

    prints_markdown = markdown is not None and str(markdown) == "-"
    if prints_markdown and (quiet or as_json):
        raise BenchError("--markdown - prints a page; use it without --json and --quiet, or name a file.")
    slowdowns = [slowdown for slowdown in read_conditions(fail_on or ()).values() if slowdown is not None]
    if markdown is not None and not prints_markdown:
        check_writable([markdown], force=True)
    comparison = runs.compare(before, after, min(slowdowns, default=SLOWDOWN))
    failures = comparison.failures(fail_on or ())
    if markdown is not None and not prints_markdown:
        write_file(markdown, markdown_page(comparison, failures).encode())
    if as_json:
        print_json(comparison_document(comparison, failures))
    elif prints_markdown:
        print(markdown_page(comparison, failures), end="")
    elif not quiet:
        print_comparison(comparison, failures, Console(width=output_width()))
    if markdown is not None and not (prints_markdown or as_json):
        print(f"page     {markdown}")
    return int(bool(failures))
