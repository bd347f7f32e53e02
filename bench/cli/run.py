"""``proxbench run``, and what a run has to show when it is finished or reported again."""

import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import options

if TYPE_CHECKING:
    from ..runs import Run

_continued = partial(typer.Option, rich_help_panel="Continue an interrupted run")

_STORED_WITH_THE_RUN = (
    "suite",
    "problem",
    "solver",
    "tolerance",
    "results",
    "run_id",
    "solve_seconds",
    "case_seconds",
    "memory",
    "passes",
    "seed",
)
"""Options that --resume takes from the stored run."""


def run(
    context: typer.Context,
    suite: options.Suite = "quick",
    problem: options.Problems = None,
    solver: options.Solvers = None,
    tolerance: Annotated[
        list[float] | None, options.selection(metavar="NUMBER", help="Accuracy to measure the time to; repeatable.")
    ] = None,
    results: Annotated[Path, options.output(metavar="FOLDER", help="Where the run gets its folder.")] = Path("results"),
    run_id: Annotated[str, options.output(metavar="NAME", help="Name of its folder; the time if left out.")] = "",
    resume: Annotated[Path | None, _continued(metavar="RUN", help="Finish the run in this folder.")] = None,
    retry_failed: Annotated[bool, _continued("--retry-failed", help="Measure its failed cases again.")] = False,
    mix: Annotated[bool, _continued("--mix", help="Also on another machine or source.")] = False,
    passes: Annotated[int, options.limits(metavar="NUMBER", help="Rounds of each point, at least.")] = 5,
    seed: Annotated[int, options.limits(metavar="NUMBER", help="Of the orders in each pass.")] = 0,
    solve_seconds: options.SolveSeconds = 0.5,
    case_seconds: Annotated[float, options.limits(metavar="SECONDS", help="Time of one case.")] = 60.0,
    memory: Annotated[int, options.limits(metavar="MB", help="Memory of one case.")] = 2048,
    record: Annotated[bool, options.output("--record", help="Record the iterations, one file a problem.")] = False,
    plugin: options.PluginFiles = None,
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
            )
    if record:
        from ..recordings.solves import record_run

        record_run(made.folder)
    return report_run(made, charts, quiet, as_json)


def report_run(run: "Run", charts: bool, quiet: bool, as_json: bool) -> int:
    """Write and print what a run has to show; return 1 if something measured failed."""
    from rich.console import Console

    from ..report.tables import print_tables
    from ..report.text import print_json
    from ..store.conversion import content_of
    from ..store.outcome import FAULTS, Outcome

    made = run.report(charts)
    for sentence in run.damaged:
        print(f"proxbench: {sentence}", file=sys.stderr)
    if as_json:
        document = {
            "run": str(run.folder),
            "is_finished": run.is_finished,
            "info": content_of(run.info),
            "results": json.loads(made.results.to_json(orient="records")),
            "summary": json.loads(made.summary.to_json(orient="records")),
            "files": [str(file) for file in (*made.tables, *made.charts)],
            "damaged": run.damaged,
        }
        print_json(document)
    else:
        console = Console()
        if not quiet:
            print_tables(run, console)
            console.print()
        places = [f"results  {run.folder}", f"tables   {run.folder / 'tables'}"]
        if charts:
            places.append(f"charts   {run.folder / 'charts'}")
        if (run.folder / "recordings").is_dir():
            places.append(f"watch    rerun {run.folder / 'recordings'}/NAME.rrd")
        console.print("\n".join(places), soft_wrap=True)
    failed = run.cases["outcome"].isin(FAULTS).any() or (run.points["outcome"] == Outcome.WRONG).any()
    return int(failed)


def _refuse_contradictions(context: typer.Context) -> None:
    """Raise a BenchError if one option of ``run`` would make it ignore another."""
    from ..errors import BenchError

    given = options.given(context)
    if "resume" in given:
        for name in _STORED_WITH_THE_RUN:
            if name in given:
                option = name.replace("_", "-")
                raise BenchError(f"--{option} is stored with the run and cannot be changed by --resume; leave it out.")
    elif "retry_failed" in given:
        raise BenchError("--retry-failed needs the run whose failed cases are measured again: --resume RUN.")
    elif "mix" in given:
        raise BenchError("--mix needs the run that goes on: --resume RUN.")
    if {"suite", "problem"} <= given:
        raise BenchError("--suite and --problem exclude each other; give one of them.")
