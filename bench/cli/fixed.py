"""``proxbench simulate`` with a fixed step."""

import contextlib
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from ..errors import BenchError, FailedSimulationError, InterruptedSimulationError
from ..report.output_file import drawn
from ..report.presenting import present, simulation_files
from ..simulation.beside import Beside, chosen_beside, recorded
from ..simulation.file import write_simulation
from ..simulation.live import LiveSummary
from ..simulation.plan import FIXED, make_simulation_plan
from ..simulation.run import advance, begun_simulation, new_simulation
from ..simulation.table import document, print_simulation
from ..simulation.trajectory import Simulation
from .interrupts import deferred_interrupts
from .request import Request


def run_fixed(request: Request, as_json: bool, progress: bool) -> int:
    """Carry out the simulation, print what it came to, and draw it; return 1 if the judge found a step unsolved.

    Raises:
        BenchError: if what is asked for makes no simulation, or something cannot be written.
        FailedSimulationError: if a step failed, when everything else is printed and drawn.
        InterruptedSimulationError: if somebody stopped it.
    """
    simulation = _begun(request)
    live = LiveSummary(Console(stderr=True), hidden=not progress or as_json)
    # a failure is raised again when everything is shown
    with deferred_interrupts() as stop_asked, live, contextlib.suppress(FailedSimulationError):
        advance(simulation, (), live, stop_asked)
    code = show_fixed(simulation, as_json)
    if not simulation.is_finished and simulation.file is not None:
        raise InterruptedSimulationError(simulation.file)
    return code


def show_fixed(simulation: Simulation, as_json: bool, quiet: bool = False) -> int:
    """Print what a stored simulation came to, and draw and record it; return 1 if the judge found a step unsolved.

    Raises:
        FailedSimulationError: if a step failed.
    """
    file = simulation.file
    assert file is not None
    files = simulation_files(file, lambda: _drawn(simulation, file), lambda: _recorded(simulation, file))
    present(
        lambda: document(simulation), lambda console: print_simulation(simulation, console), files, as_json, quiet=quiet
    )
    if simulation.failure is not None:
        raise simulation.failure.error(file)
    return int(simulation.unsolved.any())


def _begun(request: Request) -> Simulation:
    if request.numbers.get("stepper", FIXED) != FIXED:
        raise BenchError(f"--stepper contradicts {request.resume}, which has a fixed step; leave it out to resume.")
    asked = replace(request, numbers={name: value for name, value in request.numbers.items() if name != "stepper"})
    if asked.resume is not None:
        simulation = begun_simulation(asked.resume, asked.given, asked.duration)
        own = simulation.beside
        simulation.beside = chosen_beside(own, asked.chart, asked.record, asked.force)
        if simulation.beside != own:  # nothing else would be written where no step is left
            write_simulation(simulation, asked.resume)
        return simulation
    plan = make_simulation_plan(asked.scene, asked.options, duration=asked.duration, **asked.numbers)
    beside = chosen_beside(Beside(), asked.chart, asked.record, asked.force)
    simulation = new_simulation(plan, asked.output, asked.force)
    simulation.beside = beside
    return simulation


def record_fixed(simulation: Simulation, file: Path, force: bool = False) -> None:
    """Write the recording of a simulation; arguments and errors as in ``recordings.replay.record_stored``."""
    from ..recordings.replay import record_stored  # rerun takes a second to import

    record_stored(simulation.plan.scene, simulation.steps, simulation.states, file, force=force)


def _recorded(simulation: Simulation, file: Path) -> list[Path]:
    recording = simulation.beside.recording if simulation.n_steps else None
    return recorded(lambda path: record_fixed(simulation, path, force=True), recording, file)


def _drawn(simulation: Simulation, file: Path) -> list[Path]:
    chart = simulation.beside.chart
    if chart is None or not simulation.n_steps:
        return []
    from ..simulation.chart import write_chart  # altair and pandas take a second to import

    return drawn(lambda: write_chart(simulation, chart), file)
