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
from ..isolation.worker import REQUEST_SECONDS, Fault, RenewedWorker, invalid_answer_fault
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
        time: time at its end [s].
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
    rejected: Count
    seconds: Number
    kinetic_energy: float
    potential_energy: float
    observed: tuple[float, ...]


class RemoteSteps(RenewedWorker):
    """The steps of a plan, taken in a separate process, which ends with the object."""

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
        allowed = max(self.seconds, REQUEST_SECONDS)  # the process imports and compiles first
        self._answer("begin", start, states, seconds=allowed)
        begin, began, charged = start, time.monotonic(), 0.0
        while True:
            answer, content = self._answer("step", seconds=allowed)
            if answer.get("has_ended"):
                return
            try:
                taken, values = _read(
                    msgspec.convert(answer["step"], StepRecord, str_keys=True), unpacked(content), begin, self._scene
                )
                charged += taken.seconds
                # a stepper may try the next step before it yields one, so only the sum is bounded
                if taken.seconds < 0.0 or charged > time.monotonic() - began:
                    raise ValueError("the time of a step is out of range")
            except MALFORMED_ANSWER_ERRORS:
                self.close()
                raise self.failure(invalid_answer_fault()) from None
            yield taken, values
            begin, allowed = taken.end, self.seconds

    def failure(self, fault: Fault) -> Exception:
        """Return the error for a request without an answer, the same as the scene's system returns."""
        system = self._scene.system
        assert isinstance(system, RemoteSystem)
        return system.failure(fault)

    def _answer(self, request: str, *arguments: Any, seconds: float) -> tuple[dict[str, Any], bytes]:
        answer, content = self.ask(request, *arguments, seconds=seconds)
        if "failed" in answer:
            raise BenchError(str(answer["failed"]))
        return answer, content


def _read(about: StepRecord, arrays: Arrays, begin: State, scene: Scene) -> tuple[AcceptedStep, SceneValues]:
    """Return a step, with energies and observables at its end."""
    velocity, substeps = begin.velocity, []
    for number, one in enumerate(about.solved):
        step = _read_solve(one, _part(arrays, f"solve{number}"), velocity, len(begin.position))
        substeps.append((step, one.length))
        velocity = step.state.velocity
    end = read_state(about.time, _part(arrays, "end"), len(begin.position), len(begin.velocity))
    if len(about.observed) != len(scene.observables) or not end.time > begin.time:
        raise ValueError("the step does not fit the scene")
    taken = AcceptedStep(
        begin,
        end,
        substeps,
        about.error,
        about.states,
        about.switches,
        about.solves,
        about.rejected,
        about.seconds,
    )
    return taken, SceneValues(about.kinetic_energy, about.potential_energy, about.observed)


def _read_solve(about: SolvedRecord, arrays: Arrays, begin: FloatArray, n_coordinates: int) -> Step:
    """Return a one-step solve, with its problem assembled from the linearised system of the process.

    Args:
        about: its record.
        arrays: its arrays.
        begin: velocity at its beginning, shape (n_dofs,).
        n_coordinates: number of coordinates.
    """
    n_dofs = len(begin)
    state = read_state(about.time, arrays, n_coordinates, n_dofs)
    if "free_motion" not in arrays:
        return Step(state, None, np.zeros(0), None, None, 0, about.overlap)
    contacts = read_contacts(arrays, n_dofs)
    free_motion = finite_numbers(arrays["free_motion"], (n_dofs,))
    problem = step_problem(StepAssembly(free_motion, read_inverse_mass(arrays, n_dofs), contacts), contacts, begin)
    impulses = finite_numbers(arrays["solution"], (problem.n_rows,))
    return Step(state, problem, impulses, contacts, about.status, about.iterations, about.overlap)


def _part(arrays: Arrays, prefix: str) -> Arrays:
    return {name.removeprefix(f"{prefix}."): one for name, one in arrays.items() if name.startswith(f"{prefix}.")}


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
    _made: Scene | None = None
    _steps: Iterator[AcceptedStep] = field(default_factory=lambda: iter(()))

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request; the answer to a failed one is {"failed": sentence}."""
        try:
            if request == "begin":
                self._begin(*arguments)
                return {}, b""
            taken = next(self._steps, None)
        except ProxbenchError as error:
            return {"failed": str(error)}, b""
        if taken is None:
            return {"has_ended": True}, b""
        assert self._made is not None
        record, arrays = _describe(self._made, taken)
        return {"step": msgspec.to_builtins(record, str_keys=True)}, packed(arrays)

    def _begin(self, start: State, states: LawStates | None) -> None:
        self._made = build_plugin_scene(self.scene, self.options)
        stepper, solver = make_stepper(self.stepper), StepSolver(self.solver.make(), self.start)
        motion = (self._made, solver, self.stop, start, self.until)
        self._steps = stepper.steps(*motion, states=states)


def _describe(scene: Scene, taken: AcceptedStep) -> tuple[StepRecord, Arrays]:
    """Return an accepted step as a record and its arrays."""
    arrays = {f"end.{name}": one for name, one in state_arrays(taken.end).items()}
    solved = []
    for number, (step, length) in enumerate(taken.substeps):
        solved.append(
            SolvedRecord(
                length=length,
                time=step.state.time,
                status=step.status,
                iterations=int(step.iterations),
                overlap=float(step.overlap),
            )
        )
        arrays |= {f"solve{number}.{name}": one for name, one in _solve_arrays(step).items()}
    record = StepRecord(
        time=taken.end.time,
        error=float(taken.error),
        solved=solved,
        switches=list(taken.switches),
        states=taken.states,
        solves=taken.solves,
        rejected=taken.rejected,
        seconds=taken.seconds,
        **asdict(scene_values(scene, taken.end)),
    )
    return record, arrays


def _solve_arrays(step: Step) -> Arrays:
    arrays = state_arrays(step.state)
    if step.problem is None or step.contacts is None:
        return arrays
    factors = step.problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    solved = {"free_motion": factors.free_motion, "solution": step.impulses}
    return {**arrays, **solved, **mass_arrays(factors.inverse_mass), **contact_arrays(step.contacts)}
