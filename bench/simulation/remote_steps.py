"""The steps of a scene of a plugin, taken as a whole in one process: one request a step, whatever the step needs.

Scene, stepper and solver work there. What was solved comes back with each step, so that the judge works here.
"""

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import msgspec
import numpy as np

from ...problems.contact.solver import Status, Stop
from ...problems.errors import ProxbenchError
from ...problems.exchange.plugin_scenes import build_plugin_scene
from ...problems.motion.bodies.system import StepAssembly
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.midpoint import step_problem
from ...problems.motion.stepping.registry import make_stepper
from ...problems.motion.stepping.step import AcceptedStep, LawStates, Step, SwitchingPoint
from ...problems.motion.stepping.variable_stepper import VariableStepper
from ...solvers import registry
from ..errors import BenchError
from ..isolation.worker import REQUEST_SECONDS, Fault, RenewedWorker, no_answer
from ..plugins.remote_scene import RemoteSystem
from ..plugins.remote_solver import RemoteSolver
from ..plugins.scene_arrays import (
    UNFIT,
    Arrays,
    checked_keys,
    contact_arrays,
    finite_numbers,
    mass_arrays,
    packed,
    read_contacts,
    read_inverse_mass,
    unpacked,
)
from ..store.fields import Count, Number, Record
from .plan import SimulationPlan
from .starts.registry import make_step_solver
from .step_clock import WarmClock, warm_up
from .step_row import SceneValues, scene_values


class SolvedRecord(Record, frozen=True, kw_only=True):
    """A one-step solve, whose arrays stand beside.

    Attributes:
        length: Δt [s].
        time: at its end [s].
        status: how the solver ended, None if no contact was active.
        iterations: of the solver.
    """

    length: Number
    time: Number
    status: Status | None
    iterations: Count


class StepRecord(Record, frozen=True, kw_only=True):
    """An accepted step, whose arrays stand beside; see ``AcceptedStep`` and ``SceneValues``."""

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


def moves_in_child(plan: SimulationPlan) -> bool:
    """Whether the steps of a plan can be taken as a whole in one process: its solver can be made there by its name."""
    is_named = type(plan.solver).__module__.startswith(f"{registry.__package__}.")
    return isinstance(plan.scene.system, RemoteSystem) and (is_named or isinstance(plan.solver, RemoteSolver))


class RemoteSteps(RenewedWorker):
    """The steps of a plan, taken in a process of their own, which ends with the object."""

    def __init__(self, plan: SimulationPlan) -> None:
        task = StepsTask(
            plan.scene.name,
            dict(plan.scene.options),
            plan.stepper.name,
            plan.solver.name,
            plan.start,
            plan.stop,
            plan.until,
        )
        super().__init__(task, plan.step_seconds)
        self._scene = plan.scene

    def steps(self, start: State, states: LawStates | None) -> Iterator[tuple[AcceptedStep, SceneValues]]:
        """Yield the accepted steps from ``start``, with what the scene says at their ends.

        Raises:
            BenchError: if a step fails, or is not answered.
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
                # a step may be held back until the next one is tried, so only the sum is bounded
                if taken.seconds < 0.0 or charged > time.monotonic() - began:
                    raise ValueError("no time of a step")
            except UNFIT:
                self.close()
                raise self.failure(no_answer()) from None
            yield taken, values
            begin, allowed = taken.end, self.seconds

    def failure(self, fault: Fault) -> Exception:
        """Return the error of a request that is not answered, as the scene itself would report it."""
        system = self._scene.system
        assert isinstance(system, RemoteSystem)
        return system.failure(fault)

    def _answer(self, request: str, *arguments: Any, seconds: float) -> tuple[dict[str, Any], bytes]:
        answer, content = self.ask(request, *arguments, seconds=seconds)
        if "failed" in answer:
            raise BenchError(str(answer["failed"]))
        return answer, content


def _read(about: StepRecord, arrays: Arrays, begin: State, scene: Scene) -> tuple[AcceptedStep, SceneValues]:
    """Return a step, and what the scene says at its end."""
    sizes = (len(begin.position), len(begin.velocity))
    velocity, substeps = begin.velocity, []
    for number, one in enumerate(about.solved):
        own = _part(arrays, f"solve{number}")
        step = _read_solve(one, own, velocity, sizes)
        substeps.append((step, one.length))
        velocity = step.state.velocity
    end = _read_state(about.time, _part(arrays, "end"), sizes)
    if len(about.observed) != len(scene.observables) or not end.time > begin.time:
        raise ValueError("no step of this scene")
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


def _read_solve(about: SolvedRecord, arrays: Arrays, begin: Any, sizes: tuple[int, int]) -> Step:
    """Return a one-step solve, whose problem is made here of the system as it was linearised there."""
    state = _read_state(about.time, arrays, sizes)
    if "free_motion" not in arrays:
        return Step(state, None, np.zeros(0), None, None, 0)
    contacts = read_contacts(arrays, sizes[1])
    inverse_mass = read_inverse_mass(arrays, sizes[1])
    assembly = StepAssembly(finite_numbers(arrays["free_motion"], (sizes[1],)), inverse_mass, contacts)
    problem = step_problem(assembly, contacts, begin)
    impulses = finite_numbers(arrays["solution"], (problem.n_rows,))
    return Step(state, problem, impulses, contacts, about.status, about.iterations)


def _read_state(at: float, arrays: Arrays, sizes: tuple[int, int]) -> State:
    position, velocity = (
        finite_numbers(arrays[name], (size,)) for name, size in zip(("position", "velocity"), sizes, strict=True)
    )
    keys = checked_keys(arrays["state_keys"])
    impulses = arrays["state_impulses"]
    return State(at, position, velocity, keys, finite_numbers(impulses, (len(keys), *impulses.shape[1:2])))


def _part(arrays: Arrays, prefix: str) -> Arrays:
    return {name.removeprefix(f"{prefix}."): one for name, one in arrays.items() if name.startswith(f"{prefix}.")}


@dataclass
class StepsTask:
    """The child's half: answers "begin" (state, states of the laws) and "step"."""

    scene: str
    options: dict[str, Any]
    stepper: str
    solver: str
    start: str
    stop: Stop
    until: float
    _made: Scene | None = None
    _steps: Iterator[AcceptedStep] = field(default_factory=lambda: iter(()))

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request; an error of a step in words is answered as {"failed": sentence}."""
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
        return _described(self._made, taken)

    def _begin(self, start: State, states: LawStates | None) -> None:
        self._made = build_plugin_scene(self.scene, self.options)
        stepper, solver = make_stepper(self.stepper), make_step_solver(self.start, registry.create(self.solver))
        motion = (self._made, solver, self.stop, start, self.until)
        if isinstance(stepper, VariableStepper):
            warm_up(stepper, *motion, states)
        self._steps = stepper.steps(*motion, states=states, clock=WarmClock())


def _described(scene: Scene, taken: AcceptedStep) -> tuple[dict[str, Any], bytes]:
    """Return an accepted step as a record and its arrays."""
    values = scene_values(scene, taken.end)
    arrays = {f"end.{name}": one for name, one in _state_arrays(taken.end).items()}
    solved = []
    for number, (step, length) in enumerate(taken.substeps):
        status = None if step.status is None else str(step.status)
        solved.append({"length": length, "time": step.state.time, "status": status, "iterations": int(step.iterations)})
        arrays |= {f"solve{number}.{name}": one for name, one in _solve_arrays(step).items()}
    step_fields = {
        "time": taken.end.time,
        "error": float(taken.error),
        "solved": solved,
        "switches": [asdict(switch) for switch in taken.switches],
        "states": {**asdict(taken.states), "slips": {str(key): slip for key, slip in taken.states.slips.items()}},
        "solves": taken.solves,
        "rejected": taken.rejected,
        "seconds": taken.seconds,
        **asdict(values),
    }
    return {"step": step_fields}, packed(arrays)


def _state_arrays(state: State) -> Arrays:
    own = {"position": state.position, "velocity": state.velocity}
    return {**own, "state_keys": state.keys.astype(np.int64), "state_impulses": state.impulses}


def _solve_arrays(step: Step) -> Arrays:
    arrays = _state_arrays(step.state)
    if step.problem is None or step.contacts is None:
        return arrays
    factors = step.problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    solved = {"free_motion": factors.free_motion, "solution": step.impulses}
    return {**arrays, **solved, **mass_arrays(factors.inverse_mass), **contact_arrays(step.contacts)}
