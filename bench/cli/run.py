"""The command ``proxbench run``."""

from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from . import options
from .report import report_run

_measuring = partial(typer.Option, rich_help_panel="Measuring")
_switch = partial(_measuring, metavar="", show_default=False)

_STORED_WITH_THE_RUN = (
    "suite",
    "sample",
    "sampling",
    "shard",
    "problem",
    "solver",
    "tolerance",
    "output",
    "run_id",
    "solve_seconds",
    "case_seconds",
    "memory",
    "passes",
    "thorough",
    "seed",
)
"""Options that are stored with a run and cannot be changed by --resume."""


def run(
    context: typer.Context,
    suite: options.Suite = "quick",
    problem: options.Problems = None,
    sample: options.Sample = None,
    sampling: options.Sampling = "proportional",
    shard: Annotated[str, options.selection(metavar="I/N", help="Measure every N-th problem from the I-th.")] = "",
    solver: options.Solvers = None,
    tolerance: Annotated[
        list[float] | None, options.selection(metavar="NUMBER", help="Tolerance to time; repeatable.")
    ] = None,
    output: options.Runs = Path("results"),
    run_id: options.RunId = None,
    resume: Annotated[Path | None, _measuring(metavar="RUN", help="Finish the interrupted run in this folder.")] = None,
    retry_failed: Annotated[bool, _switch("--retry-failed", help="With --resume: measure failed cases again.")] = False,
    mix: Annotated[bool, _switch("--mix", help="With --resume: allow another machine or source.")] = False,
    dask: Annotated[str, _measuring(metavar="ADDRESS", help="Address of a dask cluster, or local.")] = "",
    thorough: Annotated[bool, _switch("--thorough", help="Measure ten tolerances in five passes.")] = False,
    passes: Annotated[int | None, _measuring(metavar="NUMBER", help="Number of passes over all problems.")] = None,
    seed: Annotated[int, _measuring(metavar="NUMBER", help="Seed of random orders and of --sample.")] = 0,
    solve_seconds: Annotated[float, _measuring(metavar="SECONDS", help="Time limit of one solve.")] = 0.5,
    case_seconds: Annotated[float, _measuring(metavar="SECONDS", help="Time limit of one case.")] = 60.0,
    memory: Annotated[int, _measuring(metavar="MiB", help="Memory limit of one case.")] = 2048,
    record: Annotated[bool, options.flag("--record", help="Record the iterations, one file per problem.")] = False,
    plugin: options.PluginFiles = None,
    residual: options.Residual = "judged",
    page: Annotated[bool, options.flag("--page/--no-page", help="Write one offline page with all charts.")] = True,
    charts: options.Charts = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Measure how long solvers take to reach each accuracy."""
    from .. import runs
    from .progress import RunProgress

    _require_consistent_options(context)
    with _executor(dask) as executor, RunProgress(not progress or quiet or as_json) as bar:
        if resume is not None:
            measured_run = runs.resume(resume, retry_failed, on_event=bar, mix=mix, executor=executor)
        else:
            measured_run = runs.run(
                problem,
                solver,
                suite,
                output,
                run_id,
                tolerances=tolerance,
                on_event=bar,
                solve_seconds=solve_seconds,
                case_seconds=case_seconds,
                memory=memory,
                passes=passes,
                seed=seed,
                sample=sample,
                sampling=sampling,
                thorough=thorough,
                shard=shard,
                executor=executor,
            )
    draws_charts = charts or (page and measured_run.is_study)  # a study has charts instead of a page
    return report_run(measured_run, draws_charts, quiet, as_json, residual, record=record, page=page)


def _executor(dask: str) -> AbstractContextManager[Executor | None]:
    """Return a context manager that yields an executor on the cluster at an address, or None without an address."""
    if not dask:
        return nullcontext()
    from ..measure.execution.cluster import dask_executor

    return dask_executor(dask)


def _require_consistent_options(context: typer.Context) -> None:
    """Raise ``BenchError`` if options of ``run`` contradict each other."""
    specified = options.given_parameters(context)
    if "resume" in specified:
        options.require_absent(_STORED_WITH_THE_RUN, specified, "is stored with the run, and --resume cannot change it")
    else:
        options.require_absent(["retry_failed", "mix"], specified, "finishes an interrupted run and needs --resume RUN")
    options.require_exclusive("suite", ["problem"], specified)
