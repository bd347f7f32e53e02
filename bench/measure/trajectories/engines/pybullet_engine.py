"""PyBullet: a scene in a client without a window."""

from importlib import import_module
from typing import Any

import numpy as np

from .description import BodyStates, Description
from .solved_problem import SolvedProblem, solved_problem


class PyBulletEngine:
    """A scene in PyBullet.

    Options: ``iterations``, ``maximal_coordinates`` (rigid bodies instead of multibodies), and ``island_size``, the
    number of constraints up to which islands are solved together.
    """

    def __init__(self, description: Description, time_step: float, options: dict[str, Any]) -> None:
        client = import_module("pybullet_utils.bullet_client")
        library: Any = client.BulletClient(connection_mode=import_module("pybullet").DIRECT)
        self.library, self.description, self.time_step = library, description, time_step
        self._advance = library.stepSimulation  # bound once, because each access to it creates a wrapper
        self._body_options = {"useMaximalCoordinates": bool(options.get("maximal_coordinates"))}
        library.setGravity(*description.gravity)
        library.setPhysicsEngineParameter(
            fixedTimeStep=time_step, numSolverIterations=options["iterations"], solverResidualThreshold=0.0
        )
        if "island_size" in options:
            library.setPhysicsEngineParameter(minimumSolverIslandSize=options["island_size"])
        static = [self._add_panel(panel) for panel in description.panels]
        if description.has_floor:
            static.append(
                library.createMultiBody(0, library.createCollisionShape(library.GEOM_PLANE), **self._body_options)
            )
        self.bodies = [self._add_body(body) for body in description.bodies]
        for body in (*static, *self.bodies):
            library.changeDynamics(
                body,
                -1,
                lateralFriction=float(np.sqrt(description.friction)),  # Bullet multiplies two coefficients
                restitution=0.0,
                linearDamping=0.0,
                angularDamping=0.0,
                rollingFriction=0.0,
                spinningFriction=0.0,
                contactProcessingThreshold=0.1 * description.length,
            )

    def step(self) -> None:
        """Advance by one step."""
        self._advance()

    def states(self) -> BodyStates:
        """Return the states of all bodies."""
        positions = np.array([self.library.getBasePositionAndOrientation(body)[0] for body in self.bodies])
        velocities = np.array([self.library.getBaseVelocity(body) for body in self.bodies])
        return BodyStates(positions, velocities[:, 0], velocities[:, 1])

    def store_state(self) -> None:
        """Store the state before a step."""
        self._before = self.states()

    def solved_problem(self) -> SolvedProblem | None:
        """Return the problem of the last step; None without contacts."""
        index = {body: k for k, body in enumerate(self.bodies)}
        points = [c for c in self.library.getContactPoints() if c[1] in index or c[2] in index]
        contacts = {
            "body_1": [index.get(c[2], -1) for c in points],
            "body_2": [index.get(c[1], -1) for c in points],
            "point": [c[5] for c in points],
            "point_1": [c[6] for c in points],
            "normal": [c[7] for c in points],
            "distance": [c[8] for c in points],
            "tangent": [c[11] for c in points],
        }
        impulses = self.time_step * np.array([[c[9], c[10], c[12]] for c in points])
        return solved_problem(self.description, self._before, self.time_step, contacts, impulses)

    def _add_panel(self, panel: Any) -> int:
        shape = self.library.createCollisionShape(self.library.GEOM_BOX, halfExtents=list(panel.half_sizes))
        pose = {"basePosition": list(panel.centre), "baseOrientation": list(panel.quaternion), **self._body_options}
        body: int = self.library.createMultiBody(0, shape, **pose)
        return body

    def _add_body(self, body: Any) -> int:
        library = self.library
        size = {"halfExtents": 3 * [body.half_size]} if body.is_cube else {"radius": body.half_size}
        shape = library.createCollisionShape(library.GEOM_BOX if body.is_cube else library.GEOM_SPHERE, **size)
        number: int = library.createMultiBody(body.mass, shape, basePosition=body.position, **self._body_options)
        library.resetBaseVelocity(number, body.velocity)
        return number


build = PyBulletEngine
"""Builds a scene."""
