"""Proxbench itself: Moreau's midpoint rule on Proxbench's own scene with the same bodies and start."""

from typing import Any

import numpy as np

from .....problems.arrays import FloatArray
from .....problems.motion.bodies.rigid.orientation import about, rotation_matrices
from .....problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from ....simulation.plan import make_simulation_plan
from .description import BodyStates, Description
from .solved_problem import SolvedProblem

WARM_UP_SHARE = 0.6
"""Fraction of the motion that is simulated before a run, to load all kernels."""


class OwnEngine:
    """A scene in Proxbench."""

    def __init__(self, description: Description, time_step: float, tolerance: float) -> None:
        duration = description.duration
        plan = make_simulation_plan(
            description.own_scene,
            description.own_options,
            stepper=f"Moreau(step={time_step!r})",
            duration=duration,
            tolerance=tolerance,
        )
        self.system, self.state = plan.scene.system, plan.scene.start
        self.axes = axes_of(description)
        motion = (plan.scene, plan.step_solver, plan.stop, plan.scene.start, duration)
        self._steps = plan.stepper.steps(*motion)

    def step(self) -> None:
        """Advance by one step."""
        self._last = next(self._steps)
        self.state = self._last.end

    def states(self) -> BodyStates:
        """Return the states of all bodies, in the axes of the description."""
        velocities = self.state.velocity.reshape(-1, 6)
        spins = velocities[:, 3:]
        if isinstance(self.system, RigidBodies):
            poses = self.system.poses(self.state.position)
            positions, spins = poses[:, :3], np.einsum("bij,bj->bi", rotation_matrices(poses[:, 3:]), spins)
        else:
            positions = self.state.position.reshape(-1, 3)
        return BodyStates(positions @ self.axes, velocities[:, :3] @ self.axes, spins @ self.axes)

    def store_state(self) -> None:
        """Store nothing: each step keeps its problem."""

    def solved_problem(self) -> SolvedProblem | None:
        """Return the problem of the last step; None without contacts."""
        solved = self._last.substeps[0][0]
        return None if solved.problem is None else SolvedProblem(solved.problem, solved.impulses)


def axes_of(description: Description) -> FloatArray:
    """Return the axes of a description as columns; scenes of Proxbench tilt the floor instead of gravity."""
    slope = float(np.arctan2(description.gravity[0], -description.gravity[2]))
    axes: FloatArray = rotation_matrices(about((0.0, 1.0, 0.0), slope)[None])[0]
    return axes


def build(description: Description, time_step: float, options: dict[str, Any]) -> OwnEngine:
    """Build a scene; option: ``tolerance``."""
    warm_up, engine = (OwnEngine(description, time_step, options["tolerance"]) for _ in range(2))
    for _ in range(round(WARM_UP_SHARE * description.duration / time_step)):
        warm_up.step()
    return engine
