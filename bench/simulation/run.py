"""Run a simulation: take, judge and record steps, and store them at intervals, until the simulation ends or stops."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack

from ...problems.contact.matrices.memory import require_memory
from ...problems.contact.solver import Solver
from ...problems.errors import error_text
from ...problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.stepping.position_projection import joint_bytes
from ...problems.motion.stepping.step import NOT_FINITE, AcceptedStep
from ...solvers.iteration.cores import one_library_thread
from ..errors import BenchError, FailedSimulationError
from ..plugins.remote_scene import RemoteSystem
from ..report.layout.output_file import output_file
from ..report.layout.text import counted
from .file import SUFFIX, read_simulation, write_simulation
from .history import Failure
from .plan import REPLACEABLE, SimulationPlan, changed, check_agreement
from .remote_steps import RemoteSteps
from .simulation import Simulation
from .step_row import SceneValues, scene_values, step_row
from .step_times import without_compilation

OnStep = Callable[[int, AcceptedStep], None]
"""``on_step(number, step)``, called after every step, with numbers from 1."""

OnProgress = Callable[[Simulation], None]
"""Called after every step with the simulation so far."""

BYTES_PER_ROW = 400
"""Lower bound of the memory of a step per row of its contacts [bytes]. Steps with ``SORprox`` take 440 bytes per row on
a square lattice of balls, and 650 on a cubic one."""

CHECKPOINT_SECONDS = 10.0
"""Wall time between two writes of the result file [s]."""


class Hooks(TypedDict, total=False):
    """Optional callbacks of a simulation.

    Attributes:
        on_step: functions called after every step, outside the time charged to it.
        on_progress: called after every step, to show the progress.
        should_stop: called after every step; the simulation ends early if it returns True.
        checkpoint_seconds: wall time between two writes of the result file [s].
        watch_steps: wraps the steps as they are taken; by default, it subtracts compilation from their wall times. It
            is not used for scenes of plugins, whose steps are taken in another process.
    """

    on_step: Sequence[OnStep]
    on_progress: OnProgress
    should_stop: Callable[[], bool]
    checkpoint_seconds: float
    watch_steps: Callable[[Iterator[AcceptedStep]], Iterator[AcceptedStep]]


def simulate(
    plan: SimulationPlan, output: Path | None = None, *, force: bool = False, **hooks: Unpack[Hooks]
) -> Simulation:
    """Simulate from the start.

    Args:
        plan: the plan, from ``make_simulation_plan``.
        output: the result file if it ends in .npz, else its folder; nothing is stored if None.
        force: replace an existing result file.
        hooks: see ``Hooks``.

    Returns:
        The simulation; ``is_finished`` is False if it was stopped early.

    Raises:
        BenchError: if the output exists or cannot be written.
        InsufficientMemoryError: if the available memory does not suffice for a step and the states to keep.
        FailedSimulationError: if a step fails; the steps before it are stored.
    """
    simulation = Simulation(plan, file=None if output is None else output_file(output, plan.scene.name, SUFFIX, force))
    advance(simulation, **hooks)
    return simulation


def resume_simulation(
    file: Path,
    expected: Mapping[str, object] | None = None,
    *,
    duration: float | None = None,
    solver: Solver | None = None,
    **hooks: Unpack[Hooks],
) -> Simulation:
    """Continue a stored simulation. With a fixed step, the result is identical to that of an uninterrupted run.

    A variable step restarts from the last state, so its steps differ from those of an uninterrupted run within the
    tolerance.

    Args:
        file: the result file, to which steps are added.
        expected: values of the plan, see ``plan.check_agreement``. Another solver, tolerance, number of
            iterations, start or variable stepper applies to the remaining steps, for example after a failed step.
        duration: simulated time from the start [s]; as planned if None.
        solver: the solver, if ``create`` does not know it by its name.
        hooks: see ``Hooks``.

    Raises:
        BenchError: if the file is missing, damaged or foreign, contradicts ``expected``, or has already passed
            ``duration``; or if memory does not suffice.
        FailedSimulationError: as in ``simulate``.
    """
    simulation = resumable_simulation(file, expected, duration, solver)
    advance(simulation, **hooks)
    return simulation


def resumable_simulation(
    file: Path,
    expected: Mapping[str, object] | None = None,
    duration: float | None = None,
    solver: Solver | None = None,
) -> Simulation:
    """Return a stored simulation that can be continued; for arguments and errors see ``resume_simulation``."""
    simulation = read_simulation(file, solver)
    expected_values = dict(expected or {})
    check_agreement(simulation.plan, expected_values, str(file))
    changes: dict[str, Any] = {name: expected_values[name] for name in REPLACEABLE if name in expected_values}
    if duration is not None:
        changes["duration"] = duration
    plan = changed(simulation.plan, **changes)
    if simulation.state.time - plan.until > plan.stepper.shortest_step(plan.scene):
        raise BenchError(
            f"{file} has already reached {simulation.state.time:g} s, past the duration of {plan.duration:g} s; "
            "choose a longer one, or omit it."
        )
    stored, simulation.plan = simulation.plan, plan
    if simulation.is_finished:  # no step follows to which the new settings apply
        simulation.plan = stored
    return simulation


def advance(simulation: Simulation, **hooks: Unpack[Hooks]) -> None:
    """Take the remaining steps, and write the result file at intervals and at the end.

    Meanwhile, numerical libraries use one thread, as in measured cases; see ``one_library_thread``.

    Raises:
        InsufficientMemoryError: if the available memory does not suffice for a step and the states to keep.
        FailedSimulationError: if a step fails; ``failure`` of the simulation holds the reason.
    """
    if simulation.is_finished:
        return
    _require_memory(simulation)
    simulation.failure = None
    should_stop, on_progress = hooks.get("should_stop"), hooks.get("on_progress")
    checkpoint_seconds = hooks.get("checkpoint_seconds", CHECKPOINT_SECONDS)
    clock = time.perf_counter
    start_time = clock() - simulation.wall_seconds
    _store(simulation)  # detects immediately that the file cannot be written
    last_write = clock()
    steps = _steps(simulation, hooks.get("watch_steps", without_compilation))
    try:
        with one_library_thread():
            while not simulation.is_finished and not (should_stop and should_stop()):
                step = _next_step(simulation, steps)
                for on_step in hooks.get("on_step", ()):
                    on_step(simulation.n_steps, step)
                now = clock()
                simulation.wall_seconds = now - start_time
                if now - last_write >= checkpoint_seconds:
                    _store(simulation)
                    last_write = clock()
                if on_progress:
                    on_progress(simulation)
    finally:
        _store(simulation)


def _require_memory(simulation: Simulation) -> None:
    """Raise ``InsufficientMemoryError`` if the available memory does not suffice for the states and for a step.

    Positions and velocities of the states still to be kept are counted, but not their impulses. Writing the result
    file copies all states.
    """
    plan, state = simulation.plan, simulation.state
    scene, step = plan.scene, plan.stepper.resolution(plan.scene)
    if step != plan.stepper.shortest_step(scene):  # the number of variable steps is not known
        step = scene.longest_step
    n_states = min(2 * plan.states, 1 + math.floor(plan.duration / step))
    n_copied = 0 if simulation.file is None else n_states
    n_left = n_states - len(simulation.states) + n_copied
    needed = n_left * (state.position.nbytes + state.velocity.nbytes) + step_bytes(scene)
    purpose = f"a step and {counted(n_states, 'state')} of {scene.name}"
    require_memory(needed, purpose, "keep fewer states, or simulate fewer bodies")


def step_bytes(scene: Scene) -> float:
    """Return the memory that a step of a scene needs at least [bytes].

    If the bodies come to rest on each other, their contacts have at least as many rows as the bodies have degrees of
    freedom. Joints are closed after a step if the scene has a depth.
    """
    system, start = scene.system, scene.start
    needed = float(BYTES_PER_ROW * len(start.velocity))
    if scene.depth is not None and isinstance(system, RigidBodies) and system.joints is not None:
        overlaps = system.overlaps(start.position, scene.depth)
        assert overlaps is not None  # there are joints
        assert overlaps.joints is not None
        needed += joint_bytes(overlaps.joints)
    return needed


def _steps(
    simulation: Simulation, watch: Callable[[Iterator[AcceptedStep]], Iterator[AcceptedStep]]
) -> Iterator[tuple[AcceptedStep, SceneValues]]:
    """Yield the remaining steps, with energies and observables at their ends."""
    plan, states = simulation.plan, simulation.law_states
    if isinstance(plan.scene.system, RemoteSystem):
        with RemoteSteps(plan) as worker:
            yield from worker.steps(simulation.state, states)
        return
    motion = (plan.scene, plan.step_solver, plan.stop, simulation.state, plan.until)
    for step in watch(plan.stepper.steps(*motion, states=states)):
        yield step, scene_values(plan.scene, step.end)


def _store(simulation: Simulation) -> None:
    """Write the result file, if any."""
    if simulation.file is not None:
        write_simulation(simulation, simulation.file)


def _next_step(simulation: Simulation, steps: Iterator[tuple[AcceptedStep, SceneValues]]) -> AcceptedStep:
    """Take one step and add it to the simulation."""
    scene = simulation.plan.scene
    try:
        step, values = next(steps)
        row = step_row(scene, step, values, simulation.statuses)
    except (Exception, SystemExit) as error:
        raise _record_failure(simulation, error_text(error)) from error
    energies = [row.kinetic_energy] if scene.potential_energy is None else [row.kinetic_energy, row.potential_energy]
    if not all(map(math.isfinite, energies)):
        raise _record_failure(simulation, NOT_FINITE)
    simulation.append(row, step)
    return step


def _record_failure(simulation: Simulation, reason: str) -> FailedSimulationError:
    """Record that the next step failed; return the error to raise."""
    simulation.failure = Failure(
        step=simulation.n_steps + 1,
        time=simulation.state.time,
        solver=simulation.plan.solver.name,
        reason=reason.rstrip("."),
    )
    return simulation.failure.error(simulation.file)
