"""Boxes in containers: a drum that turns about a level axis, and a hopper with a slot.

The staves of the drum are bodies that move on circles about the axis. Each is ``STAVE_MASS_RATIO`` times as heavy as a
box, so that they move as a ring at constant speed. The walls at the ends of both containers are planes without
friction.

Both reference results are wide empirical ranges. The angle of repose of most dry grains is between 25 and 45°, and
larger for angular grains than for round ones (review: Beakawi Al-Hashemi & Al-Amoudi, *A review on the angle of repose
of granular materials*, Powder Technology 330, 397, 2018); in a slowly turning drum, the slope is close to this angle.

The flow through a round outlet of diameter D, for grains of diameter d and bulk density ρ, is

    W = 0.58 ρ √g (D − k d)^(5/2) = 0.58 · 4/π ρ A √(g D_h),      k ≈ 1.4,      A = π (D − k d)²/4

(Beverloo, Leniger & van de Velde, *The flow of granular solids through orifices*, Chem. Eng. Sci. 15, 260, 1961). With
the hydraulic diameter D_h = 4 A/perimeter, which is D − k d for this outlet and 2 (D − k d) for a long slot of
width D and depth w, the same law is

    W = C ρ √g w (D − k d)^(3/2),      C = 0.58 · 4 √2/π = 1.04

(Nedderman, *Statics and kinematics of granular materials*, Cambridge 1992, chapter 10, which has 1.03). Walls without
friction at the ends of the slot do not narrow it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi, sqrt, tan

import numpy as np
from numpy.typing import NDArray

from ....arrays import FloatArray
from ....errors import ProblemError
from ...bodies.rigid.materials import MaterialPairs
from ...bodies.rigid.orientation import Y_AXIS, about, exponential
from ...bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from ...bodies.rigid.shapes import Box, HalfSpace
from ...state import State
from ..effects import Force, Friction, Gravity
from ..scene import EndingRule, Observable, SceneEnding, check_positive
from .effects import BodyEffect, rigid_bodies

PITCH = 1.3
"""Initial distance of boxes divided by their edge."""

TILT = 0.15
"""Largest initial rotation of a box about each axis [rad]."""

STAVE_MASS_RATIO = 1e9
"""Mass of a stave divided by that of a box."""

STAVES = 24
"""Number of staves of a drum."""

GAP = 1e-3
"""Clearance at each end of a stave, divided by the inner radius around the drum and by the width along the axis."""

JAM_SECONDS = 0.5
"""Time without a passing box after which a hopper counts as jammed [s]."""

BEVERLOO_COEFFICIENT, BEVERLOO_NARROWING = 1.03, 1.4
"""C and k of a slot."""

PACKING = 0.6
"""Volume fraction of a random pile of boxes."""

MAX_COLUMNS, MAX_LATTICE_ROWS = 100, 10_000
"""Largest numbers of columns of a lattice on either side of its middle, and of its rows."""

DOWN = (0.0, 0.0, -1.0)
"""Direction of gravity."""


@dataclass(frozen=True)
class DrivenRing(Force):
    """The weight of boxes, and the force that keeps the bodies listed after them on circles about the y axis.

    Attributes:
        n_boxes: number of bodies with weight.
        gravity: g [m/s²].
        speed: angular velocity of the other bodies [rad/s].
    """

    n_boxes: int
    gravity: float
    speed: float

    def accelerate(self, centres: FloatArray, velocities: FloatArray, masses: FloatArray) -> FloatArray:
        """Return −g along z for boxes, and −ω² times the vector from the y axis for the other bodies [m/s²]."""
        accelerations: FloatArray = -(self.speed**2) * centres * np.array([1.0, 0.0, 1.0])
        accelerations[: self.n_boxes] = self.gravity * np.array(DOWN)
        return accelerations

    def potential_energy(self, centres: FloatArray, masses: FloatArray) -> float:
        """Return V = Σ m g z of the bodies with weight [J]; that of the other bodies is constant on their circles."""
        return self.gravity * float(masses[: self.n_boxes] @ centres[: self.n_boxes, 2])


def end_walls(width: float) -> list[FixedBody]:
    """Return the half-spaces beyond y = ±width/2."""
    return [
        FixedBody(HalfSpace(), (0.0, 0.5 * side * width, 0.0), tuple(about((1.0, 0.0, 0.0), 0.5 * side * pi)))
        for side in (-1.0, 1.0)
    ]


def lattice(
    count: int, edge: float, layers: int, seed: int, has_room: Callable[[float, float], bool], *, lowest: float
) -> FloatArray:
    """Return poses, shape (count, 7), of boxes on a lattice, filled from the lowest row up and from the middle out.

    Each box has a small random rotation.

    Args:
        count: number of boxes.
        edge: edge of a box [m].
        layers: number of layers along y.
        seed: seed of the rotations.
        has_room: (x, z) [m] ↦ whether a box with its centre there is inside.
        lowest: smallest z of a centre [m].

    Raises:
        ProblemError: if the boxes do not fit.
    """
    pitch = PITCH * edge
    columns = (pitch * np.array(sorted(range(-MAX_COLUMNS, MAX_COLUMNS + 1), key=abs))).tolist()
    sites: list[tuple[float, float]] = []
    for row in range(MAX_LATTICE_ROWS):
        z = lowest + pitch * row
        row_sites = [(x, z) for x in columns if has_room(x, z)]
        sites += row_sites
        if layers * len(sites) >= count or (sites and not row_sites):
            break
    if layers * len(sites) < count:
        raise ProblemError(f"{count} boxes do not fit; at most {layers * len(sites)} do.")
    poses = np.zeros((count, 7))
    for box in range(count):
        x, z = sites[box // layers]
        poses[box, :3] = x, pitch * (box % layers - 0.5 * (layers - 1)), z
    poses[:, 3:] = exponential(np.random.default_rng(seed).uniform(-TILT, TILT, (count, 3)))
    return poses


class BoxContainer:
    """A container of equal boxes between end walls without friction; subclasses are frozen dataclasses."""

    n_boxes: int
    friction: float
    edge: float
    layers: int
    density: float

    @property
    def width(self) -> float:
        """Distance w between the end walls [m], which has room for ``layers`` boxes."""
        return PITCH * self.edge * self.layers

    @property
    def box(self) -> Box:
        """One of the boxes."""
        return Box((self.edge, self.edge, self.edge))

    def box_friction(self, n_parts: int, n_fixed: int) -> Friction:
        """Return the friction of boxes on each other and on ``n_parts`` parts of the container; end walls have none.

        Args:
            n_parts: bodies after the boxes and before the end walls, whether they move or not.
            n_fixed: bodies without degrees of freedom, including the end walls.
        """
        materials = (*["box"] * (self.n_boxes + n_parts), "end", "end")
        return Friction(MaterialPairs(materials, {("box", "box"): self.friction, ("box", "end"): 0.0}, n_fixed=n_fixed))


@dataclass(frozen=True)
class RotatingDrum(BoxContainer):
    """Boxes in a drum that turns about the y axis.

    Attributes:
        n_boxes: number of boxes.
        speed: angular velocity of the drum [rad/s].
        friction: μ between boxes, and on the staves.
        edge: edge of a box [m].
        radius: inner radius of the drum [m].
        layers: layers of boxes along the axis, which determine the depth of the drum.
        density: density of boxes [kg/m³].
        gravity: g [m/s²].
        seed: seed of the initial rotations.

    Raises:
        ProblemError: if a number is not positive, or centrifugal forces reach the weight.
    """

    n_boxes: int = 48
    speed: float = 2.0
    friction: float = 0.3
    edge: float = 0.016
    radius: float = 0.1
    layers: int = 2
    density: float = 1000.0
    gravity: float = 9.81
    seed: int = 0

    depth = 1e-4
    step_size = 2e-3

    def __post_init__(self) -> None:
        check_positive(self, "a drum", "n_boxes", "speed", "edge", "radius", "layers", "density", "gravity")
        if self.speed**2 * self.radius >= self.gravity:
            raise ProblemError(f"boxes stick to a drum that turns with {self.speed} rad/s; reduce its speed or radius.")

    @property
    def driven_bodies(self) -> Sequence[int]:
        """The indices of the staves."""
        return range(self.n_boxes, self.n_boxes + STAVES)

    @property
    def _stave(self) -> Box:
        length = 2.0 * self.radius * (tan(pi / STAVES) - GAP)
        return Box((length, (1.0 - 2.0 * GAP) * self.width, 0.2 * self.radius))

    def system(self) -> RigidBodies:
        """Return the boxes, the staves, and the end walls."""
        mass = self.density * self.box.volume
        masses = np.array([mass] * self.n_boxes + [STAVE_MASS_RATIO * mass] * STAVES)
        effects: list[BodyEffect] = [
            DrivenRing(self.n_boxes, self.gravity, self.speed),
            self.box_friction(STAVES, n_fixed=2),
        ]
        shapes = [self.box] * self.n_boxes + [self._stave] * STAVES
        return rigid_bodies(shapes, masses, end_walls(self.width), effects)

    def start(self) -> State:
        """Return the boxes at rest, and the staves in motion.

        Raises:
            ProblemError: if the boxes do not fit.
        """
        reach = self.radius - self.edge

        def has_room(x: float, z: float) -> bool:
            return x * x + z * z < reach * reach

        boxes = lattice(self.n_boxes, self.edge, self.layers, self.seed, has_room, lowest=-reach)
        angles = 2.0 * pi * np.arange(STAVES) / STAVES
        staves, twists = np.zeros((STAVES, 7)), np.zeros((STAVES, 6))
        distance = self.radius + 0.5 * self._stave.size[2]
        staves[:, 0], staves[:, 2] = distance * np.sin(angles), distance * np.cos(angles)
        staves[:, 3:] = [about(Y_AXIS, angle) for angle in angles.tolist()]
        twists[:, 0], twists[:, 2] = self.speed * staves[:, 2], -self.speed * staves[:, 0]
        twists[:, 4] = self.speed
        position = np.concatenate([boxes.ravel(), staves.ravel()])
        return State(0.0, position, np.concatenate([np.zeros(6 * self.n_boxes), twists.ravel()]))

    def slope(self, state: State) -> float:
        """Return the angle between the vertical and the line from the axis to the centre of all boxes [degrees].

        The angle equals the slope of the surface if the surface is a plane.
        """
        x, _, z = state.position.reshape(-1, 7)[: self.n_boxes, :3].mean(axis=0)
        return float(np.degrees(np.arctan2(-x, -z)))

    @property
    def observables(self) -> Sequence[Observable]:
        """The slope of the boxes."""
        return (Observable("slope", self.slope, label="slope [°]", head="slope"),)


@dataclass(frozen=True)
class Hopper(BoxContainer):
    """Boxes that flow out of a wedge of 45° through a slot along y.

    Attributes:
        n_boxes: number of boxes.
        outlet: width of the slot divided by the edge of a box.
        friction: μ between boxes, and on the wedge.
        edge: edge of a box [m].
        layers: layers of boxes along the slot, which determine its length.
        density: density of boxes [kg/m³].
        gravity: g [m/s²].
        seed: seed of the initial rotations.

    Raises:
        ProblemError: if a number is not positive.
    """

    n_boxes: int = 100
    outlet: float = 5.0
    friction: float = 0.3
    edge: float = 0.02
    layers: int = 3
    density: float = 1000.0
    gravity: float = 9.81
    seed: int = 0

    depth = 1e-4
    step_size = 1e-3

    def __post_init__(self) -> None:
        check_positive(self, "a hopper", "n_boxes", "outlet", "edge", "layers", "density", "gravity")

    @property
    def height(self) -> float:
        """Height of the wedge [m]."""
        return 6.0 * self.edge

    @cached_property
    def flow_rate(self) -> float:
        """Boxes per second by Beverloo's law, where d belongs to the sphere with the volume of a box; 0 if D ≤ k d."""
        diameter = self.edge * (6.0 / pi) ** (1.0 / 3.0)
        free_width = max(self.outlet * self.edge - BEVERLOO_NARROWING * diameter, 0.0)
        return float(BEVERLOO_COEFFICIENT * PACKING / self.edge**3 * sqrt(self.gravity) * self.width * free_width**1.5)

    def system(self) -> RigidBodies:
        """Return the boxes, the wedge, the walls above it, and the end walls."""
        half, height, thickness = 0.5 * self.outlet * self.edge, self.height, 2.0 * self.edge
        fixed_bodies = []
        for side in (-1.0, 1.0):
            along = np.array([side, 0.0, 1.0]) / sqrt(2.0)
            outward = np.array([side, 0.0, -1.0]) / sqrt(2.0)
            centre = np.array([side * half, 0.0, 0.0]) + 0.5 * sqrt(2.0) * height * along + 0.5 * thickness * outward
            plate = Box((sqrt(2.0) * height, self.width, thickness))
            fixed_bodies.append(FixedBody(plate, tuple(centre.tolist()), tuple(about(Y_AXIS, -0.25 * side * pi))))
            wall_orientation = tuple(about(Y_AXIS, -0.5 * side * pi))
            fixed_bodies.append(FixedBody(HalfSpace(), (side * (half + height), 0.0, 0.0), wall_orientation))
        fixed_bodies += end_walls(self.width)
        masses = np.full(self.n_boxes, self.density * self.box.volume)
        effects: list[BodyEffect] = [Gravity(self.gravity), self.box_friction(4, n_fixed=6)]
        return rigid_bodies([self.box] * self.n_boxes, masses, fixed_bodies, effects)

    def start(self) -> State:
        """Return the boxes at rest above the outlet.

        Raises:
            ProblemError: if the boxes do not fit.
        """
        half, clearance = 0.5 * self.outlet * self.edge, 0.7 * PITCH * self.edge

        def has_room(x: float, z: float) -> bool:
            return abs(x) < half + min(z - sqrt(2.0) * clearance, self.height - clearance)

        poses = lattice(self.n_boxes, self.edge, self.layers, self.seed, has_room, lowest=self.edge)
        return State(0.0, poses.ravel(), np.zeros(6 * self.n_boxes))

    def boxes_through(self, state: State) -> int:
        """Return the number of boxes whose centres are below the outlet."""
        return int(np.count_nonzero(state.position[2::7] < 0.0))

    @property
    def observables(self) -> Sequence[Observable]:
        """The number of boxes that have passed the outlet."""
        count = Observable("boxes_through", self.boxes_through, True, "boxes through", "through", "flow rate")
        return (count,)

    @property
    def ending(self) -> EndingRule:
        """The rule that ends a simulation when all boxes have passed, or no box has passed for ``JAM_SECONDS``."""
        return EndingRule(JAM_SECONDS, self._find_ending)

    def _find_ending(self, steps: NDArray[np.void]) -> SceneEnding | None:
        last = steps[-1]
        n_remaining, seconds = self.n_boxes - int(last["boxes_through"]), float(last["time"])
        if not n_remaining:
            return SceneEnding("emptied", f"emptied: all {self.n_boxes} boxes are through after {seconds:.4g} s", True)
        if steps["time"][0] > seconds - JAM_SECONDS or steps["boxes_through"][0] != last["boxes_through"]:
            return None
        sentence = f"jammed at {seconds:.4g} s: none of {n_remaining} boxes has passed the outlet for {JAM_SECONDS:g} s"
        return SceneEnding("jammed", sentence, False)
