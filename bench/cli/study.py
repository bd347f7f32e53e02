"""``proxbench simulate --study``."""

from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from ...problems.scenes.registry import read_scene
from ..errors import BenchError, InterruptedSimulationError
from ..report.output_file import drawn, output_file, refuse_pictures, refuse_taken
from ..report.presenting import present
from ..study.defaults import make_study_plan
from ..study.live import StudyProgress
from ..study.running import advance_study, points
from ..study.study import SUFFIX, Study, read_study, write_points
from ..study.table import print_study, study_document
from .interrupts import deferred_interrupts
from .simulation import Request

FILE_WIDTH = 140
"""Columns of the table of points, which goes to a file or a pipe."""


def wants_study(study: bool, resume: Path | None) -> bool:
    """Whether this is a study, or a stored one that shall go on."""
    return study or (resume is not None and resume.suffix == SUFFIX)


def run_study_command(request: Request, as_json: bool, progress: bool) -> int:
    """Carry out the study, print, store and draw its points; return 0.

    Raises:
        BenchError: if the request makes no study, or something cannot be written.
        InterruptedSimulationError: if it was stopped.
    """
    study = _begun(request)
    file = study.file
    assert file is not None
    live = StudyProgress(Console(stderr=True), hidden=not progress or as_json)
    with deferred_interrupts() as should_stop, live:
        advance_study(study, live, should_stop)
    _present(study, file, request.chart or file.with_suffix(".svg"), as_json)
    if not study.is_finished:
        raise InterruptedSimulationError(file)
    return 0


def report_study(file: Path, charts: bool, quiet: bool, as_json: bool) -> int:
    """Print a stored study, and write its points and its chart again; return 0.

    Args:
        file: of the study.
        charts: draw the chart.
        quiet: print the places of the files alone.
        as_json: print one JSON document instead.

    Raises:
        BenchError: if the file is missing, damaged, or no study.
    """
    study = read_study(file)
    _present(study, file, file.with_suffix(".svg") if charts else None, as_json, quiet)
    return 0


def _present(study: Study, file: Path, chart: Path | None, as_json: bool, quiet: bool = False) -> None:
    files = _files(study, file, chart)
    present(
        lambda: study_document(study), lambda console: print_study(study, console), files, as_json, FILE_WIDTH, quiet
    )


def _files(study: Study, file: Path, chart: Path | None) -> Iterator[tuple[str, Path]]:
    """Make the files of a study one by one, and yield what each is."""
    found, table = points(study), _table_file(file)
    yield "result", file
    write_points(found, table)
    yield "points", table
    for path in _drawn(study, file, chart) if found and chart is not None else ():
        yield "chart", path


def _drawn(study: Study, file: Path, chart: Path) -> list[Path]:
    from ..study.chart import write_study_chart  # altair and pandas take a second to import

    return drawn(lambda: write_study_chart(study, chart), file)


def _table_file(file: Path) -> Path:
    return file.with_suffix(".csv")


def _begun(request: Request) -> Study:
    for name in ("stepper", "tolerance", "max_iterations"):
        if name in request.numbers:
            raise BenchError(f"a study varies --{name.replace('_', '-')} itself; leave it out.")
    if "step_seconds" in request.numbers:
        raise BenchError("a study limits no single answers of plugins; leave --step-seconds out.")
    if "states" in request.numbers:
        raise BenchError("a study keeps no states of its simulations; leave --states out.")
    if request.record is not None:
        raise BenchError("a study is of many simulations and has no recording; leave --record out.")
    if request.resume is not None:
        if request.resume.suffix != SUFFIX:
            raise BenchError(f"{request.resume} holds no study; leave --study out, or name a file {SUFFIX}.")
        study = _resumed(request, request.resume)
        # the table and the pictures beside a study are its own, and made anew as it goes on
        refuse_taken([_table_file(request.resume)], True)
        chart = request.chart or request.resume.with_suffix(".svg")
        refuse_pictures(chart, request.force or request.chart is None)
        return study
    added = [request.numbers["solver"]] if "solver" in request.numbers else []
    scene, options = read_scene(request.scene)
    plan = make_study_plan(scene, options, duration=request.duration, solvers=added)
    if request.chart is not None:
        refuse_pictures(request.chart, request.force)
    file = output_file(request.output, f"{plan.scene}-study", SUFFIX, request.force)
    refuse_taken([_table_file(file)], request.force)
    if request.chart is None:
        refuse_pictures(file.with_suffix(".svg"), request.force)
    return Study(plan, file)


def _resumed(request: Request, file: Path) -> Study:
    scene, options = read_scene(request.scene) if request.scene else ("", {})
    given = {**options, **request.numbers, **({} if request.duration is None else {"duration": 0})}
    if given:
        name = next(iter(given)).replace("_", "-")
        name = name if name in options else f"--{name}"
        raise BenchError(f"{name} makes no sense with --resume, which goes on as planned; leave it out.")
    study = read_study(file)
    if scene not in ("", study.plan.scene):
        raise BenchError(f"{scene} contradicts {file}, which is of the {study.plan.scene}; leave it out.")
    return study
