"""Descriptions of scenes that every engine builds: balls and cubes with one friction coefficient, and static boxes.

Bodies are homogeneous. They do not rebound, their motion is not damped, and friction resists neither rolling nor
spinning.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .....problems.arrays import FloatArray
from .....problems.motion.scenes.funnel import STANDARD_GRAVITY

ERROR_MARGIN = 1.1
"""Settings of one engine whose errors differ by less than this factor count as equally accurate."""


@dataclass(frozen=True)
class Body:
    """A homogeneous ball or cube.

    Attributes:
        is_cube: whether it is a cube, with axes parallel to those of the world at the start.
        half_size: radius, or half the edge length [m].
        mass: mass [kg].
        position: position of its centre at the start [m].
        velocity: velocity of its centre at the start [m/s]; its spin is zero.
    """

    is_cube: bool
    half_size: float
    mass: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def inertia(self) -> float:
        """Moment of inertia about every axis [kg m²]."""
        return self.mass * self.half_size**2 * (2.0 / 3.0 if self.is_cube else 2.0 / 5.0)


@dataclass(frozen=True)
class Panel:
    """A static box.

    Attributes:
        centre: centre [m], shape (3,).
        half_sizes: half the edge lengths [m].
        rotation: axes of the box as columns, shape (3, 3).
    """

    centre: FloatArray
    half_sizes: tuple[float, float, float]
    rotation: FloatArray

    @property
    def quaternion(self) -> FloatArray:
        """Unit quaternion x, y, z, w of the axes."""
        from scipy.spatial.transform import Rotation

        quaternion: FloatArray = Rotation.from_matrix(self.rotation).as_quat()
        return quaternion


@dataclass(frozen=True)
class Motion:
    """The motion of a scene in an engine, frame by frame; the first frame is the start.

    Attributes:
        times: times [s], shape (n_frames,).
        positions: positions of centres, shape (n_frames, n_bodies, 3) [m].
        velocities: velocities of centres, shape (n_frames, n_bodies, 3) [m/s].
        spins: angular velocities, shape (n_frames, n_bodies, 3) [rad/s].
    """

    times: FloatArray
    positions: FloatArray
    velocities: FloatArray
    spins: FloatArray


@dataclass(frozen=True)
class Description:
    """A scene for engines.

    Attributes:
        name: name of the scene.
        bodies: the moving bodies.
        panels: static boxes.
        has_floor: whether a static floor fills z < 0.
        friction: coefficient μ of every contact.
        gravity: acceleration [m/s²]; an incline is a floor with tilted gravity.
        duration: simulated time [s].
        step: the step [s] that the factors of settings multiply.
        frame: time between frames [s], a multiple of every step.
        length: size of a body [m].
        errors: names of the errors with their units; the first one decides which setting is best.
        negligible: value of the first error below which settings count as equally accurate.
        measure: computes the errors of a motion, in the order of ``errors``.
        own_scene: name of the scene of Proxbench with the same bodies and start, which tilts the floor instead of
            gravity.
        own_options: options of that scene.
    """

    name: str
    bodies: tuple[Body, ...]
    friction: float
    duration: float
    step: float
    frame: float
    length: float
    errors: tuple[str, ...]
    negligible: float
    measure: Callable[["Description", Motion], tuple[float, ...]]
    own_scene: str
    own_options: dict[str, Any]
    panels: tuple[Panel, ...] = ()
    has_floor: bool = True
    gravity: tuple[float, float, float] = (0.0, 0.0, -STANDARD_GRAVITY)

    def start(self) -> "BodyStates":
        """Return the states of the bodies at the start."""
        positions, velocities = (np.array([getattr(b, name) for b in self.bodies]) for name in ("position", "velocity"))
        return BodyStates(positions, velocities, np.zeros_like(positions))

    def energy_gained(self, motion: Motion) -> float:
        """Return the energy gained from frame to frame, divided by Σ m g L; it is 0 for rigid bodies with friction.

        The energy is T + V, with T = Σ (m v² + I ω²) / 2 and V = −Σ m g·x; L is ``length``. Contacts only dissipate.
        """
        mass, inertia = (np.array([getattr(body, name) for body in self.bodies]) for name in ("mass", "inertia"))
        gravity = np.array(self.gravity)
        kinetic = 0.5 * ((motion.velocities**2).sum(axis=2) @ mass + (motion.spins**2).sum(axis=2) @ inertia)
        energy = kinetic - (motion.positions @ gravity) @ mass
        unit = mass.sum() * np.linalg.norm(gravity) * self.length
        return float(np.maximum(np.diff(energy), 0.0).sum() / unit)


@dataclass(frozen=True)
class BodyStates:
    """Positions, velocities and spins of the bodies in one frame, as in ``Motion``."""

    positions: FloatArray
    velocities: FloatArray
    spins: FloatArray


@dataclass(frozen=True)
class Setting:
    """A setting of an engine.

    Attributes:
        name: name in tables.
        step_factor: the step relative to that of the scene.
        options: options of the engine.
    """

    name: str
    step_factor: float
    options: dict[str, Any]
