"""``proxbench matrix``, the command."""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .options import PluginFiles


def matrix(
    suite: Annotated[str, typer.Option(help="Suite of problems.")] = "hard",
    problem: Annotated[list[str] | None, typer.Option(help="Problem instead of a suite; may be repeated.")] = None,
    solver: Annotated[
        list[str] | None, typer.Option(help="Solver with options, SORprox(relaxation=1.5); all if left out.")
    ] = None,
    tolerance: Annotated[float, typer.Option(help="Judged residual to reach.")] = 1e-8,
    solve_seconds: Annotated[float, typer.Option(help="Time limit of one solve [s].")] = 5.0,
    max_iterations: Annotated[int, typer.Option(help="Largest number of iterations of one solve.")] = 200_000,
    output: Annotated[Path | None, typer.Option(help="Markdown page to write; printed if left out.")] = None,
    plugin: PluginFiles = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document on standard output, nothing else.")
    ] = False,
) -> int:
    """Solve every problem once with every solver, and say why wherever one does not solve; nothing is timed."""
    from ...problems.catalog.catalog import suite_members
    from ...solvers.interface import Stop
    from ..errors import BenchError
    from ..measure.matrix import Cell, default_solvers, measured_matrix
    from ..report.matrix import count_bad, matrix_page

    if output is not None and not output.parent.is_dir():
        raise BenchError(f"cannot write {output}: there is no folder {output.parent}.")
    names, methods = list(problem or suite_members(suite)), list(solver or default_solvers())
    done = 0

    def show(cell: Cell) -> None:
        nonlocal done
        done += 1
        if sys.stderr.isatty():
            print(f"\r\x1b[K{done}/{len(names) * len(methods)} {cell.solver} {cell.problem}", end="", file=sys.stderr)

    cells = measured_matrix(names, methods, Stop(tolerance, max_iterations, solve_seconds), on_cell=show)
    if sys.stderr.isatty():
        print("\r\x1b[K", end="", file=sys.stderr)
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
        print(f"{len(cells)} cells, {count_bad(cells)} of them wrong or at fault: {output}")
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
