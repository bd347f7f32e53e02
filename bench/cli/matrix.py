"""``proxbench matrix``, the command."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .help import OUTPUT
from .options import LIMITS, SELECTION, Json, PluginFiles, Problems, Progress, Quiet, Solvers, refuse_two_prints


def matrix(
    suite: Annotated[str, typer.Option(metavar="SUITE", help="Suite of problems.", rich_help_panel=SELECTION)] = "hard",
    problem: Problems = None,
    solver: Solvers = None,
    tolerance: Annotated[float, typer.Option(help="Residual to reach.", rich_help_panel=LIMITS)] = 1e-8,
    solve_seconds: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time of one solve.", rich_help_panel=LIMITS)
    ] = 5.0,
    max_iterations: Annotated[int, typer.Option(help="Iterations of one solve.", rich_help_panel=LIMITS)] = 200_000,
    output: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Markdown page; printed if left out.", rich_help_panel=OUTPUT)
    ] = None,
    plugin: PluginFiles = None,
    quiet: Quiet = False,
    as_json: Json = False,
    progress: Progress = True,
) -> int:
    """Solve every problem once with every solver; say why where one does not solve. Times are not compared."""
    from rich.console import Console

    from ...problems.catalog.catalog import suite_members
    from ...solvers.interface import Stop
    from ..errors import BenchError
    from ..measure.matrix import Cell, default_solvers, measured_matrix
    from ..report.matrix import count_bad, matrix_page
    from ..report.progress import ProgressBar

    refuse_two_prints(quiet, as_json)
    if quiet and output is None:
        raise BenchError("--quiet prints no page; name a file for it: --output FILE.")
    if output is not None and not output.parent.is_dir():
        raise BenchError(f"cannot write {output}: there is no folder {output.parent}.")
    names, methods = list(problem or suite_members(suite)), list(solver or default_solvers())
    with ProgressBar(Console(stderr=True), hidden=not progress or quiet or as_json) as shown:
        shown.count(0, len(names) * len(methods))

        def show(cell: Cell) -> None:
            shown.name(f"{cell.solver} on {cell.problem}", again=True)
            shown.advance()

        cells = measured_matrix(names, methods, Stop(tolerance, max_iterations, solve_seconds), on_cell=show)
    if as_json:
        print(json.dumps([asdict(cell) for cell in cells], indent=1, ensure_ascii=False))
        return int(count_bad(cells) > 0)
    page = matrix_page(cells, tolerance, _command(suite, problem, solver, tolerance, output))
    if output is None:
        print(page, end="")
    else:
        try:
            output.write_text(page, encoding="utf-8")
        except OSError as error:
            raise BenchError(f"cannot write {output}: {error.strerror}; choose another file.") from None
        if not quiet:
            print(f"{len(cells)} cells, {count_bad(cells)} of them wrong or at fault")
        print(f"matrix   {output}")
    return int(count_bad(cells) > 0)


def _command(
    suite: str, problems: list[str] | None, solvers: list[str] | None, tolerance: float, output: Path | None
) -> str:
    """Return the command line that makes the page again."""
    words = ["proxbench matrix"]
    words += [f"--problem {name}" for name in problems or []] or [f"--suite {suite}"]
    words += [f'--solver "{name}"' for name in solvers or []]
    words += [f"--tolerance {tolerance:g}"] if tolerance != 1e-8 else []
    return " ".join([*words, f"--output {output}"] if output is not None else words)
