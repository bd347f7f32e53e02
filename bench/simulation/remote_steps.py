"""The steps of a plugin's scene, taken in one process with one request per step.

Scene, stepper and solver run there. Each step returns its solved problems, which are judged here.
"""

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import msgspec
import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status, Stop
from ...problems.errors import ProxbenchError
from ...problems.exchange.plugins.scenes import build_plugin_scene
from ...problems.motion.bodies.system import StepAssembly
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.midpoint import step_problem
from ...problems.motion.stepping.registry import make_stepper
from ...problems.motion.stepping.step import AcceptedStep, LawStates, Step, SwitchingPoint
from ..errors import BenchError
from ..isolation.worker import REQUEST_SECONDS, Fault, RenewedWorker
from ..plugins.descriptions import solver_spec
from ..plugins.remote_scene import RemoteSystem
from ..plugins.remote_solver import RemoteSolver
from ..plugins.scene_arrays import (
    MALFORMED_ANSWER_ERRORS,
    Arrays,
    contact_arrays,
    finite_numbers,
    mass_arrays,
    packed,
    read_contacts,
    read_inverse_mass,
    read_state,
    state_arrays,
    unpacked,
)
from ..plugins.solver_specs import SolverSpec
from ..store.fields import Count, Number, Record
from .plan import SimulationPlan
from .starts import StepSolver
from .step_row import SceneValues, scene_values


class SolvedRecord(Record, frozen=True, kw_only=True):
    """A one-step solve without its arrays.

    Attributes:
        length: Δt [s].
        time: time at the end of the step [s].
        status: status of the solver; None if no contact was active.
        iterations: number of iterations.
        overlap: penetration [m] that the projection of positions leaves; see ``Step``.
    """

    length: Number
    time: Number
    status: Status | None
    iterations: Count
    overlap: Number


class StepRecord(Record, frozen=True, kw_only=True):
    """An accepted step without its arrays; see ``AcceptedStep`` and ``SceneValues``."""

    time: Number
    error: Number
    solved: list[SolvedRecord]
    switches: list[SwitchingPoint]
    states: LawStates
    solves: Count
    iterations: Count
    rejected: Count
    seconds: Number
    kinetic_energy: float
    potential_energy: float
    observed: tuple[float, ...]


class RemoteSteps(RenewedWorker):
    """The steps of a plan, taken in a separate process, which ends when the object is closed."""

    def __init__(self, plan: SimulationPlan) -> None:
        solver = plan.solver.spec if isinstance(plan.solver, RemoteSolver) else solver_spec(plan.solver)
        scene, options = plan.scene.name, dict(plan.scene.options)
        task = StepsTask(scene, options, plan.stepper.name, solver, plan.start, plan.stop, plan.until)
        super().__init__(task, plan.step_seconds, solvers=solver.compiled_solvers)
        self._scene = plan.scene

    def steps(self, start: State, states: LawStates | None) -> Iterator[tuple[AcceptedStep, SceneValues]]:
        """Yield the accepted steps from ``start``, with energies and observables at their ends.

        Raises:
            BenchError: if a step fails, or the process does not answer.
        """
        limit_seconds = max(self.seconds, REQUEST_SECONDS)  # the process imports and compiles first
        self._request("begin", start, states, seconds=limit_seconds)
        begin, start_time, total_seconds = start, time.monotonic(), 0.0
        while True:
            answer, content = self._request("step", seconds=limit_seconds)
            if answer.get("has_ended"):
                return
            try:
                step, values = _read_step(
                    msgspec.convert(answer["step"], StepRecord, str_keys=True), unpacked(content), begin, self._scene
                )
                total_seconds += step.seconds
                # a stepper may try the next step before it yields one, so only the sum is bounded
                if step.seconds < 0.0 or total_seconds > time.monotonic() - start_time:
                    raise ValueError("the time of a step is out of range")
            except MALFORMED_ANSWER_ERRORS:
                raise self.reject_answer() from None
            yield step, values
            begin, limit_seconds = step.end, self.seconds

    def failure(self, fault: Fault) -> Exception:
        """Return the error for a request without an answer, which is that of the scene's system."""
        system = self._scene.system
        assert isinstance(system, RemoteSystem)
        return system.failure(fault)

    def _request(self, request: str, *arguments: Any, seconds: float) -> tuple[dict[str, Any], bytes]:
        """Return the answer to a request; raise ``BenchError`` if the step has failed."""
        answer, content = self.ask(request, *arguments, seconds=seconds)
        if "failed" in answer:
            raise BenchError(str(answer["failed"]))
        return answer, content


def _read_step(record: StepRecord, arrays: Arrays, begin: State, scene: Scene) -> tuple[AcceptedStep, SceneValues]:
    """Return a step, with energies and observables at its end."""
    velocity, substeps = begin.velocity, []
    for number, solve in enumerate(record.solved):
        step = _read_solve(solve, _with_prefix(arrays, f"solve{number}"), velocity, len(begin.position))
        substeps.append((step, solve.length))
        velocity = step.state.velocity
    end = read_state(record.time, _with_prefix(arrays, "end"), len(begin.position), len(begin.velocity))
    if len(record.observed) != len(scene.observables) or not end.time > begin.time:
        raise ValueError("the step does not fit the scene")
    accepted = AcceptedStep(
        begin,
        end,
        substeps,
        record.error,
        record.states,
        record.switches,
        record.solves,
        record.iterations,
        record.rejected,
        record.seconds,
    )
    return accepted, SceneValues(record.kinetic_energy, record.potential_energy, record.observed)


def _read_solve(record: SolvedRecord, arrays: Arrays, begin: FloatArray, n_coordinates: int) -> Step:
    """Return a one-step solve, with its problem assembled from the linearised system of the process.

    Args:
        record: the record of the solve.
        arrays: the arrays of the solve.
        begin: velocity at the beginning of the solve, shape (n_dofs,).
        n_coordinates: number of coordinates.
    """
    n_dofs = len(begin)
    state = read_state(record.time, arrays, n_coordinates, n_dofs)
    if "free_motion" not in arrays:
        return Step(state, None, np.zeros(0), None, None, 0, record.overlap)
    contacts = read_contacts(arrays, n_dofs)
    free_motion = finite_numbers(arrays["free_motion"], (n_dofs,))
    problem = step_problem(StepAssembly(free_motion, read_inverse_mass(arrays, n_dofs), contacts), contacts, begin)
    impulses = finite_numbers(arrays["solution"], (problem.n_rows,))
    return Step(state, problem, impulses, contacts, record.status, record.iterations, record.overlap)


def _with_prefix(arrays: Arrays, prefix: str) -> Arrays:
    """Return the arrays whose names begin with ``prefix`` and a dot, without this beginning."""
    return {name.removeprefix(f"{prefix}."): array for name, array in arrays.items() if name.startswith(f"{prefix}.")}


@dataclass
class StepsTask:
    """The task of the child: it answers "begin" (state, states of the laws) and "step"."""

    scene: str
    options: dict[str, Any]
    stepper: str
    solver: SolverSpec
    start: str
    stop: Stop
    until: float
    _built_scene: Scene | None = None
    _steps: Iterator[AcceptedStep] = field(default_factory=lambda: iter(()))

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request; the answer to a failed request is {"failed": sentence}."""
        try:
            if request == "begin":
                self._begin(*arguments)
                return {}, b""
            step = next(self._steps, None)
        except ProxbenchError as error:
            return {"failed": str(error)}, b""
        if step is None:
            return {"has_ended": True}, b""
        assert self._built_scene is not None
        record, arrays = _describe(self._built_scene, step)
        return {"step": msgspec.to_builtins(record, str_keys=True)}, packed(arrays)

    def _begin(self, start: State, states: LawStates | None) -> None:
        self._built_scene = build_plugin_scene(self.scene, self.options)
        stepper, solver = make_stepper(self.stepper), StepSolver(self.solver.make(), self.start)
        motion = (self._built_scene, solver, self.stop, start, self.until)
        self._steps = stepper.steps(*motion, states=states)


def _describe(scene: Scene, accepted: AcceptedStep) -> tuple[StepRecord, Arrays]:
    """Return an accepted step as a record and its arrays."""
    arrays = {f"end.{name}": array for name, array in state_arrays(accepted.end).items()}
    solved = []
    for number, (step, length) in enumerate(accepted.substeps):
        solved.append(
            SolvedRecord(
                length=length,
                time=step.state.time,
                status=step.status,
                iterations=int(step.iterations),
                overlap=float(step.overlap),
            )
        )
        arrays |= {f"solve{number}.{name}": array for name, array in _solve_arrays(step).items()}
    record = StepRecord(
        time=accepted.end.time,
        error=float(accepted.error),
        solved=solved,
        switches=list(accepted.switches),
        states=accepted.states,
        solves=accepted.solves,
        iterations=int(accepted.iterations),
        rejected=accepted.rejected,
        seconds=accepted.seconds,
        **asdict(scene_values(scene, accepted.end)),
    )
    return record, arrays


def _solve_arrays(step: Step) -> Arrays:
    """Return the arrays of a one-step solve, for ``_read_solve``."""
    arrays = state_arrays(step.state)
    if step.problem is None or step.contacts is None:
        return arrays
    factors = step.problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    solved = {"free_motion": factors.free_motion, "solution": step.impulses}
    return {**arrays, **solved, **mass_arrays(factors.inverse_mass), **contact_arrays(step.contacts)}
