"""``proxbench simulate`` with a fixed step."""

from dataclasses import replace
from pathlib import Path

from rich.console import Console

from ..errors import BenchError, InterruptedSimulationError
from ..pictures import drawn, refuse_pictures
from ..presenting import present, simulation_files
from .interrupts import deferred_interrupts
from .live import LiveSummary
from .plan import FIXED, make_simulation_plan
from .recording import recorded
from .request import Request
from .running import advance, begun_simulation, new_simulation
from .simulation import Simulation
from .table import document, print_simulation


def run_fixed(request: Request, as_json: bool, progress: bool) -> int:
    """Carry out the simulation, print what it came to, and draw it; return 1 if the judge found a step unsolved.

    Raises:
        BenchError: if what is asked for makes no simulation, a step fails, or something cannot be written.
        InterruptedSimulationError: if somebody stopped it.
    """
    simulation = _begun(request)
    live = LiveSummary(Console(stderr=True), hidden=not progress or as_json)
    with recorded(simulation, request.record, request.force) as on_step, deferred_interrupts() as stop_asked, live:
        advance(simulation, on_step, live, stop_asked)
    file = simulation.file
    assert file is not None
    files = simulation_files(file, request.record, lambda: _drawn(simulation, file, request.chart))
    present(lambda: document(simulation), lambda console: print_simulation(simulation, console), files, as_json)
    if not simulation.is_finished:
        raise InterruptedSimulationError(file)
    return int(simulation.unsolved.any())


def _begun(request: Request) -> Simulation:
    if request.numbers.get("stepper", FIXED) != FIXED:
        raise BenchError(f"--stepper contradicts {request.resume}, which has a fixed step; leave it out to resume.")
    asked = replace(request, numbers={name: value for name, value in request.numbers.items() if name != "stepper"})
    if asked.resume is not None:
        simulation = begun_simulation(asked.resume, asked.given, asked.duration)
        _refuse_chart(asked)
        return simulation
    plan = make_simulation_plan(asked.scene, asked.options, duration=asked.duration, **asked.numbers)
    _refuse_chart(asked)
    return new_simulation(plan, asked.output, asked.force)


def _refuse_chart(request: Request) -> None:
    if request.chart is not None:
        refuse_pictures(request.chart, request.force)


def _drawn(simulation: Simulation, file: Path, chart: Path | None) -> list[Path]:
    if chart is None or not simulation.n_steps:
        return []
    from .chart import write_chart  # altair and pandas take a second to import

    return drawn(lambda: write_chart(simulation, chart), file)
