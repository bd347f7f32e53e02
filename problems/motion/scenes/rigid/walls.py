"""A wall of bricks in running bond, at rest or struck by a ball.

The bricks lie level, without mortar. The wall stands with any friction, because normal forces alone balance all
weights; ``proxbench statics`` confirms this at μ = 0. The ball flies horizontally at half the height of the wall.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from ....arrays import FloatArray
from ....errors import ProblemError
from ...bodies.rigid.rigid_bodies import RigidBodies
from ...bodies.rigid.round_shapes import Sphere
from ...bodies.rigid.shapes import Box, Shape
from ...state import State
from ..effects import Friction, Gravity
from ..scene import Observable, check_positive
from .boxes import Size, incline, upright_poses
from .effects import BodyEffect, rigid_bodies

BRICK_GAP = 1e-3
"""Gap between adjacent bricks of a row divided by the length of a brick."""


@dataclass(frozen=True)
class BrickWall:
    """A wall along x; every second row begins and ends with half a brick.

    Attributes:
        rows: number of rows.
        columns: number of bricks in a full row.
        speed: velocity of the ball along y [m/s]; 0 for a wall without a ball.
        friction: μ of all contacts.
        size: length, thickness and height of a brick [m].
        radius: radius of the ball [m].
        density: density of bricks [kg/m³].
        ball_density: density of the ball [kg/m³].
        gravity: g [m/s²].
        overlap: initial depth of each contact [m].

    Raises:
        ProblemError: if a number is out of range, or the ball would touch the ground.
    """

    rows: int = 5
    columns: int = 4
    speed: float = 8.0
    friction: float = 0.6
    size: Size = (0.24, 0.115, 0.071)
    radius: float = 0.06
    density: float = 1800.0
    ball_density: float = 7800.0
    gravity: float = 9.81
    overlap: float = 1e-6

    def __post_init__(self) -> None:
        check_positive(self, "a wall", "rows", "columns", "radius", "density", "ball_density", "gravity")
        Box(self.size)
        if not 0.0 <= self.speed < inf:
            raise ProblemError(f"speed of the ball must not be negative, got {self.speed}; 0 omits the ball.")
        if not 0.0 <= self.overlap < 0.1 * self.size[2]:
            raise ProblemError(
                f"overlap of a wall must be at least 0 and below a tenth of the height of a brick, got {self.overlap}."
            )
        if self.speed and self.radius > self.mid_height:
            raise ProblemError("the ball touches the ground at half the wall's height; reduce its radius, or add rows.")

    @property
    def mid_height(self) -> float:
        """Height of the middle of the wall [m], at which the ball arrives."""
        return 0.5 * self.rows * self.size[2]

    def _bricks(self) -> Iterator[tuple[float, float, float]]:
        """Yield the row of each brick, and its centre along x and its length in brick lengths, from the bottom left."""
        for row in range(self.rows):
            begin = -0.5 * self.columns
            lengths = [1.0] * self.columns if row % 2 == 0 else [0.5, *[1.0] * (self.columns - 1), 0.5]
            for length in lengths:
                yield row, begin + 0.5 * length, length
                begin += length

    def system(self) -> RigidBodies:
        """Return the bricks, and after them the ball, on the ground z = 0."""
        _, thickness, height = self.size
        shapes: list[Shape] = [
            Box(((length - BRICK_GAP) * self.size[0], thickness, height)) for _, _, length in self._bricks()
        ]
        masses = [self.density * shape.volume for shape in shapes]
        if self.speed:
            shapes.append(Sphere(self.radius))
            masses.append(self.ball_density * shapes[-1].volume)
        effects: list[BodyEffect] = [Gravity(self.gravity), Friction(self.friction)]
        return rigid_bodies(shapes, np.array(masses), [incline(0.0)], effects)

    def start(self) -> State:
        """Return the wall at rest, and the ball a hundredth of its radius in front of it."""
        bricks = np.array(list(self._bricks()))
        n_bodies = len(bricks) + (1 if self.speed else 0)
        centres, twists = np.zeros((n_bodies, 3)), np.zeros((n_bodies, 6))
        centres[: len(bricks), 0] = self.size[0] * bricks[:, 1]
        centres[: len(bricks), 2] = (bricks[:, 0] + 0.5) * self.size[2] - (bricks[:, 0] + 1.0) * self.overlap
        if self.speed:
            centres[-1] = 0.0, -0.5 * self.size[1] - 1.01 * self.radius, self.mid_height
            twists[-1, 1] = self.speed
        return State(0.0, upright_poses(centres).ravel(), twists.ravel())

    def largest_displacement(self, state: State) -> float:
        """Return the largest displacement of a brick from the start [m]."""
        n_bricks = len(list(self._bricks()))
        change: FloatArray = (state.position - self.start().position).reshape(-1, 7)[:n_bricks, :3]
        return float(np.linalg.norm(change, axis=1).max())

    @property
    def observables(self) -> Sequence[Observable]:
        """The largest displacement of a brick."""
        return (Observable("moved", self.largest_displacement, label="largest displacement [m]", head="moved"),)
