"""What a simulation is: scene, step size, duration and solver, all checked before anything starts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

from ...problems.scenes.registry import SCENES, Scene, make_scene
from ...problems.stepping.moreau import ContactSolver, Moreau
from ...solvers.interface import Solver, Stop
from ..errors import BenchError
from ..measure.remote_solver import local_or_remote
from .thinning import STATES

FIXED = "Moreau"
"""The stepper of fixed step size."""


class _Default(NamedTuple):
    solver: str
    tolerance: float
    max_iterations: int


_MANY_CONTACTS = _Default("MomentumFallback", 1e-4, 20_000)
"""The fastest way to the usual accuracy on hundreds of contacts and more; a rare step needs many sweeps."""

_FEW_CONTACTS = _Default("SORprox", 1e-10, 5000)
"""A few contacts afford more accuracy, and need no relaxation above 1."""


@dataclass(frozen=True, eq=False)
class SimulationPlan:
    """A simulation as it will be carried out.

    Attributes:
        scene: the scene with its options.
        step_size: Δt [s].
        duration: simulated time [s].
        solver: solves the contact problem of each step.
        tolerance: judged residual that every step shall reach.
        max_iterations: of the solver, in one step.
        states: how many states are kept at least, where there are more; twice as many at most.
    """

    scene: Scene
    step_size: float
    duration: float
    solver: Solver
    tolerance: float
    max_iterations: int
    states: int = STATES

    @property
    def n_steps(self) -> int:
        """Number of steps, the last of which reaches or passes the end of the duration."""
        return math.ceil(self.duration / self.step_size * (1.0 - 1e-12))

    @property
    def stop(self) -> Stop:
        """The stop criterion of each step; a limit of time would make the motion depend on how busy the machine is."""
        return Stop(self.tolerance, self.max_iterations, math.inf)

    def stepper(self, solver: ContactSolver | None = None) -> Moreau:
        """Return what takes the steps, with ``solver`` in place of the plan's."""
        scene = self.scene
        return Moreau(scene.system, solver or self.solver, self.stop, self.step_size, depth=scene.depth)

    def document(self) -> dict[str, Any]:
        """Return the plan as plain values, from which ``plan_from`` makes it again."""
        return {
            "scene": self.scene.name,
            "options": dict(self.scene.options),
            "step_size": self.step_size,
            "duration": self.duration,
            "solver": self.solver.name,
            "tolerance": self.tolerance,
            "max_iterations": self.max_iterations,
            "states": self.states,
        }


def make_simulation_plan(
    scene: str,
    options: Mapping[str, object] | None = None,
    *,
    step_size: float | None = None,
    duration: float | None = None,
    solver: str | Solver | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    states: int | None = None,
) -> SimulationPlan:
    """Return the plan of one simulation; what is None is taken from the scene.

    Raises:
        ProblemError: for an unknown scene or option, with the nearest name, or an option out of range.
        SolverError: for an unknown solver or option of it, with the nearest name.
        BenchError: for a step size, duration, tolerance, number of iterations or of states out of range.
    """
    made = make_scene(scene, options)
    default = _FEW_CONTACTS if SCENES[made.name].has_few_contacts else _MANY_CONTACTS
    chosen = default.solver if solver is None else solver
    plan = SimulationPlan(
        made,
        made.step_size if step_size is None else step_size,
        made.duration if duration is None else duration,
        local_or_remote(chosen) if isinstance(chosen, str) else chosen,
        default.tolerance if tolerance is None else tolerance,
        default.max_iterations if max_iterations is None else max_iterations,
        STATES if states is None else states,
    )
    _check_numbers(plan)
    return plan


def changed(plan: SimulationPlan, **changes: Any) -> SimulationPlan:
    """Return ``plan`` with other values: duration [s], solver, tolerance, max_iterations.

    Raises:
        SolverError: for an unknown solver or option of it.
        BenchError: if a number is out of range.
    """
    solver = changes.get("solver")
    if isinstance(solver, str):
        changes["solver"] = local_or_remote(solver)
    other = replace(plan, **changes)
    _check_numbers(other)
    return other


REPLACEABLE = ("solver", "tolerance", "max_iterations")
"""What a resumed simulation may take other values of: how steps are solved, not what is simulated."""


class Planned(Protocol):
    """A plan of a scene, whatever its step is."""

    @property
    def scene(self) -> Scene:
        """The scene with its options."""

    def document(self) -> dict[str, Any]:
        """Return the plan as plain values."""


def check_agreement(plan: Planned, given: Mapping[str, object], source: str) -> None:
    """Compare what is asked for with the plan of a simulation that is resumed.

    Args:
        plan: the plan as it was stored.
        given: names as in ``document`` of the plan and names of options, with the values asked for.
        source: what messages call the stored simulation.

    Raises:
        BenchError: for the first value that contradicts the plan.
        ProxbenchError: for an unknown option, or a value out of range.
    """
    stored = {**plan.document(), **plan.scene.options}
    for name, value in given.items():
        asked = value
        if name not in plan.document():
            options = SCENES[plan.scene.name].options
            if name in options:
                asked = options[name].checked(name, value)
        if name not in stored or asked != stored[name]:
            holds = f"{name} {_word(stored[name])}" if name in stored else f"no {name}"
            raise BenchError(f"{name} {_word(asked)} contradicts {source}, which has {holds}; leave it out to resume.")


def _word(value: object) -> str:
    return "off" if value is None else str(value)


def _check_numbers(plan: SimulationPlan) -> None:
    for name in ("step_size", "duration"):
        value = getattr(plan, name)
        if not 0.0 < value < math.inf:
            raise BenchError(f"{name} must be positive and finite, got {value} s.")
    if plan.step_size > plan.duration:
        raise BenchError(f"step_size {plan.step_size} s must not be longer than the duration, {plan.duration} s.")
    if not 0.0 < plan.tolerance < 1.0:
        raise BenchError(f"tolerance {plan.tolerance} must be between 0 and 1.")
    if not plan.max_iterations >= 1:
        raise BenchError(f"max_iterations must be at least 1, got {plan.max_iterations}.")
    if not plan.states >= 1:
        raise BenchError(f"states must be at least 1, got {plan.states}.")
