"""Rapier: a scene in a world of single precision, on one thread."""

from importlib import import_module
from typing import Any

import numpy as np

from .description import BodyStates, Description


class RapierEngine:
    """A scene in Rapier."""

    def __init__(self, description: Description, time_step: float, options: dict[str, Any]) -> None:
        rapier = import_module("rapier3d")
        self.world = rapier.PhysicsWorld(gravity=description.gravity)
        self.world.set_num_threads(1)
        parameters = self.world.integration_parameters
        parameters.dt = time_step
        parameters.length_unit = description.length
        if "iterations" in options:
            parameters.num_solver_iterations = options["iterations"]
        if "friction_model" in options:
            parameters.friction_model = getattr(rapier.FrictionModel, options["friction_model"])

        def add(collider: Any, parent: Any = None) -> None:
            self.world.add_collider(collider.friction(description.friction).restitution(0.0), parent)

        if description.has_floor:
            add(rapier.Collider.halfspace((0.0, 0.0, 1.0)))
        for panel in description.panels:
            x, y, z, w = map(float, panel.quaternion)
            pose = rapier.Isometry3(tuple(map(float, panel.centre)), rapier.Rotation3(w, x, y, z))
            add(rapier.Collider.cuboid(*panel.half).position(pose))
        self.bodies = []
        for body in description.bodies:
            builder = rapier.RigidBody.dynamic().translation(body.position).linvel(body.velocity).can_sleep(False)
            handle = self.world.add_body(builder.build())
            shape = rapier.Collider.cuboid(*3 * [body.half]) if body.is_cube else rapier.Collider.ball(body.half)
            add(shape.mass(body.mass), handle)
            self.bodies.append(self.world.rigid_bodies.get(handle))

    def step(self) -> None:
        """Advance by one step."""
        self.world.step()

    def states(self) -> BodyStates:
        """Return the states of all bodies."""
        return BodyStates(
            *(
                np.array([getattr(body, name).to_tuple() for body in self.bodies])
                for name in ("translation", "linvel", "angvel")
            )
        )

    def remember(self) -> None:
        """Store nothing: Rapier does not report the directions of friction impulses."""

    def solved_problem(self) -> None:
        """Return None; see ``remember``."""


def build(description: Description, time_step: float, options: dict[str, Any]) -> RapierEngine:
    """Build a scene; options: ``iterations``, ``friction_model``."""
    return RapierEngine(description, time_step, options)
