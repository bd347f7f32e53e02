"""What a study measures: its cases, each with a stepper, a solver and their tolerances, and repeated by members."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from ...problems.stepping.registry import make_stepper
from ..simulation.plan import SimulationPlan, make_simulation_plan

FIXED = "Moreau"
"""The stepper of fixed step size, whose size stands beside it."""

REFERENCE = "reference"
"""The part of a study that others are compared with."""


@dataclass(frozen=True)
class Case:
    """One setting; a study measures it once for each member.

    Attributes:
        part: which part of the study it belongs to: "steppers", "solvers" or "reference".
        series: the curve it is a point of.
        stepper: "Moreau", or a variable stepper with its options.
        step_size: Δt [s] of Moreau's stepper, None for a variable one.
        solver: the solver with its options.
        tolerance: judged residual that each one-step inclusion shall reach.
        max_iterations: of the solver, in one of them.
        members: what is varied to see the spread: seeds of the scene, or factors on the step size or tolerance.
    """

    part: str
    series: str
    stepper: str
    step_size: float | None
    solver: str
    tolerance: float
    max_iterations: int
    members: tuple[float, ...]

    @property
    def is_fixed(self) -> bool:
        """Whether the step size is fixed."""
        return self.stepper == FIXED

    @property
    def setting(self) -> str:
        """The stepper with its step size or options, in words."""
        return self.stepper if self.step_size is None else f"Δt {self.step_size:.3g} s"


@dataclass(frozen=True)
class StudyPlan:
    """A study as it will be carried out.

    Attributes:
        scene: name of the scene.
        options: options of the scene that differ from its defaults.
        duration: simulated time [s] of every case.
        cases: what is measured, one after the other.
    """

    scene: str
    options: Mapping[str, Any]
    duration: float
    cases: tuple[Case, ...]

    @property
    def n_runs(self) -> int:
        """Number of simulations."""
        return sum(len(case.members) for case in self.cases)

    def document(self) -> dict[str, Any]:
        """Return the plan as plain values, from which ``plan_from`` makes it again."""
        return {
            "scene": self.scene,
            "options": dict(self.options),
            "duration": self.duration,
            "cases": [asdict(case) for case in self.cases],
        }


def plan_from(document: Mapping[str, Any]) -> StudyPlan:
    """Return the plan that was written as ``document``.

    Raises:
        ProxbenchError: for a scene, solver, stepper or number that cannot be.
        KeyError, TypeError, ValueError: if it is no such document.
    """
    cases = tuple(_case_from(entry) for entry in document["cases"])
    options = dict(document["options"])
    plan = StudyPlan(str(document["scene"]), options, float(document["duration"]), cases)
    check_plan(plan)
    return plan


def check_plan(plan: StudyPlan) -> None:
    """Build every simulation once, so that what is wrong is found before the first minute of measuring.

    Raises:
        ProxbenchError: for a scene, solver, stepper or number that cannot be.
    """
    for case in {replace(case, part="", series="", members=()) for case in plan.cases}:
        case_plan(plan, case, plan.options)


def case_plan(
    plan: StudyPlan, case: Case, options: Mapping[str, Any], step_size: float | None = None, factor: float = 1.0
) -> SimulationPlan:
    """Return the simulation of a case.

    Args:
        plan: the study.
        case: the case.
        options: of the scene.
        step_size: of a fixed step [s], the case's own if None.
        factor: on the tolerance of a variable stepper.
    """
    stepper: Any = make_stepper(case.stepper)
    if case.is_fixed:
        stepper = replace(stepper, step=step_size or case.step_size)
    else:
        stepper = replace(stepper, tolerance=stepper.tolerance * factor)
    return make_simulation_plan(
        plan.scene,
        options,
        stepper=stepper,
        duration=plan.duration,
        solver=case.solver,
        tolerance=case.tolerance,
        max_iterations=case.max_iterations,
        states=1,  # what it comes to is noted while it runs
    )


def _case_from(entry: Mapping[str, Any]) -> Case:
    if set(entry) != {field.name for field in fields(Case)}:
        raise ValueError("this is no case")
    words = ("part", "series", "stepper", "solver")
    members = tuple(entry["members"])
    size, tolerance = entry["step_size"], entry["tolerance"]
    numbers = [*members, tolerance, *([] if size is None else [size])]
    if not (all(isinstance(entry[word], str) for word in words) and all(map(_is_number, numbers)) and members):
        raise ValueError("this is no case")
    if (size is not None) != (entry["stepper"] == FIXED) or type(entry["max_iterations"]) is not int:
        raise ValueError("this is no case")
    return Case(**{**entry, "members": members})


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
