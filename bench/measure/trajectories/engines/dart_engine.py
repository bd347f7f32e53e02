"""DART: a scene in a world that does not deactivate bodies at rest."""

from importlib import import_module
from typing import Any

import numpy as np

from .....problems.contact.matrices.contact_frame import contact_frames
from .description import BodyStates, Description
from .solved_problem import SolvedProblem, solved_problem

MAX_CONTACTS = 100_000
"""Largest number of contacts that DART keeps in a step; the default is 1000."""


class DartEngine:
    """A scene in DART.

    Options: ``detector``, ``sweeps`` (iteration limit of the matrix-free solver), and ``nsgs`` (whether NSGS is used).
    """

    def __init__(self, description: Description, time_step: float, options: dict[str, Any]) -> None:
        library = import_module("dartpy")
        self.library, self.description, self.time_step = library, description, time_step
        self.world = library.simulation.World()
        self.world.setTimeStep(time_step)
        self.world.setGravity(np.array(description.gravity))
        deactivation = library.simulation.DeactivationOptions()
        deactivation.mEnabled = False
        self.world.setDeactivationOptions(deactivation)
        self.world.setCollisionDetector(getattr(library.simulation.CollisionDetectorType, options["detector"]))
        solver = self.world.getConstraintSolver()
        solver.getCollisionOption().maxNumContacts = MAX_CONTACTS
        if "sweeps" in options:
            sweep_options = library.constraint.MatrixFreeContactSolverOptions()
            sweep_options.mEnabled, sweep_options.mMinRows = True, 0
            sweep_options.mMaxIterations = options["sweeps"]
            solver.setMatrixFreeContactSolverOptions(sweep_options)
        if options.get("nsgs"):
            solver.setBoxedLcpSolver(library.constraint.NsgsFrictionSolver())
        self._add_static_bodies()
        self.bodies = [self._add_body(body) for body in description.bodies]

    def step(self) -> None:
        """Advance by one step."""
        self.world.step()

    def states(self) -> BodyStates:
        """Return the states of all bodies."""
        positions = np.array([body.getWorldTransform().translation() for body in self.bodies])
        velocities = np.array([body.getLinearVelocity() for body in self.bodies])
        return BodyStates(positions, velocities, np.array([body.getAngularVelocity() for body in self.bodies]))

    def store_state(self) -> None:
        """Store the state before a step."""
        self._before = self.states()

    def solved_problem(self) -> SolvedProblem | None:
        """Return the problem of the last step; None without contacts.

        DART's normal and force point to the first body of a contact, which is therefore ``body_2``.
        """
        contacts = self.world.getLastCollisionResult().getContacts()
        if not contacts:
            return None
        index = {body.getName(): k for k, body in enumerate(self.bodies)}
        normals = np.array([contact.normal for contact in contacts])
        forces = np.array([contact.force for contact in contacts])
        axes = contact_frames(normals)
        arrays = {
            "body_1": [index.get(_body_name(contact.collisionObject2), -1) for contact in contacts],
            "body_2": [index.get(_body_name(contact.collisionObject1), -1) for contact in contacts],
            "point": [contact.point for contact in contacts],
            "normal": normals,
            "tangent": axes[:, 1],
            "distance": [-contact.penetrationDepth for contact in contacts],
        }
        impulses = self.time_step * np.einsum("kij,kj->ki", axes, forces)
        return solved_problem(self.description, self._before, self.time_step, arrays, impulses)

    def _add_static_bodies(self) -> None:
        dynamics = self.library.dynamics
        static = dynamics.Skeleton("static")
        _, body = static.createWeldJointAndBodyNodePair()
        if self.description.has_floor:
            self._add_shape(body, dynamics.PlaneShape(np.array([0.0, 0.0, 1.0]), 0.0))
        for panel in self.description.panels:
            node = self._add_shape(body, dynamics.BoxShape(2.0 * np.array(panel.half_sizes)))
            node.setRelativeTranslation(panel.centre)
            node.setRelativeRotation(panel.rotation)
        self.world.addSkeleton(static)

    def _add_body(self, body: Any) -> Any:
        dynamics = self.library.dynamics
        skeleton = dynamics.Skeleton(f"body {self.world.getNumSkeletons()}")
        joint, body_node = skeleton.createFreeJointAndBodyNodePair()
        body_node.setName(skeleton.getName())
        body_node.setInertia(dynamics.Inertia(body.mass, np.zeros(3), body.inertia * np.eye(3)))
        size = body.half_size
        shape = dynamics.BoxShape(np.full(3, 2.0 * size)) if body.is_cube else dynamics.SphereShape(size)
        self._add_shape(body_node, shape)
        pose = self.library.math.Isometry3()
        pose.set_translation(np.array(body.position))
        joint.setTransform(pose)
        joint.setLinearVelocity(np.array(body.velocity))
        self.world.addSkeleton(skeleton)
        return body_node

    def _add_shape(self, body: Any, shape: Any) -> Any:
        node = body.createShapeNode(shape)
        node.createCollisionAspect()
        node.createDynamicsAspect()
        node.getDynamicsAspect().setFrictionCoeff(self.description.friction)
        node.getDynamicsAspect().setRestitutionCoeff(0.0)
        return node


def _body_name(collision_object: Any) -> str:
    """Return the name of the body to which a collision object belongs."""
    name: str = collision_object.getShapeFrame().getBodyNodePtr().getName()
    return name


build = DartEngine
"""Builds a scene."""
