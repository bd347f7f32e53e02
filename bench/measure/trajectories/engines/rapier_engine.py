"""Scenes in Rapier, in single precision and on one thread."""

from importlib import import_module
from typing import Any

import numpy as np

from .....problems.arrays import FloatArray
from .description import BodyStates, Description
from .solved_problem import SolvedProblem, solved_problem

VELOCITY_ERROR = 1e-4
"""Largest error of the velocity changes computed from impulses, relative to the largest change by contacts."""


class RapierEngine:
    """A scene in Rapier.

    Args:
        description: the scene.
        time_step: length of a step [s].
        options: ``iterations`` and ``friction_model``; Rapier's defaults for those that are missing.

    Attributes:
        world: Rapier's world.
        bodies: Rapier's moving bodies, in the order of the description.
        reports_friction: whether Rapier reports friction impulses.
    """

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

        self.description, self.time_step = description, time_step
        self.reports_friction = options.get("friction_model") == "COULOMB"
        self._colliders: list[Any] = []

        def add(collider: Any, parent: Any = None) -> None:
            collider = collider.friction(description.friction).restitution(0.0)
            self._colliders.append(self.world.add_collider(collider, parent))

        if description.has_floor:
            add(rapier.Collider.halfspace((0.0, 0.0, 1.0)))
        for panel in description.panels:
            x, y, z, w = map(float, panel.quaternion)
            pose = rapier.Isometry3(tuple(map(float, panel.centre)), rapier.Rotation3(w, x, y, z))
            add(rapier.Collider.cuboid(*panel.half_sizes).position(pose))
        self.bodies: list[Any] = []
        self._handles: list[Any] = []
        for body in description.bodies:
            builder = rapier.RigidBody.dynamic().translation(body.position).linvel(body.velocity).can_sleep(False)
            handle = self.world.add_body(builder.build())
            self._handles.append(handle)
            size = body.half_size
            shape = rapier.Collider.cuboid(size, size, size) if body.is_cube else rapier.Collider.ball(size)
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

    def store_state(self) -> None:
        """Store the state before a step, without a call that changes the world."""
        if self.reports_friction:
            self._before = self.states()
            colliders, bodies = self.world.colliders, self.world.rigid_bodies
            self._poses: dict[Any, Any] = {}
            for handle in self._colliders:
                collider = colliders.get(handle)
                # Rapier moves a collider to its body only in the next step
                carrier = collider if collider.parent is None else bodies.get(collider.parent)
                self._poses[handle] = carrier.position

    def solved_problem(self) -> SolvedProblem | None:
        """Return the problem of the last step, or None.

        None means that there are no contacts, or that the reported impulses do not reproduce the velocities. Rapier
        does not report friction impulses of its default friction model. In rotating stacks, impulses act at points
        other than the reported ones.
        """
        if not self.reports_friction:
            return None
        number = {body: k for k, body in enumerate(self._handles)}
        names = "body_1", "body_2", "point", "normal", "distance", "tangent"
        columns: dict[str, list[Any]] = {name: [] for name in names}
        impulses = []
        for pair in self.world.narrow_phase.contact_pairs():
            poses = self._poses[pair.collider1], self._poses[pair.collider2]
            for manifold in pair.manifolds:
                data = manifold.data
                body_1, body_2 = (number.get(body, -1) for body in (data.rigid_body1, data.rigid_body2))
                normal, tangent = np.array([*data.normal]), _first_tangent(*data.normal)
                for point in manifold.points:
                    local_points = point.local_p1, point.local_p2
                    ends = [pose.transform_point(local) for pose, local in zip(poses, local_points, strict=True)]
                    middle = np.mean([[*end] for end in ends], axis=0)  # impulses act halfway between both points
                    values = (body_1, body_2, middle, normal, point.dist, tangent)
                    for name, value in zip(names, values, strict=True):
                        columns[name].append(value)
                    first, second = point.tangent_impulse
                    impulses.append((point.impulse, first, -second))
        solved = solved_problem(self.description, self._before, self.time_step, columns, np.array(impulses))
        return solved if solved is not None and _reproduces_velocities(solved, self.states()) else None


def _reproduces_velocities(solved: SolvedProblem, after: BodyStates) -> bool:
    """Return whether M⁻¹ W Λ equals the final minus the free velocities, up to ``VELOCITY_ERROR`` of the difference."""
    factors = solved.problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    caused = factors.inverse_mass.times(factors.force_directions @ solved.impulses)
    change = np.hstack([after.velocities, after.spins]).ravel() - factors.free_motion
    return bool(np.abs(caused - change).max() <= VELOCITY_ERROR * np.abs(change).max())


def _first_tangent(x: float, y: float, z: float) -> FloatArray:
    """Return the direction of Rapier's first friction impulse on body 2; it depends on the normal alone.

    Rapier's basis is that of −n: with s the sign of −n_z and a = −1/(s − n_z), its first vector is
    (n_x n_y a, s + n_y² a, n_y) on body 1.
    """
    sign = np.copysign(1.0, -z)
    scale = -1.0 / (sign - z)
    return np.array([-x * y * scale, -sign - y * y * scale, -y])


build = RapierEngine
"""Builds a scene."""
