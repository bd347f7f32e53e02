"""Proxbench itself: Moreau's midpoint rule on its own scene of the same balls and start."""

from typing import Any

import numpy as np

from ....simulation.plan import make_simulation_plan
from .description import BodyStates, Description
from .solved_problem import SolvedProblem

WARM_UP = 0.6
"""Share of the motion that is simulated before a run, so that all kernels are loaded."""


class OwnEngine:
    """A scene of balls in Proxbench."""

    def __init__(self, scene: str, time_step: float, duration: float, tolerance: float) -> None:
        plan = make_simulation_plan(
            scene, stepper=f"Moreau(step={time_step!r})", duration=duration, tolerance=tolerance
        )
        self.system, self.state = plan.scene.system, plan.scene.start
        motion = (plan.scene, plan.step_solver, plan.stop, plan.scene.start, duration)
        self._steps = plan.stepper.steps(*motion)

    def step(self) -> None:
        """Advance by one step."""
        self._last = next(self._steps)
        self.state = self._last.end

    def states(self) -> BodyStates:
        """Return the states of all balls."""
        positions = self.state.position.reshape(-1, 3)
        velocities = self.state.velocity.reshape(-1, 6)
        return BodyStates(np.array(positions), velocities[:, :3].copy(), velocities[:, 3:].copy())

    def remember(self) -> None:
        """Store nothing: each step has its problem."""

    def solved_problem(self) -> SolvedProblem | None:
        """Return the problem of the last step."""
        solved = self._last.substeps[0][0]
        return None if solved.problem is None else SolvedProblem(solved.problem, solved.impulses)


def build(description: Description, time_step: float, options: dict[str, Any]) -> OwnEngine:
    """Build a scene; option: ``tolerance``."""
    warm_up, engine = (
        OwnEngine(str(description.own_scene), time_step, description.duration, options["tolerance"]) for _ in range(2)
    )
    for _ in range(round(WARM_UP * description.duration / time_step)):
        warm_up.step()
    return engine
