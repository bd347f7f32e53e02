"""The command ``proxbench matrix``."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from .. import options

if TYPE_CHECKING:
    from ....problems.contact.solver import Stop

DEFAULT_TOLERANCE, DEFAULT_SECONDS, DEFAULT_ITERATIONS = 1e-8, 5.0, 200_000
"""Default judged residual to reach, time limit [s] and iteration limit of a solve."""


def matrix(
    suite: options.Suite = "hard",
    problem: options.Problems = None,
    sample: options.Sample = None,
    sampling: options.Sampling = "proportional",
    solver: options.Solvers = None,
    tolerance: Annotated[float, options.limits(metavar="NUMBER", help="Residual to reach.")] = DEFAULT_TOLERANCE,
    solve_seconds: options.SolveSeconds = DEFAULT_SECONDS,
    max_iterations: Annotated[
        int, options.limits(metavar="NUMBER", help="Iteration limit of one solve.")
    ] = DEFAULT_ITERATIONS,
    output: Annotated[
        Path | None,
        options.output(metavar="FILE", help="Markdown page, with a CSV file of all cells; printed if omitted."),
    ] = None,
    plugin: options.PluginFiles = None,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Show which solvers solve which problems, with the reason for each failure. Times are not compared."""
    from ....problems.contact.solver import Stop
    from ...errors import BenchError, UnwritableError
    from ...measure.contacts.matrix import default_solvers, measure_matrix
    from ...measure.selection import select
    from ...report.layout.output_file import write_file
    from ...report.layout.text import counted, csv_content, print_json
    from ...report.matrix import count_bad, matrix_page, matrix_table
    from ...report.page.commands import option, plugin_options, sample_options
    from ...store.outcome import Cell
    from ..progress import ProgressBar

    if quiet and output is None:
        raise BenchError("--quiet does not print the page; write it to a file with --output FILE.")
    table = None if output is None else _table_file(output)
    stop = Stop(tolerance, max_iterations, solve_seconds)
    selection, solvers = select(problem, suite, sample, sampling=sampling), list(solver or default_solvers())
    with ProgressBar(not progress or quiet or as_json) as bar:
        bar.count(0, len(selection.problems) * len(solvers))

        def show(cell: Cell) -> None:
            bar.name(f"{cell.solver} on {cell.problem}", bar_only=True)
            bar.count_one()

        cells = measure_matrix(selection.problems, solvers, stop, on_cell=show)
    options.print_notes(*map(options.with_option_names, selection.left_out))
    selected = [option("problem", name) for name in problem or []] or [option("suite", suite)]
    selected += [*sample_options(sample, sampling), *(option("solver", name) for name in solver or [])]
    command = _command([*selected, *plugin_options(plugin or [])], stop, output)
    page = matrix_page(cells, tolerance, command, table=table.name if table is not None else "")
    if as_json:
        print_json([asdict(cell) for cell in cells])
    elif output is None or table is None:
        print(page, end="")
    else:
        try:
            write_file(output, page.encode())
            write_file(table, csv_content(matrix_table(cells)))
        except UnwritableError:
            print(matrix_page(cells, tolerance, command), end="")  # keep the result of a long measurement
            raise
        if not quiet:
            print(f"{counted(len(cells), 'cell')}, {count_bad(cells)} of them wrong or with a failed process")
        print(f"matrix   {output}")
        print(f"table    {table}")
    return int(count_bad(cells) > 0 or bool(selection.left_out))


def _table_file(output: Path) -> Path:
    """Return the path of the CSV file of the cells, next to the page ``output``.

    Raises:
        BenchError: if the page or the CSV file cannot be written, or both are the same file.
    """
    from ...errors import BenchError
    from ...report.layout.output_file import check_writable

    if not output.parent.is_dir():
        raise BenchError(f"cannot write {output}: there is no folder {output.parent}.")
    table = output.with_suffix(".csv")
    if table == output:
        raise BenchError(
            f"cannot write {output}: the CSV file of the cells would replace the page; name a file that ends in .md."
        )
    check_writable([output, table], force=True)
    return table


def _command(selected: list[str], stop: "Stop", output: Path | None) -> str:
    """Return the command line that reproduces the page, with options for the ``selected`` problems and solvers."""
    from ...report.page.commands import option, shortest

    words = ["proxbench matrix", *selected]
    words += [option("tolerance", shortest(stop.tolerance))] if stop.tolerance != DEFAULT_TOLERANCE else []
    words += [option("solve-seconds", shortest(stop.max_seconds))] if stop.max_seconds != DEFAULT_SECONDS else []
    words += [option("max-iterations", stop.max_iterations)] if stop.max_iterations != DEFAULT_ITERATIONS else []
    return " ".join([*words, option("output", output)] if output is not None else words)
