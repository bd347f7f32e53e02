"""``proxbench run``, and what a run has to show when it is finished or reported again."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .help import OUTPUT
from .options import LIMITS, SELECTION, Charts, Json, PluginFiles, Problems, Progress, Quiet, Solvers, refuse_two_prints

if TYPE_CHECKING:
    from ..runs import Run

_CONTINUED = "Continue an interrupted run"

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
)
"""Options that --resume takes from the stored run."""


def run(
    context: typer.Context,
    suite: Annotated[
        str, typer.Option(metavar="SUITE", help="Suite of problems.", rich_help_panel=SELECTION)
    ] = "quick",
    problem: Problems = None,
    solver: Solvers = None,
    tolerance: Annotated[
        list[float] | None,
        typer.Option(metavar="NUMBER", help="Accuracy to measure the time to; repeatable.", rich_help_panel=SELECTION),
    ] = None,
    results: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Where the run gets its folder.", rich_help_panel=OUTPUT)
    ] = Path("results"),
    run_id: Annotated[
        str, typer.Option(metavar="NAME", help="Name of its folder; the time if left out.", rich_help_panel=OUTPUT)
    ] = "",
    resume: Annotated[
        Path | None, typer.Option(metavar="RUN", help="Finish the run in this folder.", rich_help_panel=_CONTINUED)
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Measure its failed cases again.", rich_help_panel=_CONTINUED)
    ] = False,
    solve_seconds: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time of one solve.", rich_help_panel=LIMITS)
    ] = 0.5,
    case_seconds: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time of one case.", rich_help_panel=LIMITS)
    ] = 60.0,
    memory: Annotated[int, typer.Option(metavar="MB", help="Memory of one case.", rich_help_panel=LIMITS)] = 2048,
    record: Annotated[
        bool, typer.Option("--record", help="Record the iterations, one file a problem.", rich_help_panel=OUTPUT)
    ] = False,
    plugin: PluginFiles = None,
    charts: Charts = True,
    quiet: Quiet = False,
    as_json: Json = False,
    progress: Progress = True,
) -> int:
    """Measure how long solvers take to reach an accuracy; print tables and store all results."""
    from rich.console import Console

    from .. import runs
    from ..report.progress import RunProgress

    _refuse_contradictions(context)
    refuse_two_prints(quiet, as_json)
    with RunProgress(Console(stderr=True), hidden=not progress or quiet or as_json) as shown:
        if resume is not None:
            made = runs.resume(resume, retry_failed, on_event=shown)
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
            )
    if record:
        from ..recordings.solves import record_run

        record_run(made.folder)
    return report_run(made, charts, quiet, as_json)


def report_run(run: "Run", charts: bool, quiet: bool, as_json: bool) -> int:
    """Write and print what a run has to show; return 1 if something measured failed."""
    from rich.console import Console

    from ..report.tables import print_tables
    from ..store.outcome import FAULTS, Outcome
    from ..store.records import content_of

    made = run.report(charts)
    for sentence in run.damaged:
        print(f"proxbench: {sentence}", file=sys.stderr)
    if as_json:
        document: dict[str, Any] = {
            "run": str(run.folder),
            "is_finished": run.is_finished,
            "info": content_of(run.info),
            "results": json.loads(made.results.to_json(orient="records")),
            "summary": json.loads(made.summary.to_json(orient="records")),
            "files": [str(file) for file in (*made.tables, *made.charts)],
            "damaged": run.damaged,
        }
        print(json.dumps(document, indent=1, ensure_ascii=False))
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

    given = {
        name for name in context.params if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"
    }
    if "resume" in given:
        for name in _STORED_WITH_THE_RUN:
            if name in given:
                option = name.replace("_", "-")
                raise BenchError(f"--{option} is stored with the run and cannot be changed by --resume; leave it out.")
    elif "retry_failed" in given:
        raise BenchError("--retry-failed needs the run whose failed cases are measured again: --resume RUN.")
    if {"suite", "problem"} <= given:
        raise BenchError("--suite and --problem exclude each other; give one of them.")
