"""``proxbench run``, and what a run has to show when it is finished or reported again."""

import sys
from collections.abc import Collection, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import options

if TYPE_CHECKING:
    from ..report.making import Report
    from ..runs import Run
    from ..store.frames import RunFrames

_measuring = partial(typer.Option, rich_help_panel="Measuring")

_STORED_WITH_THE_RUN = (
    "suite",
    "sample",
    "shard",
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

MAX_NAMES = 5
"""Damaged files that one sentence names."""


def run(
    context: typer.Context,
    suite: options.Suite = "quick",
    problem: options.Problems = None,
    sample: Annotated[
        int | None, options.selection(metavar="NUMBER", help="Problems to draw, families in proportion.")
    ] = None,
    shard: Annotated[str, options.selection(metavar="I/N", help="Every N-th problem from the I-th; see merge.")] = "",
    solver: options.Solvers = None,
    tolerance: Annotated[
        list[float] | None, options.selection(metavar="NUMBER", help="Accuracy to measure the time to; repeatable.")
    ] = None,
    results: Annotated[Path, options.output(metavar="FOLDER", help="Where the run gets its folder.")] = Path("results"),
    run_id: Annotated[str, options.output(metavar="NAME", help="Name of its folder; the time if left out.")] = "",
    resume: Annotated[Path | None, _measuring(metavar="RUN", help="Finish the interrupted run in this folder.")] = None,
    retry_failed: Annotated[
        bool, _measuring("--retry-failed", help="With --resume: measure failed cases again.")
    ] = False,
    mix: Annotated[bool, _measuring("--mix", help="With --resume: also on another machine or source.")] = False,
    dask: Annotated[str, _measuring(metavar="ADDRESS", help="On this dask cluster; local for one here.")] = "",
    thorough: Annotated[bool, _measuring("--thorough", help="Ten accuracies and five passes.")] = False,
    passes: Annotated[int | None, _measuring(metavar="NUMBER", help="Passes over all problems.")] = None,
    seed: Annotated[int, _measuring(metavar="NUMBER", help="Of orders and of the sample.")] = 0,
    solve_seconds: Annotated[float, _measuring(metavar="SECONDS", help="Time of one solve.")] = 0.5,
    case_seconds: Annotated[float, _measuring(metavar="SECONDS", help="Time of one case.")] = 60.0,
    memory: Annotated[int, _measuring(metavar="MB", help="Memory of one case.")] = 2048,
    record: Annotated[bool, options.output("--record", help="Record the iterations, one file a problem.")] = False,
    plugin: options.PluginFiles = None,
    residual: options.Residual = "judged",
    page: Annotated[bool, options.output("--page/--no-page", help="Write one offline page of all charts.")] = True,
    charts: options.Charts = False,
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
    shows_nothing = not progress or quiet or as_json
    with _executor(dask) as executor, RunProgress(Console(stderr=True), hidden=shows_nothing) as shown:
        if resume is not None:
            made = runs.resume(resume, retry_failed, on_event=shown, mix=mix, executor=executor)
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
                shard=shard,
                executor=executor,
            )
    has_pictures = charts or (page and made.is_study)  # a study has no page
    return report_run(made, has_pictures, quiet, as_json, residual, record, page=page)


def _executor(dask: str) -> AbstractContextManager[Executor | None]:
    """Return the cluster of an address; nothing for none."""
    if not dask:
        return nullcontext()
    from ..measure.execution.cluster import dask_executor

    return dask_executor(dask)


def report_run(
    run: "Run",
    charts: bool,
    quiet: bool,
    as_json: bool,
    residual: str = "judged",
    record: bool = False,
    baseline: str = "",
    page: bool = False,
    profiles: str = "common",
) -> int:
    """Print what a run has to show, then write it; return 1 if something failed, is damaged or was left out.

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
        page: write the page, unless the run has none.
        profiles: problems that charts of profiles are over, "common" to all solvers or "all".

    Raises:
        BenchError: if a link in the folder of the run leads out of it, a recording cannot be written, the run has no
            such baseline, none of its cases can be read, or nothing is printed and files cannot be written.
    """
    from rich.console import Console

    from ..errors import BenchError
    from ..report.layout.text import output_width, print_json
    from ..report.profiles import baseline_of
    from ..report.tables import print_tables

    _require_readable(run)
    frames, console = run.judged_by(residual), Console(width=output_width())
    if baseline:
        baseline_of(frames, baseline)
    left_out = [options.spell_options(sentence) for sentence in run.info.plan.left_out]
    for sentence in left_out:
        print(f"proxbench: {sentence}", file=sys.stderr)
    _print_damage(run)
    if not (quiet or as_json):
        print_tables(frames, console)
        console.print()
    if record:
        from ..recordings.solves import record_run

        record_run(run.folder)
    made = run.report(charts, residual, baseline, page, profiles=profiles)
    if made.unwritten and quiet:
        raise BenchError(made.unwritten)
    if as_json:
        print_json(_document(run, made, residual))
    else:
        console.print("\n".join(_places(run, made)), soft_wrap=True, highlight=False, markup=False)
    if made.unwritten:
        print(f"proxbench: {made.unwritten}", file=sys.stderr)
    return int(_has_failed(run) or bool(left_out) or bool(run.damaged))


def report_page(run: "Run", quiet: bool, as_json: bool, residual: str, baseline: str) -> int:
    """Write the page of a run and print where it is; return 1 if something measured failed or is damaged.

    Raises:
        BenchError: if it has no case, is over trajectories or has no such baseline, or the page cannot be written.
    """
    from ..report.layout.text import print_json

    _require_readable(run)
    _print_damage(run)
    file = run.page(residual, baseline)
    if as_json:
        print_json({"run": str(run.folder), "page": str(file)})
    else:
        print(file if quiet else f"page     {file}")
    return int(_has_failed(run) or bool(run.damaged))


def print_problems(run: "Run", problems: Collection[str], as_json: bool, residual: str) -> int:
    """Print who solved some problems of a run to what; return 1 if something failed there, or the run is damaged.

    Raises:
        BenchError: if one of them is none of its problems.
    """
    from rich.console import Console

    from ..report.accuracy import problems_table
    from ..report.layout.text import json_records, output_width, print_json
    from ..report.tables import print_tables, results_table

    _require_readable(run)
    _print_damage(run)
    frames = run.only(problems).judged_by(residual)
    if as_json:
        tables = {"problems": problems_table(frames), "results": results_table(frames)}
        records = {name: json_records(table) for name, table in tables.items()}
        print_json({"run": str(run.folder), "residual": residual, **records})
    else:
        print_tables(frames, Console(width=output_width()))
    return int(_has_failed(frames) or bool(run.damaged))


def _require_readable(run: "Run") -> None:
    """Raise ``BenchError`` if a run has case files, and none of them can be read."""
    from ..errors import BenchError

    if run.damaged and run.cases.empty:
        names = [sentence.partition(" is left out: ")[0] for sentence in run.damaged]
        more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
        raise BenchError(
            f"no case of {run.folder} can be read: {', '.join(names[:MAX_NAMES])}{more}; resume the run to measure "
            "them again."
        )


def _print_damage(run: "Run") -> None:
    for sentence in run.damaged:
        print(f"proxbench: {sentence}", file=sys.stderr)


def _has_failed(frames: "RunFrames") -> bool:
    """Whether something that was measured failed."""
    from ..store.outcome import FAULTS, Outcome

    return bool(frames.cases["outcome"].isin(FAULTS).any() or (frames.points["outcome"] == Outcome.WRONG).any())


def _document(run: "Run", made: "Report", residual: str) -> dict[str, Any]:
    from ..report.layout.text import json_records
    from ..store.conversion import content_of

    return {
        "run": str(run.folder),
        "is_finished": run.is_finished,
        "residual": residual,
        "info": content_of(run.info),
        "results": json_records(made.results),
        "summary": json_records(made.summary),
        "files": [str(file) for file in (*made.tables, *made.charts, *([made.page] if made.page else []))],
        "unwritten": made.unwritten,
        "damaged": run.damaged,
    }


def _places(run: "Run", made: "Report") -> Iterator[str]:
    """Yield where files are, one kind a line."""
    yield f"results  {run.folder}"
    for what, files in (("tables", made.tables), ("charts", made.charts)):
        if files:
            yield f"{what}   {files[0].parent}"
    if made.page:
        yield f"page     {made.page}"
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
