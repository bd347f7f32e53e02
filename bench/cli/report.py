"""The command ``proxbench report``, and the output of a finished run."""

from collections.abc import Collection, Iterator
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import options

if TYPE_CHECKING:
    from ..report.build_report import Report
    from ..runs import Run
    from ..store.frames import RunFrames

MAX_NAMES = 5
"""Largest number of damaged files that a message names."""


def report(
    context: typer.Context,
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="Folder or bundle of a run, or simulation (.npz).")],
    problem: Annotated[
        list[str] | None,
        options.selection("--problem", metavar="PROBLEM", help="Print only the tables of this problem; repeatable."),
    ] = None,
    page: Annotated[bool, options.flag("--page", help="Write one offline page of a run, and nothing else.")] = False,
    baseline: Annotated[str, options.output(metavar="SOLVER", help="Baseline of speed-ups.")] = "",
    profiles: options.Profiles = "common",
    plugin: options.PluginFiles = None,
    residual: options.Residual = "judged",
    charts: options.Charts = True,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Print the tables of a stored result and draw its charts again.

    With --problem, the tables show only these problems, and no file is
    written. With --page, only the offline page of the run is written.
    """
    _require_consistent_options(result, options.given_parameters(context), charts)
    if _is_simulation(result):
        from .simulation.show import report_simulation

        return report_simulation(result, charts, quiet, as_json)
    from ..runs import load

    run = load(result)
    if problem:
        return print_problems(run, problem, as_json, residual)
    if page:
        return report_page(run, quiet, as_json, residual, baseline)
    return report_run(run, charts, quiet, as_json, residual, baseline=baseline, profiles=profiles)


def _is_simulation(result: Path) -> bool:
    return result.suffix == ".npz" and not result.is_dir()


def _require_consistent_options(result: Path, specified: Collection[str], charts: bool) -> None:
    """Raise ``BenchError`` if options of ``report`` contradict each other or the result."""
    if _is_simulation(result):
        run_options = ("problem", "page", "baseline", "profiles", "residual")
        options.require_absent(run_options, specified, f"applies to runs, but {result} is a simulation")
    options.require_exclusive("problem", ("page", "baseline", "profiles", "quiet"), specified)
    options.require_exclusive("page", ["profiles"], specified)
    if not charts:
        options.require_absent(["page", "profiles"], specified, "draws charts, but --no-charts omits them")


def report_run(
    run: "Run",
    charts: bool,
    quiet: bool,
    as_json: bool,
    residual: str = "judged",
    *,
    record: bool = False,
    baseline: str = "",
    page: bool = False,
    profiles: str = "common",
) -> int:
    """Print the tables of a run, then write its files; return 1 if a case failed, or is missing, damaged or omitted.

    Tables are printed first, so that they are shown even if no file can be written; a message on standard error then
    gives the reason. With ``quiet``, a file that cannot be written is an error.

    Args:
        run: the run.
        charts: whether to draw charts.
        quiet: print only the paths of the files.
        as_json: print one JSON document instead.
        residual: residual that tables and charts use, "judged" or "local".
        record: whether to record the iterations.
        baseline: baseline of speed-ups; if empty, the solver that solves the most problems.
        page: whether to write the page; a study has none.
        profiles: problems that profiles cover, "common" to all solvers or "all".

    Raises:
        BenchError: if a link leads out of the folder of the run, a recording cannot be written, the run has no such
            baseline or no readable case, or with ``quiet`` if files cannot be written.
    """
    from rich.console import Console

    from ..errors import BenchError
    from ..report.layout.text import output_width, print_json
    from ..report.profiles import baseline_of
    from ..report.tables import print_tables

    frames, console = run.judged_by(residual), Console(width=output_width())
    if baseline:
        baseline_of(frames, baseline)
    _report_damage(run)
    left_out = [options.with_option_names(sentence) for sentence in run.info.plan.left_out]
    options.print_notes(*left_out)
    if quiet or as_json:
        _report_unfinished(frames)
    else:
        print_tables(frames, console)
        console.print()
    if record:
        from ..recordings.solves import record_run

        record_run(run.folder)
    outputs = run.report(charts, residual, baseline, page, profiles=profiles)
    if outputs.unwritten and quiet:
        raise BenchError(outputs.unwritten)
    if as_json:
        print_json(_document(run, outputs, residual))
    else:
        console.print("\n".join(_file_lines(run, outputs)), soft_wrap=True, highlight=False, markup=False)
    if outputs.unwritten:
        options.print_notes(outputs.unwritten)
    return 1 if left_out else _exit_code(run, run)


def report_page(run: "Run", quiet: bool, as_json: bool, residual: str, baseline: str) -> int:
    """Write the page of a run and print its path; return 1 if a case failed, or is missing or damaged."""
    from ..report.layout.text import print_json

    _report_damage(run)
    file = run.page(residual, baseline)
    _report_unfinished(run)
    if as_json:
        print_json({"run": str(run.folder), "page": str(file)})
    else:
        print(file if quiet else f"page     {file}")
    return _exit_code(run, run)


def print_problems(run: "Run", problems: Collection[str], as_json: bool, residual: str) -> int:
    """Print the tables of some problems; return 1 if one of their cases failed or is missing, or a file is damaged.

    Raises:
        BenchError: if the run has no such problem.
    """
    from rich.console import Console

    from ..report.accuracy import problems_table
    from ..report.layout.text import json_records, output_width, print_json
    from ..report.tables import print_tables, results_table

    _report_damage(run)
    frames = run.only(problems).judged_by(residual)
    if as_json:
        _report_unfinished(frames)
        tables = {"problems": problems_table(frames), "results": results_table(frames)}
        records = {name: json_records(table) for name, table in tables.items()}
        print_json({"run": str(run.folder), "residual": residual, **records})
    else:
        print_tables(frames, Console(width=output_width()))
    return _exit_code(run, frames)


def _report_damage(run: "Run") -> None:
    """Print which case files are damaged or not planned; raise ``BenchError`` if no other case can be read."""
    from ...problems.representation import first_names
    from ..errors import BenchError

    if run.damaged and run.cases.empty:
        names = [sentence.partition(" ")[0] for sentence in run.damaged]
        raise BenchError(
            f"no case of {run.folder} can be used (damaged or not planned: {first_names(names, MAX_NAMES)}); "
            f"measure them again with: proxbench run --resume {quote(str(run.folder))}"
        )
    options.print_notes(*run.damaged)


def _report_unfinished(frames: "RunFrames") -> None:
    """Print which cases are missing or only partly measured, for output without tables."""
    from ..store.condition import unfinished

    options.print_notes(*unfinished(frames))


def _exit_code(run: "Run", shown: "RunFrames") -> int:
    """Return 1 if a case that is shown failed or is missing, a shard is missing, or a file is damaged; else 0."""
    is_complete = shown.is_finished and not run.info.plan.missing_shards
    return int(_has_failed(shown) or bool(run.damaged) or not is_complete)


def _has_failed(frames: "RunFrames") -> bool:
    """Return whether a case failed or made a wrong claim."""
    from ..store.outcome import FAULTS, Outcome

    return bool(frames.cases["outcome"].isin(FAULTS).any() or (frames.points["outcome"] == Outcome.WRONG).any())


def _document(run: "Run", outputs: "Report", residual: str) -> dict[str, Any]:
    """Return a run and its report as one JSON document."""
    from ..report.layout.text import json_records
    from ..store.conversion import content_of

    return {
        "run": str(run.folder),
        "is_finished": run.is_finished,
        "residual": residual,
        "info": content_of(run.info),
        "results": json_records(outputs.results),
        "summary": json_records(outputs.summary),
        "files": [str(file) for file in (*outputs.tables, *outputs.charts, *([outputs.page] if outputs.page else []))],
        "unwritten": outputs.unwritten,
        "damaged": run.damaged,
    }


def _file_lines(run: "Run", outputs: "Report") -> Iterator[str]:
    """Yield one line for each kind of file, with its path."""
    yield f"results  {run.folder}"
    for kind, files in (("tables", outputs.tables), ("charts", outputs.charts)):
        if files:
            yield f"{kind}   {files[0].parent}"
    if outputs.page:
        yield f"page     {outputs.page}"
    if (run.output_folder / "recordings").is_dir():
        yield f"watch    rerun {run.output_folder / 'recordings'}/NAME.rrd"
