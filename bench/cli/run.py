"""``proxbench run``, and what a run has to show when it is finished or reported again."""

import json
import sys
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import options

if TYPE_CHECKING:
    from ..runs import Report, Run
    from ..store.frames import RunFrames

_continued = partial(typer.Option, rich_help_panel="Continue an interrupted run")

_STORED_WITH_THE_RUN = (
    "suite",
    "sample",
    "problem",
    "solver",
    "tolerance",
    "results",
    "run_id",
    "solve_seconds",
    "case_seconds",
    "memory",
    "passes",
    "thorough",
    "seed",
)
"""Options that --resume takes from the stored run."""


def run(
    context: typer.Context,
    suite: options.Suite = "quick",
    problem: options.Problems = None,
    sample: Annotated[
        int | None, options.selection(metavar="NUMBER", help="Problems to draw, families in proportion.")
    ] = None,
    solver: options.Solvers = None,
    tolerance: Annotated[
        list[float] | None, options.selection(metavar="NUMBER", help="Accuracy to measure the time to; repeatable.")
    ] = None,
    results: Annotated[Path, options.output(metavar="FOLDER", help="Where the run gets its folder.")] = Path("results"),
    run_id: Annotated[str, options.output(metavar="NAME", help="Name of its folder; the time if left out.")] = "",
    resume: Annotated[Path | None, _continued(metavar="RUN", help="Finish the run in this folder.")] = None,
    retry_failed: Annotated[bool, _continued("--retry-failed", help="Measure its failed cases again.")] = False,
    mix: Annotated[bool, _continued("--mix", help="Also on another machine or source.")] = False,
    thorough: Annotated[bool, options.limits("--thorough", help="Ten accuracies and five passes.")] = False,
    passes: Annotated[int | None, options.limits(metavar="NUMBER", help="Passes over all problems.")] = None,
    seed: Annotated[int, options.limits(metavar="NUMBER", help="Of orders and of the sample.")] = 0,
    solve_seconds: options.SolveSeconds = 0.5,
    case_seconds: Annotated[float, options.limits(metavar="SECONDS", help="Time of one case.")] = 60.0,
    memory: Annotated[int, options.limits(metavar="MB", help="Memory of one case.")] = 2048,
    record: Annotated[bool, options.output("--record", help="Record the iterations, one file a problem.")] = False,
    plugin: options.PluginFiles = None,
    residual: options.Residual = "judged",
    charts: options.Charts = True,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Measure how long solvers take to reach an accuracy; print and store it."""
    from rich.console import Console

    from .. import runs
    from .progress import RunProgress

    _refuse_contradictions(context)
    options.refuse_two_prints(quiet, as_json)
    with RunProgress(Console(stderr=True), hidden=not progress or quiet or as_json) as shown:
        if resume is not None:
            made = runs.resume(resume, retry_failed, on_event=shown, mix=mix)
        else:
            made = runs.run(
                problem,
                solver,
                suite,
                results,
                run_id or None,
                tolerance,
                on_event=shown,
                solve_seconds=solve_seconds,
                case_seconds=case_seconds,
                memory=memory,
                passes=passes,
                seed=seed,
                sample=sample,
                thorough=thorough,
            )
    return report_run(made, charts, quiet, as_json, residual, record)


def report_run(
    run: "Run",
    charts: bool,
    quiet: bool,
    as_json: bool,
    residual: str = "judged",
    record: bool = False,
    baseline: str = "",
) -> int:
    """Print what a run has to show, then write it; return 1 if something measured failed or files were left out.

    Tables are printed before any file is written, so that a folder that takes none still shows them; why files are
    missing is said on standard error then. With ``quiet`` the files are all there is, and not to write them is an
    error.

    Args:
        run: the run.
        charts: draw charts.
        quiet: print the places of the files alone.
        as_json: print one JSON document instead.
        residual: what tables and charts go by.
        record: record the iterations.
        baseline: the solver that speed-ups are against; the one that solves most if empty.

    Raises:
        BenchError: if a link in the folder of the run leads out of it, a recording cannot be written, the run has no
            such baseline, or nothing is printed and files cannot be written.
    """
    from rich.console import Console

    from ...problems.spelling import for_command_line
    from ..errors import BenchError
    from ..report.profiles import baseline_of
    from ..report.tables import print_tables
    from ..report.text import output_width, print_json

    frames, console = run.judged_by(residual), Console(width=output_width())
    if baseline:
        baseline_of(frames, baseline)
    left_out = [for_command_line(sentence) for sentence in run.info.plan.left_out]
    for sentence in (*left_out, *run.damaged):
        print(f"proxbench: {sentence}", file=sys.stderr)
    if not (quiet or as_json):
        print_tables(frames, console)
        console.print()
    if record:
        from ..recordings.solves import record_run

        record_run(run.folder)
    made = run.report(charts, residual, baseline)
    if made.unwritten and quiet:
        raise BenchError(made.unwritten)
    if as_json:
        print_json(_document(run, made, residual))
    else:
        console.print("\n".join(_places(run, made)), soft_wrap=True, highlight=False, markup=False)
    if made.unwritten:
        print(f"proxbench: {made.unwritten}", file=sys.stderr)
    return int(_has_failed(run) or bool(left_out))


def report_page(run: "Run", quiet: bool, as_json: bool, residual: str, baseline: str) -> int:
    """Write the page of a run and print where it is; return 1 if something measured failed.

    Raises:
        BenchError: if it has no case, is over trajectories or has no such baseline, or the page cannot be written.
    """
    from ..report.text import print_json

    file = run.page(residual, baseline)
    if as_json:
        print_json({"run": str(run.folder), "page": str(file)})
    else:
        print(file if quiet else f"page     {file}")
    return int(_has_failed(run))


def print_problems(run: "Run", problems: Collection[str], as_json: bool, residual: str) -> int:
    """Print who solved some problems of a run to what; return 1 if something measured there failed.

    Raises:
        BenchError: if one of them is none of its problems.
    """
    from rich.console import Console

    from ..report.accuracy import problems_table
    from ..report.tables import print_tables, results_table
    from ..report.text import output_width, print_json

    frames = run.only(problems).judged_by(residual)
    if as_json:
        tables = {"problems": problems_table(frames), "results": results_table(frames)}
        records = {name: json.loads(table.to_json(orient="records")) for name, table in tables.items()}
        print_json({"run": str(run.folder), "residual": residual, **records})
    else:
        print_tables(frames, Console(width=output_width()))
    return int(_has_failed(frames))


def _has_failed(frames: "RunFrames") -> bool:
    """Whether something that was measured failed."""
    from ..store.outcome import FAULTS, Outcome

    return bool(frames.cases["outcome"].isin(FAULTS).any() or (frames.points["outcome"] == Outcome.WRONG).any())


def _document(run: "Run", made: "Report", residual: str) -> dict[str, Any]:
    from ..store.conversion import content_of

    return {
        "run": str(run.folder),
        "is_finished": run.is_finished,
        "residual": residual,
        "info": content_of(run.info),
        "results": json.loads(made.results.to_json(orient="records")),
        "summary": json.loads(made.summary.to_json(orient="records")),
        "files": [str(file) for file in (*made.tables, *made.charts)],
        "unwritten": made.unwritten,
        "damaged": run.damaged,
    }


def _places(run: "Run", made: "Report") -> Iterator[str]:
    """Yield where files are, one kind a line."""
    yield f"results  {run.folder}"
    for what, files in (("tables", made.tables), ("charts", made.charts)):
        if files:
            yield f"{what}   {files[0].parent}"
    if (run.folder / "recordings").is_dir():
        yield f"watch    rerun {run.folder / 'recordings'}/NAME.rrd"


def _refuse_contradictions(context: typer.Context) -> None:
    """Raise a BenchError if one option of ``run`` would make it ignore another."""
    from ..errors import BenchError

    given = options.given(context)
    if "resume" in given:
        for name in _STORED_WITH_THE_RUN:
            if name in given:
                option = options.spelled(name)
                raise BenchError(f"{option} is stored with the run and cannot be changed by --resume; leave it out.")
    elif "retry_failed" in given:
        raise BenchError("--retry-failed needs the run whose failed cases are measured again: --resume RUN.")
    elif "mix" in given:
        raise BenchError("--mix needs the run that goes on: --resume RUN.")
    if {"suite", "problem"} <= given:
        raise BenchError("--suite and --problem exclude each other; give one of them.")
