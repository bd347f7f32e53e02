"""Running a simulation with variable steps: step, judge, note, store now and then."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ...problems.errors import said
from ...problems.stepping.moreau import StepError
from ...problems.stepping.variable_step import VariableStepTaken
from ...solvers.interface import Solver
from ..errors import BenchError, FailedSimulationError
from ..measure.remote_solver import local_or_remote
from ..simulation.asking import Asked
from ..simulation.failure import Failure
from ..simulation.plan import FIXED, check_agreement
from ..simulation.run import judged_residual
from ..simulation.warming import warm_up
from .file import read_variable, write_variable
from .plan import VariablePlan, changed
from .simulation import VariableSimulation
from .steppers import make_stepper

OnTaken = Callable[[VariableStepTaken], None]
"""Called after every accepted step."""

OnProgress = Callable[[VariableSimulation], None]
"""Called after every accepted step with the simulation as far as it has come."""

CHECKPOINT_SECONDS = 10.0
"""Wall time between two writes of the result file."""


def simulate_variable(
    plan: VariablePlan,
    file: Path | None = None,
    *,
    on_step: Sequence[OnTaken] = (),
    on_progress: OnProgress = lambda simulation: None,
    stop_asked: Callable[[], bool] = lambda: False,
) -> VariableSimulation:
    """Simulate from the start.

    Args:
        plan: what to simulate; ``make_variable_plan`` makes it.
        file: the result file, which is replaced if it exists; nothing is stored if None.
        on_step: called after every accepted step.
        on_progress: called after every accepted step, to show how far it is.
        stop_asked: asked after every accepted step whether to end before the duration is over.

    Raises:
        BenchError: if the file cannot be written.
        FailedSimulationError: if a step fails; the steps before it are stored.
    """
    simulation = VariableSimulation(plan, file)
    advance_variable(simulation, on_step, on_progress, stop_asked)
    return simulation


def begun_variable(
    file: Path, given: dict[str, Any] | None = None, duration: float | None = None
) -> VariableSimulation:
    """Return a stored simulation as far as it has come, ready to go on.

    A simulation that failed can go on with what suits it better: solver, its tolerance and iterations, and the stepper
    may be changed. The stepper starts anew at the last state, so that the steps differ from those of a simulation that
    was never interrupted, within their tolerance.

    Args:
        file: its result file.
        given: what shall be as named there: the scene and its options must be the same, the rest may differ.
        duration: simulated time from the start [s], if it shall be another one than planned.

    Raises:
        BenchError: if the file is missing, damaged or foreign, contradicts ``given``, or has passed ``duration``.
    """
    simulation = read_variable(file)
    plan, asked = simulation.plan, dict(given or {})
    changes: dict[str, Any] = {name: asked.pop(name) for name in ("tolerance", "max_iterations") if name in asked}
    if asked.get("stepper") == FIXED:
        raise BenchError(
            f"{file} has a variable step and cannot go on with a fixed one; leave --stepper out, or simulate anew."
        )
    if "stepper" in asked:
        changes["stepper"] = make_stepper(asked.pop("stepper"))
    if "solver" in asked:
        changes["solver"] = _solver(asked.pop("solver"))
    check_agreement(plan, asked, str(file))
    if duration is not None:
        changes["duration"] = duration
    simulation.plan = changed(plan, **changes)
    if simulation.state.time - simulation.plan.until > simulation.plan.stepper.min_step:
        raise BenchError(f"{file} has come to {simulation.state.time:g} s already; ask for a longer --duration.")
    return simulation


def advance_variable(
    simulation: VariableSimulation,
    on_step: Sequence[OnTaken] = (),
    on_progress: OnProgress = lambda simulation: None,
    stop_asked: Callable[[], bool] = lambda: False,
) -> None:
    """Take the steps that are left; whatever ends them, the result file holds all that were completed.

    Raises:
        FailedSimulationError: if a step fails; ``failure`` of the simulation says why.
    """
    if simulation.is_finished:
        return
    simulation.failure = None
    clock = time.perf_counter
    began = clock() - simulation.wall_seconds
    _store(simulation)
    written = clock()
    counts = (0, 0, 0.0)
    try:
        stepper = simulation.plan.steps(Asked(simulation.plan.solver))
        begin = (simulation.state, simulation.plan.until, simulation.states)
        warm_up(stepper, *begin)
        for taken in stepper.steps(*begin):
            simulation.append(taken, _row(simulation, taken, counts))
            counts = (taken.solves, taken.rejected, taken.seconds)
            for call in on_step:
                call(taken)
            simulation.wall_seconds = clock() - began
            if clock() - written >= CHECKPOINT_SECONDS:
                _store(simulation)
                written = clock()
            on_progress(simulation)
            if stop_asked():
                break
    except StepError as error:
        raise _failed(simulation, error) from error
    finally:
        _store(simulation)


def _store(simulation: VariableSimulation) -> None:
    if simulation.file is not None:
        write_variable(simulation, simulation.file)


def _failed(simulation: VariableSimulation, error: StepError) -> FailedSimulationError:
    """Note that the next step failed; return the error that says so."""
    number, time = simulation.n_steps + 1, simulation.state.time
    simulation.failure = Failure(number, time, simulation.plan.solver.name, said(error))
    return simulation.failure.error(simulation.file)


def _row(simulation: VariableSimulation, taken: VariableStepTaken, before: tuple[int, int, float]) -> tuple[float, ...]:
    """Return the values of one accepted step in the order of ``STEP``.

    Args:
        simulation: what the step is of.
        taken: the step.
        before: solves, rejected attempts and wall time [s] up to the step before.
    """
    scene, end = simulation.plan.scene, taken.end
    steps = [step for step, _ in taken.substeps]
    depths = [-float(step.contacts.gap.min()) for step in steps if step.contacts is not None]
    return (
        end.time,
        end.time - taken.begin.time,
        taken.error,
        taken.solves - before[0],
        taken.rejected - before[1],
        len(taken.states.closed),
        sum(step.iterations for step in steps),
        max(judged_residual(step) for step in steps),
        scene.kinetic_energy(end.velocity),
        scene.potential_energy(end.position),
        max(depths, default=0.0) / scene.length,
        taken.seconds - before[2],
    )


def _solver(given: str | Solver) -> Solver:
    return local_or_remote(given) if isinstance(given, str) else given
