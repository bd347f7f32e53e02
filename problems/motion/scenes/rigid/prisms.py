"""Scenes of prisms normal to the plane (x, z), each defined by its initial cross-section."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ....arrays import FloatArray
from ...bodies.rigid.polyhedron import Polyhedron, convex_polyhedron
from ...bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from ...bodies.rigid.shapes import HalfSpace
from ...state import State
from ..effects import Friction, Gravity
from ..scene import Observable
from .effects import rigid_bodies


class PrismScene(ABC):
    """Homogeneous prisms at rest on the ground z = 0; subclasses are frozen dataclasses, whose fields are options.

    Touching bodies overlap slightly at the start. If the overlap were less than the error of a step, contacts would be
    lost and found again, and the bodies would fall by up to g Δt² each time.
    """

    friction: float
    width: float
    density: float
    gravity: float

    @abstractmethod
    def sections(self) -> Sequence[FloatArray]:
        """Return the corners (x, z) of each prism [m], shape (n_corners, 2) each."""

    @cached_property
    def _bodies(self) -> list[tuple[Polyhedron, FloatArray]]:
        return [convex_polyhedron(prism(section, self.width)) for section in self.sections()]

    def system(self) -> RigidBodies:
        """Return the prisms on the ground."""
        shapes = [shape for shape, _ in self._bodies]
        masses = self.density * np.array([shape.volume for shape in shapes])
        effects = (Gravity(self.gravity), Friction(self.friction))
        return rigid_bodies(shapes, masses, [FixedBody(HalfSpace())], effects)

    def start(self) -> State:
        """Return the prisms at rest."""
        position = np.concatenate([pose for _, pose in self._bodies])
        return State(0.0, position, np.zeros(6 * len(self._bodies)))

    @property
    def observables(self) -> Sequence[Observable]:
        """The largest displacement of a centre from the start."""
        return (Observable("moved", self.largest_displacement, label="largest displacement [m]", head="moved"),)

    def largest_displacement(self, state: State) -> float:
        """Return the largest displacement of a centre from the start [m]."""
        change = (state.position - self.start().position).reshape(-1, 7)[:, :3]
        return float(np.linalg.norm(change, axis=1).max())


def prism(section: FloatArray, width: float) -> FloatArray:
    """Return the corners [m], shape (2 n, 3), of a prism with the cross-section ``section`` in (x, z), shape (n, 2)."""
    sides = [np.full(len(section), side * width) for side in (-0.5, 0.5)]
    return np.concatenate([np.column_stack([section[:, 0], side, section[:, 1]]) for side in sides])
