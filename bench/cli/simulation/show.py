"""Run a simulation, print its tables, and write its chart and recording from the stored result."""

import contextlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from ...errors import FailedSimulationError, InterruptedSimulationError, UnwritableError
from ...report.layout.output_file import draw_pictures, output_file
from ...report.layout.text import output_width, print_json
from ...simulation.file import SUFFIX, read_simulation, write_simulation
from ...simulation.plan import make_simulation_plan
from ...simulation.run import advance, resumable_simulation
from ...simulation.simulation import Simulation
from ...simulation.view.live import LiveSummary
from ...simulation.view.outputs import SimulationOutputs, choose_outputs
from ...simulation.view.table import print_simulation, simulation_document
from .. import options
from .interrupts import deferred_interrupts


@dataclass(frozen=True)
class Request:
    """Arguments of a simulation on the command line.

    Attributes:
        scene: the scene with its options, empty if none is named.
        plan_arguments: arguments of ``make_simulation_plan``: stepper, solver, tolerance, max_iterations, start,
            states, step_seconds.
        duration: simulated time [s].
        output: result file, or its folder.
        force: replace files that exist.
        resume: result file to resume; None to start a new simulation.
        recording: recording to write; None for none.
        chart: chart to write; None for the default of the scene.
    """

    scene: str
    plan_arguments: Mapping[str, Any]
    duration: float | None
    output: Path
    force: bool
    resume: Path | None
    recording: Path | None
    chart: Path | None


def run_simulation(request: Request, as_json: bool, quiet: bool, progress: bool) -> int:
    """Run the simulation, print its tables, and draw it; return its exit code, see ``_exit_code``.

    Raises:
        BenchError: if the arguments contradict each other, or a file cannot be written.
        FailedSimulationError: if a step failed; everything else is printed and drawn first.
        InterruptedSimulationError: if the simulation was interrupted.
    """
    simulation = _start_or_resume(request)
    live = LiveSummary(Console(stderr=True), hidden=not progress or quiet or as_json)
    # raise a failure after everything is printed
    with deferred_interrupts() as should_stop, live, contextlib.suppress(FailedSimulationError):
        advance(simulation, on_progress=live, should_stop=should_stop)
    code = show_simulation(simulation, as_json, quiet)
    if not simulation.is_finished and simulation.file is not None:
        raise InterruptedSimulationError(simulation.file)
    return code


def show_simulation(simulation: Simulation, as_json: bool, quiet: bool = False) -> int:
    """Print the tables of a stored simulation, and draw and record it; return its exit code, see ``_exit_code``.

    With ``quiet``, a message on standard error explains a code of 1.

    Raises:
        FailedSimulationError: if a step failed.
    """
    file = simulation.file
    assert file is not None
    console = Console(width=output_width(), quiet=as_json)
    if as_json:
        print_json(simulation_document(simulation))
    elif not quiet:
        print_simulation(simulation, console)
        console.print()
    # write these files last, because this is slow and may fail
    for kind, path in _files(simulation, file):
        console.print(f"{kind:<8}{path}", soft_wrap=True, highlight=False)
    code = _exit_code(simulation)
    if code and quiet:
        scene_ending, unsolved = simulation.scene_ending, int(simulation.unsolved.sum())
        missed = f"{unsolved} of {simulation.n_steps} steps miss the tolerance, as judged"
        options.print_notes(f"{missed if unsolved or scene_ending is None else scene_ending.sentence}.")
    return code


def _exit_code(simulation: Simulation) -> int:
    """Return 1 if the judge found a step unsolved, or the scene ended without success, else 0.

    Raises:
        FailedSimulationError: if a step failed.
    """
    if simulation.failure is not None:
        raise simulation.failure.error(simulation.file)
    scene_ending = simulation.scene_ending
    return int(simulation.unsolved.any() or (scene_ending is not None and not scene_ending.is_success))


def report_simulation(file: Path, charts: bool, quiet: bool, as_json: bool) -> int:
    """Print the table of a stored simulation, and draw its chart and recording again; return its exit code.

    If these files cannot be written, the table is still printed, and a message on standard error gives the reason.

    Args:
        file: result file of the simulation.
        charts: draw the chart.
        quiet: print only the paths of the files.
        as_json: print one JSON document instead.

    Raises:
        BenchError: if the file is missing, damaged or not a result, if one of its files is a link out of its folder, or
            with ``quiet`` if they cannot be written.
        FailedSimulationError: if a step failed.
    """
    simulation = read_simulation(file)
    if not charts:
        simulation.outputs = replace(simulation.outputs, chart=None)
    try:
        return show_simulation(simulation, as_json, quiet)
    except UnwritableError as error:
        if quiet:
            raise
        options.print_notes(options.with_option_names(str(error)))
    return _exit_code(simulation)


def record_simulation(file: Path, recording: Path, force: bool) -> None:
    """Write the recording of a stored simulation.

    Raises:
        BenchError: if the file is missing, damaged or not a result, or the recording exists or cannot be written.
    """
    _record(read_simulation(file), recording, force)


def _start_or_resume(request: Request) -> Simulation:
    """Return the simulation to advance, with its output files."""
    if request.resume is not None:
        expected_values = {**({"scene": request.scene} if request.scene else {}), **request.plan_arguments}
        simulation = resumable_simulation(request.resume, expected_values, request.duration)
        stored = simulation.outputs
        simulation.outputs = choose_outputs(stored, request.chart, request.recording, request.force)
        if simulation.outputs != stored:  # if no steps remain, nothing else writes the result
            write_simulation(simulation, request.resume)
        if simulation.is_finished:
            options.print_notes(f"{request.resume} is already finished; nothing was simulated.")
        return simulation
    plan = make_simulation_plan(request.scene, duration=request.duration, **request.plan_arguments)
    outputs = choose_outputs(SimulationOutputs(), request.chart, request.recording, request.force)
    file = output_file(request.output, plan.scene.name, SUFFIX, request.force)
    if outputs.chart is None and plan.scene.coordinates:  # a chart of coordinates is more informative than a table
        outputs = choose_outputs(
            replace(outputs, chart=None), file.with_suffix(".svg"), outputs.recording, request.force
        )
    return Simulation(plan, file=file, outputs=outputs)


def _files(simulation: Simulation, file: Path) -> Iterator[tuple[str, str | Path]]:
    """Write the chart and the recording of a simulation, and yield the kind and path of each of its files."""
    yield "result", file
    chart, recording = simulation.outputs.chart, simulation.outputs.recording
    if simulation.n_steps and chart is not None:
        from ...simulation.view.chart import write_chart  # altair and pandas take a second to import

        for path in draw_pictures(lambda: write_chart(simulation, chart), file):
            yield "chart", path
    if simulation.n_steps and recording is not None:
        remedy = "make it with: proxbench record {}"
        for path in draw_pictures(lambda: _record(simulation, recording, force=True), file, "recording", remedy):
            yield "watch", f"rerun {path}"


def _record(simulation: Simulation, file: Path, force: bool) -> list[Path]:
    """Write the recording of a simulation, and return its file in a list."""
    from ...recordings.replay import record_stored  # rerun takes a second to import

    scene = simulation.plan.scene
    seconds = scene.step_size if simulation.plan.stepper.holds_forces else None
    record_stored(scene, simulation.steps, simulation.states, file, impulse_seconds=seconds, force=force)
    return [file]
