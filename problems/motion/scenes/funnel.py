"""Balls falling into a funnel (the example of Studer & Glocker 2005, section 5).

The paper gives no geometry; this scene has balls of radius 1 cm and 2500 kg/m³, a cone of half-angle 45° and 14.5 cm
height over an outlet of 4.5 ball radii, a vertical wall above, and a circular rim at the outlet. The balls start on a
jittered lattice of pitch 2.3 radii and drop at 1 m/s.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.balls import BallSystem
from ..bodies.surfaces import Plane, Rim, Segment, Surface
from ..state import State
from .effects import Conservative, Effect, Friction, Gravity, Planar, Restitution, ball_system

RADIUS = 0.01
DENSITY = 2500.0
MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
CONE_HEIGHT = 0.145
PITCH = 2.3
JITTER = 0.05
DROP_SPEED = 1.0
TIME_STEP = 5e-4
WALL_TOP = 1e3
STANDARD_GRAVITY = 9.81

STANDARD_EFFECTS: tuple[Effect, ...] = (Gravity(9.81), Friction(0.3), Restitution(0.3, 0.0))
"""The effects of the paper's example."""


@dataclass(frozen=True)
class Funnel:
    """A funnel scene.

    Attributes:
        n_balls: number of balls.
        effects: what acts; with ``Planar`` among them balls are discs between two slopes.
        outlet_radius: radius of the outlet in ball radii; 0 closes it with a plate.
        seed: of the jitter.

    Raises:
        ProblemError: if a number is out of range.
    """

    n_balls: int = 1000
    effects: Sequence[Effect] = STANDARD_EFFECTS
    outlet_radius: float = 4.5
    seed: int = 0

    def __post_init__(self) -> None:
        if self.n_balls < 1:
            raise ProblemError(f"n_balls must be at least 1, got {self.n_balls}.")
        if not 0.0 <= self.outlet_radius < np.inf:
            raise ProblemError(f"outlet_radius must not be negative, got {self.outlet_radius}.")

    @property
    def is_planar(self) -> bool:
        """Whether the bodies are discs in a plane."""
        return any(isinstance(effect, Planar) for effect in self.effects)

    @property
    def wall_radius(self) -> float:
        """Radius of the vertical wall [m]."""
        return max(self.outlet_radius, 4.5) * RADIUS + CONE_HEIGHT

    def system(self) -> BallSystem:
        """Return balls and walls with the effects."""
        return ball_system(np.full(self.n_balls, RADIUS), self._masses, self._surfaces(), self.effects)

    def start(self) -> State:
        """Return the balls on their lattice above the cone, dropping."""
        system = self.system()
        velocities = np.zeros((self.n_balls, system.dimension))
        velocities[:, -1] = -DROP_SPEED
        return State(0.0, self._lattice(system.dimension).ravel(), system.at_rest(velocities))

    def balls_through(self, position: FloatArray) -> int:
        """Return how many balls of q, shape (n_balls · d,), have their centre below the outlet."""
        return int(np.count_nonzero(position[self._dimension - 1 :: self._dimension] < 0.0))

    def agitation(self, position: FloatArray, velocity: FloatArray) -> float:
        """Return the mean kinetic energy of the balls above the outlet over m g r; 0 if all are through.

        At 1, they could rise by a radius; a pile whose value is 1e-4 moves at less than 5 mm/s.
        """
        above = position[self._dimension - 1 :: self._dimension] >= 0.0
        if not above.any():
            return 0.0
        energies = self._still_system.kinetic_energies(velocity)
        return float(energies[above].mean()) / (MASS * STANDARD_GRAVITY * RADIUS)

    def potential_energy(self, position: FloatArray) -> float:
        """Return V [J] of the effects at q, shape (n_balls · d,); weight counts from the outlet."""
        centres = position.reshape(self.n_balls, self._dimension)
        return sum(effect.potential_energy(centres, self._masses) for effect in self._conservative)

    @cached_property
    def _still_system(self) -> BallSystem:
        return self.system()

    @cached_property
    def _conservative(self) -> list[Conservative]:
        return [effect for effect in self.effects if isinstance(effect, Conservative)]

    @cached_property
    def _masses(self) -> FloatArray:
        return np.full(self.n_balls, MASS)

    @cached_property
    def _dimension(self) -> int:
        return 2 if self.is_planar else 3

    def _surfaces(self) -> list[Surface]:
        outlet = self.outlet_radius * RADIUS if self.outlet_radius else 4.5 * RADIUS
        top, along = outlet + CONE_HEIGHT, (np.sqrt(0.5), np.sqrt(0.5))
        surfaces: list[Surface] = []
        for side in (-1, 1) if self.is_planar else (0,):
            surfaces.append(Segment((outlet, 0.0), (top, CONE_HEIGHT), side))
            surfaces.append(Segment((top, CONE_HEIGHT), (top, WALL_TOP), side))
            surfaces.append(Rim((outlet, 0.0), along, side))
        if self.outlet_radius == 0.0:
            up = (*[0.0] * (self._dimension - 1), 1.0)
            surfaces.append(Plane((0.0,) * self._dimension, up))
        return surfaces

    def _lattice(self, dimension: int) -> FloatArray:
        """Return the centres [m], layer by layer from below, inside the wall and above the cone, shape (n, d)."""
        pitch = PITCH * RADIUS
        reach = self.wall_radius - (1.0 + JITTER) * RADIUS
        half = int(reach / pitch)
        ticks = pitch * np.arange(-half, half + 1)
        grid = np.stack(np.meshgrid(*[ticks] * (dimension - 1), indexing="ij"), axis=-1).reshape(-1, dimension - 1)
        grid = grid[np.sqrt((grid**2).sum(axis=1)) <= reach]
        nearest = np.argsort(np.round((grid**2).sum(axis=1), 12), kind="stable")
        per_layer = min(len(grid), max(1, round(self.n_balls ** (1.0 - 1.0 / dimension))))
        grid = grid[np.sort(nearest[:per_layer])]
        index = np.arange(self.n_balls)
        height = CONE_HEIGHT + pitch * (1 + index // len(grid))
        centres = np.column_stack([grid[index % len(grid)], height])
        jitter = np.random.default_rng(self.seed).uniform(-JITTER, JITTER, centres.shape)
        return centres + RADIUS * jitter
