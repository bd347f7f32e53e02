"""The plan of a simulation: scene, stepper, duration and solver, validated before it starts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec

from ...problems.contact.solver import Solver, Stop
from ...problems.motion.scenes.registry import convert_option, parse_scene
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.stepping.event_driven.event_driven import EventDriven
from ...problems.motion.stepping.midpoint import ContactSolver
from ...problems.motion.stepping.registry import make_stepper
from ...problems.motion.stepping.stepper import Stepper
from ...problems.motion.stepping.variable_stepper import VariableStepper
from ...problems.representation import html_table
from ...solvers.composite.warm import Warm
from ..errors import BenchError
from ..isolation.worker import REQUEST_SECONDS
from ..plugins.descriptions import require_free_name
from ..plugins.remote_scene import local_or_remote_scene
from ..plugins.remote_solver import local_or_remote_solver
from ..store.fields import Count, Positive, Record, Tolerance
from ..store.plans import require_number
from .kept_states import DEFAULT_STATES
from .starts import DEFAULT_START, WARM, StepSolver, check_start, default_start


class _Default(NamedTuple):
    """Default settings of a solver."""

    solver: str
    tolerance: float
    max_iterations: int


_MANY_CONTACTS = _Default("MomentumFallback", 1e-4, 20_000)
"""The fastest solver to the usual accuracy on hundreds of contacts or more, where few steps need many sweeps."""

_FEW_CONTACTS = _Default("Fallback(SORprox, Robust)", 1e-10, 5000)
"""For few contacts, sweeps reach a finer tolerance without over-relaxation; ``Robust`` solves the other steps."""

_VARIABLE_STEP = _Default("SORprox", 1e-12, 100_000)
"""Switching points are located from forces, whose accuracy decreases with the step size."""

_EVENT_DRIVEN = _Default("Enumeration", 1e-12, 100_000)
"""The laws at events are solved exactly."""

REPLACEABLE = ("stepper", "solver", "tolerance", "max_iterations", "start", "step_seconds")
"""Settings that a resumed simulation may change: those of stepper and solver, not of the scene."""


class PlanRecord(Record, frozen=True, kw_only=True):
    """A stored plan, with the arguments of ``make_simulation_plan``."""

    scene: str
    options: dict[str, Any]
    stepper: str
    duration: Positive
    solver: str
    tolerance: Tolerance
    max_iterations: Count
    start: str
    states: Count
    step_seconds: Positive


@dataclass(frozen=True, eq=False)
class SimulationPlan:
    """A simulation to run.

    Attributes:
        scene: the scene with its options.
        stepper: the stepper.
        duration: simulated time [s].
        solver: solver of the contact problem of each one-step inclusion.
        tolerance: judged residual that each solve must reach.
        max_iterations: iteration limit of each solve.
        start: initial impulses of each solve: "warm", "cold", "warm-then-cold" or "scaled", see ``starts``.
        states: N; a simulation of more steps keeps N to 2 N states, and those at switching points in addition.
        step_seconds: wall time limit of a plugin's scene or solver for one step [s].
    """

    scene: Scene
    stepper: Stepper
    duration: float
    solver: Solver
    tolerance: float
    max_iterations: int
    start: str = DEFAULT_START
    states: int = DEFAULT_STATES
    step_seconds: float = REQUEST_SECONDS

    def __repr__(self) -> str:
        text = f"{self.scene.name}, {self.duration:g} s in {self.stepper.name} with {self.solver.name}"
        return f"<SimulationPlan: {text} to {self.tolerance:g}>"

    def _repr_html_(self) -> str:
        facts: dict[str, object] = {"duration [s]": self.duration, "stepper": self.stepper.name}
        facts |= {"solver": self.solver.name, "tolerance": self.tolerance, "start": self.start}
        return html_table(f"Simulation of {self.scene.name}", facts)

    @property
    def until(self) -> float:
        """End time [s]."""
        return self.scene.start.time + self.duration

    @property
    def stop(self) -> Stop:
        """The stopping criteria of each step; there is no time limit, so the motion does not depend on the load."""
        return Stop(self.tolerance, self.max_iterations, math.inf)

    @property
    def step_solver(self) -> ContactSolver:
        """The solver in the form that steppers require."""
        return StepSolver(self.solver, self.start)

    @property
    def record(self) -> PlanRecord:
        """The plan as plain values, the arguments of ``make_simulation_plan``."""
        values: dict[str, Any] = {"scene": self.scene.name, "options": dict(self.scene.options), "start": self.start}
        values |= {name: getattr(self, name).name for name in ("stepper", "solver")}
        values |= {name: float(getattr(self, name)) for name in ("duration", "tolerance", "step_seconds")}
        values |= {name: int(getattr(self, name)) for name in ("max_iterations", "states")}
        return PlanRecord(**values)


def make_simulation_plan(
    scene: str,
    options: Mapping[str, object] | None = None,
    *,
    stepper: str | Stepper | None = None,
    duration: float | None = None,
    solver: str | Solver | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    start: str | None = None,
    states: int | None = None,
    step_seconds: float | None = None,
) -> SimulationPlan:
    """Return the plan of one simulation: ``make_simulation_plan("pile(balls=60)", stepper="Moreau(step=1e-3)")``.

    Names of scene, stepper and solver may include options; ``options`` are additional options of the scene. See
    ``SimulationPlan`` for the other arguments. By default, the duration is that of the scene, the stepper is
    ``Extrapolated`` for few contacts and ``Moreau`` otherwise, and solver, tolerance and iterations suit scene and
    stepper.

    Raises:
        ProblemError: for an unknown scene, stepper or option, with the nearest name, or an option out of range.
        SolverError: for an unknown solver or option of it, with the nearest name.
        BenchError: for an unknown start, or a duration, tolerance, number of iterations or of states, or time limit
            out of range.
    """
    seconds = REQUEST_SECONDS if step_seconds is None else step_seconds
    _check_seconds(seconds)
    new_scene = local_or_remote_scene(scene, options, seconds)
    stepper_or_name = ("Extrapolated" if new_scene.has_few_contacts else "Moreau") if stepper is None else stepper
    new_stepper = (
        make_stepper(stepper_or_name) if isinstance(stepper_or_name, str) else stepper_or_name
    ).with_defaults_of(new_scene)
    default = _default_settings(new_scene, new_stepper)
    solver_or_name = default.solver if solver is None else solver
    if not isinstance(solver_or_name, str):
        require_free_name(solver_or_name)
    plan = SimulationPlan(
        new_scene,
        new_stepper,
        new_scene.duration if duration is None else duration,
        local_or_remote_solver(solver_or_name, seconds) if isinstance(solver_or_name, str) else solver_or_name,
        default.tolerance if tolerance is None else tolerance,
        default.max_iterations if max_iterations is None else max_iterations,
        default_start(new_stepper) if start is None else start,
        DEFAULT_STATES if states is None else states,
        seconds,
    )
    _check_numbers(plan)
    return plan


def _default_settings(scene: Scene, stepper: Stepper) -> _Default:
    """Return the default settings of the solver for a scene and a stepper."""
    if isinstance(stepper, EventDriven):
        return _EVENT_DRIVEN
    if isinstance(stepper, VariableStepper):
        return _VARIABLE_STEP
    return _FEW_CONTACTS if scene.has_few_contacts else _MANY_CONTACTS


def changed(plan: SimulationPlan, **changes: Any) -> SimulationPlan:
    """Return a copy of ``plan`` with other arguments of ``make_simulation_plan``, which may raise its errors."""
    if not changes:
        return plan
    # a plugin's solver gets its time limit when it is created
    solver = plan.solver.name if "step_seconds" in changes else plan.solver
    arguments = {**msgspec.structs.asdict(plan.record), "stepper": plan.stepper, "solver": solver}
    return make_simulation_plan(**{**arguments, **changes})


def check_agreement(plan: SimulationPlan, expected: Mapping[str, Any], source: str) -> None:
    """Check that expected values agree with the plan of a simulation that is resumed.

    Args:
        plan: the stored plan.
        expected: values by the names of ``PlanRecord``. The scene, with or without options, and ``states`` must equal
            the stored ones. A variable stepper may be replaced by another variable stepper. Other values may differ.
        source: name of the stored simulation in messages.

    Raises:
        BenchError: for the first value that contradicts the plan.
        ProxbenchError: for an unknown option, or a value out of range.
    """
    stored = {**msgspec.structs.asdict(plan.record), **plan.scene.options}
    for name, value in _required_values(plan, expected):
        if name not in stored or value != stored[name]:
            holds = f"{name} {_value_text(stored[name])}" if name in stored else f"no {name}"
            raise BenchError(f"{name} {_value_text(value)} contradicts {source}, which has {holds}; omit it to resume.")


def _required_values(plan: SimulationPlan, expected: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Return the names and values that must equal the stored ones."""
    values: list[tuple[str, Any]] = []
    if "scene" in expected:
        name, options = parse_scene(expected["scene"])
        values.append(("scene", name))
        if name == plan.scene.name:
            values += [(option, convert_option(name, option, value)) for option, value in options.items()]
    if "stepper" in expected:
        stepper = expected["stepper"]
        new_stepper = (make_stepper(stepper) if isinstance(stepper, str) else stepper).with_defaults_of(plan.scene)
        if not (isinstance(new_stepper, VariableStepper) and isinstance(plan.stepper, VariableStepper)):
            values.append(("stepper", new_stepper.name))
    if "states" in expected:
        values.append(("states", expected["states"]))
    return values


def _value_text(value: object) -> str:
    return "off" if value is None else str(value)


def _check_seconds(seconds: float) -> None:
    if not 0.0 < seconds < math.inf:
        raise BenchError(f"`step_seconds` must be positive and finite, got {seconds:g}; omit it for the default.")


def _check_numbers(plan: SimulationPlan) -> None:
    """Raise ``BenchError`` if a number of a plan is out of range, or its start does not suit solver and stepper."""
    for name in ("duration", "tolerance", "max_iterations", "states"):
        require_number(name, getattr(plan, name))
    if not 0.0 < plan.duration < math.inf:
        raise BenchError(f"`duration` must be positive and finite, got {plan.duration:g}; omit it for the default.")
    if not 0.0 < plan.tolerance < 1.0:
        raise BenchError(f"`tolerance` must be between 0 and 1, got {plan.tolerance:g}; omit it for the default.")
    if not plan.max_iterations >= 1:
        raise BenchError(f"`max_iterations` must be at least 1, got {plan.max_iterations}; omit it for the default.")
    check_start(plan.start)
    if isinstance(plan.solver, Warm):
        raise BenchError(
            f"the start is a separate option of a simulation; use {plan.solver.solver.name} with start={WARM}."
        )
    if not plan.stepper.uses_last_impulses and plan.start != default_start(plan.stepper):
        raise BenchError(
            f"{plan.stepper.name} starts each solve from zero and does not support start={plan.start}; use start=cold."
        )
    if not plan.states >= 1:
        raise BenchError(f"states must be at least 1, got {plan.states}.")
    plan.stepper.check(plan.scene, plan.scene.start.time, plan.until)
