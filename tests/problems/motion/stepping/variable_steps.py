"""Variable steps of any system, and a system without switches."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from proxbench.problems.motion.bodies.system import MechanicalSystem
from proxbench.problems.motion.scenes.scene import bare_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.extrapolated import Extrapolated
from proxbench.problems.motion.stepping.step import AcceptedStep
from proxbench.problems.motion.stepping.variable_stepper import VariableStepper
from proxbench.solvers import Stop, create


def steps_of(
    system: Any,
    start: State,
    until: float,
    kind: type[VariableStepper] = Extrapolated,
    solver: Any = None,
    **options: Any,
) -> Iterator[AcceptedStep]:
    still = State(0.0, np.ones(1), np.zeros(1))
    scene = replace(bare_scene("own", {}, oscillator(True), still), system=system, start=start)
    chosen: Any = {"tolerance": 1e-6, "min_step": 1e-8, "max_step": 2e-2, **options}
    return kind(**chosen).steps(scene, solver or create("SORprox"), Stop(1e-13, 100_000), start, until)


def oscillator(reversible: bool) -> MechanicalSystem:
    """A unit mass on a unit spring, damped unless it is reversible, and a contact that is never reached."""
    mass = np.eye(1)
    return MechanicalSystem(
        mass=lambda position: mass,
        force=lambda position, velocity: -position if reversible else -position - 0.5 * velocity,
        gap=lambda position: position + 10.0,
        directions=lambda position: np.ones((1, 1)),
        friction=[0.0],
        restitution_normal=[0.0],
        restitution_tangential=[0.0],
        rows_per_contact=1,
        is_reversible=reversible,
    )
