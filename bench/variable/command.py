"""``proxbench simulate`` with a variable step."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from ...problems.scenes.registry import SCENES
from ..errors import BenchError, InterruptedSimulationError
from ..output_file import output_file
from ..pictures import drawn, refuse_pictures
from ..presenting import present, simulation_files
from ..simulations.interrupts import deferred_interrupts
from ..simulations.plan import FIXED
from ..simulations.request import Request
from ..simulations.result_file import SUFFIX
from .file import is_variable
from .live import VariableLive
from .plan import DEFAULT_STEPPER, make_variable_plan
from .running import OnTaken, advance_variable, begun_variable, one_steps
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
        BenchError: if what is asked for makes no simulation, a step fails, or something cannot be written.
        InterruptedSimulationError: if somebody stopped it.
    """
    simulation = _begun(request)
    live = VariableLive(Console(stderr=True), hidden=not progress or as_json)
    with _recorded(simulation, request) as on_step, deferred_interrupts() as stop_asked, live:
        advance_variable(simulation, on_step, live, stop_asked)
    file = simulation.file
    assert file is not None
    document = variable_document(simulation)
    files = simulation_files(file, request.record, lambda: _drawn(simulation, file, request.chart))
    present(lambda: document, lambda console: print_variable(simulation, console), files, as_json)
    if not simulation.is_finished:
        raise InterruptedSimulationError(file)
    return int(document["summary"]["unsolved_steps"] > 0)


def _begun(request: Request) -> VariableSimulation:
    if request.resume is not None:
        simulation = begun_variable(request.resume, request.given, request.duration)
        # the pictures beside a result are its own, and drawn anew as it goes on
        chart = request.chart or request.resume.with_suffix(".svg")
        refuse_pictures(chart, request.force or request.chart is None)
        return simulation
    plan = make_variable_plan(request.scene, request.options, duration=request.duration, **request.numbers)
    if request.chart is not None:
        refuse_pictures(request.chart, request.force)
    file = output_file(request.output, plan.scene.name, SUFFIX, request.force)
    if request.chart is None:
        refuse_pictures(file.with_suffix(".svg"), request.force)
    return VariableSimulation(plan, file)


def _drawn(simulation: VariableSimulation, file: Path, chart: Path | None) -> list[Path]:
    if not simulation.n_steps:
        return []
    from .figure import write_motion_chart  # altair and pandas take a second to import

    begin = simulation.state.time - SHOWN_SECONDS
    return drawn(lambda: write_motion_chart(simulation, chart or file.with_suffix(".svg"), begin), file)


@contextlib.contextmanager
def _recorded(simulation: VariableSimulation, request: Request) -> Iterator[Sequence[OnTaken]]:
    if request.record is None:
        yield ()
        return
    from ..recordings.scenes import scene_recorder  # rerun takes a second to import

    with scene_recorder(simulation.plan.scene, request.record, 1, request.force) as recorder:
        recorder.start(simulation.state)

        def record(taken: Any) -> None:
            for step in one_steps(taken):
                recorder(step)

        yield (record,)
