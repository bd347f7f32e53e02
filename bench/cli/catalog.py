"""The commands ``proxbench list`` and ``proxbench generate``."""

from pathlib import Path
from typing import Annotated

import typer

from . import options


def list_names(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="List only solvers, suites, problems or scenes.")] = "",
    name: Annotated[str, typer.Argument(metavar="NAME", help="List only the entry with this name.")] = "",
    suite: Annotated[str, options.selection(metavar="SUITE", help="List only the problems of this suite.")] = "",
    plugin: options.PluginFiles = None,
    as_json: options.Json = False,
) -> None:
    """List solvers, suites, problems and scenes."""
    from ..report.layout.text import print_json
    from .listing import listing_rows, print_listing

    has_sizes = bool(kind) or as_json  # a list of all kinds only counts problems
    rows = listing_rows(kind, suite, name, has_sizes=has_sizes)
    if as_json:
        print_json(rows)
    else:
        print_listing(rows, with_options=bool(name))


def generate(
    names: Annotated[list[str] | None, typer.Argument(metavar="PROBLEM", help="Problems to generate.")] = None,
    suite: Annotated[
        str, options.selection(metavar="SUITE", help="Generate all problems of this suite that come from scenes.")
    ] = "",
    output: Annotated[
        Path | None, options.output(metavar="FOLDER", help="Folder for the files; the cache by default.")
    ] = None,
    plugin: options.PluginFiles = None,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Generate problems from their scenes.

    Print the name of each file and the digest of its problem.
    """
    from ...problems.exchange.catalog import suite_members
    from ...problems.exchange.files.problem_file import read_problem
    from ...problems.hard import HARD_CASES
    from ..errors import BenchError
    from ..report.layout.text import print_json
    from ..simulation.generation.generate import generate as generate_problems
    from .exchange.problem_files import print_files

    all_names = list(names or [])
    if suite:
        all_names += [name for name in suite_members(suite) if name not in HARD_CASES and name not in all_names]
        if not all_names:
            raise BenchError(f"no problem of the suite {suite!r} comes from a scene; load its problems by name.")
    if not all_names:
        raise BenchError("no problems to generate are given; name problems, or give a --suite.")
    digests = {str(file): read_problem(file).digest for file in generate_problems(all_names, output)}
    if as_json:
        print_json(digests)
    else:
        print_files(digests, quiet)
