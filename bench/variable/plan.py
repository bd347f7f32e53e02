"""What a simulation with variable steps is, checked before anything starts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from ...problems.scenes.registry import Scene, make_scene
from ...problems.stepping.moreau import ContactSolver
from ...problems.stepping.variable_step import VariableStep
from ...solvers.interface import Solver, Stop
from ..errors import BenchError
from ..measure.remote_solver import local_or_remote
from ..simulation.thinning import STATES
from .steppers import Stepper, make_stepper

DEFAULT_STEPPER = "Extrapolated"

DEFAULT_SOLVER = "SORprox"

DEFAULT_TOLERANCE = 1e-12
"""Switching points are told from forces, which lose as many digits as a step is shorter than the others."""

DEFAULT_ITERATIONS = 100_000


@dataclass(frozen=True, eq=False)
class VariablePlan:
    """A simulation with variable steps as it will be carried out.

    Attributes:
        scene: the scene with its options.
        stepper: takes the steps.
        duration: simulated time [s].
        solver: solves the one-step inclusions.
        tolerance: judged residual that each of them shall reach.
        max_iterations: of the solver, in one of them.
        states: how many states are kept at least, where there are more, beside those at switching points.
    """

    scene: Scene
    stepper: Stepper
    duration: float
    solver: Solver
    tolerance: float
    max_iterations: int
    states: int = STATES

    @property
    def until(self) -> float:
        """The end [s]."""
        return self.scene.start.time + self.duration

    @property
    def stop(self) -> Stop:
        """The stop criterion of each one-step inclusion."""
        return Stop(self.tolerance, self.max_iterations, math.inf)

    def steps(self, solver: ContactSolver | None = None) -> VariableStep:
        """Return what takes the steps, with ``solver`` in place of the plan's."""
        scene = self.scene
        return self.stepper.over(scene.system, solver or self.solver, self.stop, scene.longest_step)

    def document(self) -> dict[str, Any]:
        """Return the plan as plain values, from which ``make_variable_plan`` makes it again."""
        return {
            "scene": self.scene.name,
            "options": dict(self.scene.options),
            "stepper": self.stepper.name,
            "duration": self.duration,
            "solver": self.solver.name,
            "tolerance": self.tolerance,
            "max_iterations": self.max_iterations,
            "states": self.states,
        }


def make_variable_plan(
    scene: str,
    options: Mapping[str, object] | None = None,
    *,
    stepper: str | Stepper | None = None,
    duration: float | None = None,
    solver: str | Solver | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    states: int | None = None,
) -> VariablePlan:
    """Return the plan of one simulation; what is None has a default.

    Raises:
        ProblemError: for an unknown scene or option, an option out of range, or a minimal step too short for times.
        SolverError: for an unknown solver or option of it.
        BenchError: for an unknown stepper or option of it, or a number out of range.
    """
    made = make_scene(scene, options)
    chosen = DEFAULT_SOLVER if solver is None else solver
    named = DEFAULT_STEPPER if stepper is None else stepper
    plan = VariablePlan(
        made,
        make_stepper(named) if isinstance(named, str) else named,
        made.duration if duration is None else duration,
        local_or_remote(chosen) if isinstance(chosen, str) else chosen,
        DEFAULT_TOLERANCE if tolerance is None else tolerance,
        DEFAULT_ITERATIONS if max_iterations is None else max_iterations,
        STATES if states is None else states,
    )
    _check_numbers(plan)
    return plan


def changed(plan: VariablePlan, **changes: Any) -> VariablePlan:
    """Return ``plan`` with other values.

    Raises:
        BenchError: if one is out of range.
        ProblemError: if one of the stepper is, or its minimal step too short for the times.
    """
    other = replace(plan, **changes)
    _check_numbers(other)
    return other


def _check_numbers(plan: VariablePlan) -> None:
    if not 0.0 < plan.duration < math.inf:
        raise BenchError(f"duration must be positive and finite, got {plan.duration} s.")
    if not 0.0 < plan.tolerance < 1.0:
        raise BenchError(f"tolerance {plan.tolerance} must be between 0 and 1.")
    if not plan.max_iterations >= 1:
        raise BenchError(f"max_iterations must be at least 1, got {plan.max_iterations}.")
    if not plan.states >= 1:
        raise BenchError(f"states must be at least 1, got {plan.states}.")
    plan.steps().check_times(plan.scene.start.time, plan.until)
