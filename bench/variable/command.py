"""``proxbench simulate`` with a variable step."""

import contextlib
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from ...problems.scenes.registry import SCENES
from ..errors import BenchError, InterruptedSimulationError
from ..simulations.interrupts import deferred_interrupts
from ..simulations.running import result_file
from .figure import write_motion_chart
from .file import is_variable
from .live import VariableLive
from .plan import DEFAULT_STEPPER, make_variable_plan
from .running import OnTaken, advance_variable, begun_variable, one_steps
from .simulation import VariableSimulation
from .table import print_variable, variable_document

SHOWN_SECONDS = 0.5
"""Simulated time up to the end that the chart shows: some periods of the woodpecker."""

FIXED = "Moreau"
"""The stepper of fixed step size."""


@dataclass(frozen=True)
class Request:
    """What the command line asks for.

    Attributes:
        scene: its name, empty if none is named.
        options: options of the scene.
        numbers: what of the plan was given: stepper, solver, tolerance, max_iterations.
        duration: simulated time [s].
        output: result file, or the folder for it.
        force: replace files that exist.
        resume: result file to go on with.
        record: recording to write.
        chart: chart to write; beside the result file if None.
    """

    scene: str
    options: dict[str, Any]
    numbers: dict[str, Any]
    duration: float | None
    output: Path
    force: bool
    resume: Path | None
    record: Path | None
    chart: Path | None


def wants_variable(scene: str, numbers: dict[str, Any], resume: Path | None) -> bool:
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
    """Carry out the simulation, and print and draw what it came to; return 1 if an inclusion was not solved."""
    simulation = _begun(request)
    live = VariableLive(Console(stderr=True), hidden=not progress or as_json)
    with _recorded(simulation, request) as on_step, deferred_interrupts() as stop_asked, live:
        advance_variable(simulation, on_step, live, stop_asked)
    file = simulation.file
    drawn: list[Path] = []
    if simulation.n_steps and file is not None:
        base = request.chart or file.with_suffix("")
        drawn = write_motion_chart(simulation, base, simulation.state.time - SHOWN_SECONDS)
    document = variable_document(simulation)
    if as_json:
        print(json.dumps(document, indent=1, ensure_ascii=False))
    else:
        console = Console(width=None if sys.stdout.isatty() else 120)
        print_variable(simulation, console)
        shown = "".join(f"\nchart   {path}" for path in drawn)
        watch = "" if request.record is None else f"\nwatch   rerun {request.record}"
        console.print(f"\nresult  {file}{shown}{watch}", soft_wrap=True, highlight=False)
    if not simulation.is_finished and file is not None:
        raise InterruptedSimulationError(file)
    return int(document["summary"]["unsolved_steps"] > 0)


def _begun(request: Request) -> VariableSimulation:
    if request.resume is not None:
        given = {**({"scene": request.scene} if request.scene else {}), **request.numbers, **request.options}
        return begun_variable(request.resume, given, request.duration)
    plan = make_variable_plan(request.scene, request.options, duration=request.duration, **request.numbers)
    return VariableSimulation(plan, result_file(request.output, plan.scene.name, request.force))


@contextlib.contextmanager
def _recorded(simulation: VariableSimulation, request: Request) -> Iterator[Sequence[OnTaken]]:
    if request.record is None:
        yield ()
        return
    from ..recordings.scenes import scene_recorder

    with scene_recorder(simulation.plan.scene, request.record, 1, request.force) as recorder:
        recorder.start(simulation.state)

        def record(taken: Any) -> None:
            for step in one_steps(taken):
                recorder(step)

        yield (record,)
