"""``proxbench simulate`` with a variable step."""

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from ...problems.scenes.registry import SCENES
from ..cli.interrupts import deferred_interrupts
from ..cli.request import Request
from ..errors import BenchError, FailedSimulationError, InterruptedSimulationError
from ..report.output_file import drawn, output_file
from ..report.presenting import present, simulation_files
from ..simulation.beside import Beside, chosen_beside, recorded
from ..simulation.plan import FIXED
from ..simulation.result_file import SUFFIX
from .file import is_variable, write_variable
from .live import VariableLive
from .plan import DEFAULT_STEPPER, make_variable_plan
from .running import advance_variable, begun_variable
from .simulation import VariableSimulation
from .table import print_variable, variable_document

SHOWN_SECONDS = 0.5
"""Simulated time up to the end that the chart shows: some periods of the woodpecker."""


def wants_variable(scene: str, numbers: Mapping[str, Any], resume: Path | None) -> bool:
    """Whether a simulation has a variable step: as stored, as asked for, or as scenes of few contacts have.

    Raises:
        BenchError: if the stored simulation cannot be read, or --step-size goes with a variable stepper.
    """
    if resume is not None:
        return is_variable(resume)
    stepper = numbers.get("stepper")
    if stepper is None:
        return scene in SCENES and SCENES[scene].has_few_contacts and "step_size" not in numbers
    if stepper == FIXED:
        return False
    if "step_size" in numbers:
        raise BenchError(f"--step-size belongs to --stepper {FIXED}; {DEFAULT_STEPPER} has min_step and max_step.")
    return True


def run_variable(request: Request, as_json: bool, progress: bool) -> int:
    """Carry out the simulation, print what it came to, and draw it; return 1 if an inclusion was not solved.

    Raises:
        BenchError: if what is asked for makes no simulation, or something cannot be written.
        FailedSimulationError: if a step failed, when everything else is printed and drawn.
        InterruptedSimulationError: if somebody stopped it.
    """
    simulation = _begun(request)
    live = VariableLive(Console(stderr=True), hidden=not progress or as_json)
    # a failure is raised again when everything is shown
    with deferred_interrupts() as stop_asked, live, contextlib.suppress(FailedSimulationError):
        advance_variable(simulation, (), live, stop_asked)
    code = show_variable(simulation, as_json)
    if not simulation.is_finished and simulation.file is not None:
        raise InterruptedSimulationError(simulation.file)
    return code


def show_variable(simulation: VariableSimulation, as_json: bool, quiet: bool = False) -> int:
    """Print what a stored simulation came to, and draw and record it; return 1 if an inclusion was not solved.

    Raises:
        FailedSimulationError: if a step failed.
    """
    file = simulation.file
    assert file is not None
    document = variable_document(simulation)
    files = simulation_files(file, lambda: _drawn(simulation, file), lambda: _recorded(simulation, file))
    present(lambda: document, lambda console: print_variable(simulation, console), files, as_json, quiet=quiet)
    if simulation.failure is not None:
        raise simulation.failure.error(file)
    return int(document["summary"]["unsolved_steps"] > 0)


def _begun(request: Request) -> VariableSimulation:
    if request.resume is not None:
        simulation = begun_variable(request.resume, request.given, request.duration)
        own = simulation.beside
        if own.chart is None:  # it has one in any case
            own = replace(own, chart=request.resume.with_suffix(".svg"))
        simulation.beside = chosen_beside(own, request.chart, request.record, request.force)
        if simulation.beside != own:  # nothing else would be written where no step is left
            write_variable(simulation, request.resume)
        return simulation
    plan = make_variable_plan(request.scene, request.options, duration=request.duration, **request.numbers)
    beside = chosen_beside(Beside(), request.chart, request.record, request.force)
    file = output_file(request.output, plan.scene.name, SUFFIX, request.force)
    if beside.chart is None:
        beside = chosen_beside(beside, file.with_suffix(".svg"), None, request.force)
    return VariableSimulation(plan, file, beside=beside)


def record_variable(simulation: VariableSimulation, file: Path, force: bool = False) -> None:
    """Write the recording of a simulation; arguments and errors as in ``recordings.replay.record_stored``."""
    from ..recordings.replay import record_stored  # rerun takes a second to import

    scene = simulation.plan.scene
    states = simulation.thinning.states
    record_stored(scene, simulation.steps, states, file, impulse_seconds=scene.step_size, force=force)


def _recorded(simulation: VariableSimulation, file: Path) -> list[Path]:
    recording = simulation.beside.recording if simulation.n_steps else None
    return recorded(lambda path: record_variable(simulation, path, force=True), recording, file)


def _drawn(simulation: VariableSimulation, file: Path) -> list[Path]:
    chart = simulation.beside.chart
    if chart is None or not simulation.n_steps:
        return []
    from .figure import write_motion_chart  # altair and pandas take a second to import

    begin = simulation.state.time - SHOWN_SECONDS
    return drawn(lambda: write_motion_chart(simulation, chart, begin), file)
