"""Balls falling into a funnel (the example of Studer & Glocker 2005, section 5).

The paper gives no geometry. In this scene, balls have a radius of 1 cm and a density of 2500 kg/m³. A cone with a
half-angle of 45° and a height of 14.5 cm ends below in an outlet with a radius of 4.5 ball radii and a circular rim,
and above in a vertical wall. The balls start on a jittered lattice with a pitch of 2.3 radii and move downwards at 1
m/s.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.balls import BallSystem
from ..bodies.surfaces import Plane, Rim, Segment, Surface
from ..state import State
from .effects import Conservative, Drag, Effect, Friction, Gravity, Planar, Restitution, Spring, ball_system
from .options import Option
from .scene import EndingRule, Observable, Scene, SceneEnding, SceneKind, StudyDefaults

RADIUS = 0.01
"""Radius of a ball [m]."""

DENSITY = 2500.0
"""Density of a ball [kg/m³]."""

MASS = DENSITY * 4.0 / 3.0 * np.pi * RADIUS**3
"""Mass of a ball [kg]."""

CONE_HEIGHT = 0.145
"""Height of the cone above the outlet [m]."""

PITCH = 2.3
"""Initial distance between neighbouring balls, in ball radii."""

JITTER = 0.05
"""Largest initial displacement of a ball along each axis, in ball radii."""

DROP_SPEED = 1.0
"""Initial downward speed of the balls [m/s]."""

TIME_STEP = 5e-4
"""Default Δt of a fixed step [s]."""

WALL_TOP = 1e3
"""Height of the upper end of the wall [m], which no ball reaches."""

STANDARD_GRAVITY = 9.81
"""Default gravitational acceleration [m/s²]."""

POUR_SECONDS = 5.0
"""Default duration of a pour [s]; a pour ends earlier when all balls are through the outlet."""

JAM_SECONDS = 0.25
"""Simulated time of rest after which a funnel counts as jammed [s]; a ball falls by thirty radii in this time."""

JAM_AGITATION = 1e-4
"""Mean kinetic energy of a ball, divided by m g r, below which a pile counts as at rest."""

STANDARD_EFFECTS: tuple[Effect, ...] = (Gravity(9.81), Friction(0.3), Restitution(0.3, 0.0))
"""The effects of the paper's example."""


@dataclass(frozen=True)
class Funnel:
    """A funnel scene.

    Attributes:
        n_balls: number of balls.
        effects: the effects; ``Planar`` replaces the balls by discs between two slopes.
        outlet_radius: radius of the outlet in ball radii; 0 closes it with a plate.
        seed: seed of the initial jitter.

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
        """Return the balls on their lattice above the cone, moving downwards."""
        system = self.system()
        velocities = np.zeros((self.n_balls, system.dimension))
        velocities[:, -1] = -DROP_SPEED
        return State(0.0, self._lattice(system.dimension).ravel(), system.without_spin(velocities))

    def balls_through(self, position: FloatArray) -> int:
        """Return the number of balls of q, shape (n_balls · d,), whose centres are below the outlet."""
        return int(np.count_nonzero(position[self._dimension - 1 :: self._dimension] < 0.0))

    def agitation(self, position: FloatArray, velocity: FloatArray) -> float:
        """Return the mean kinetic energy of the balls above the outlet divided by m g r; 0 if all are through.

        At 1, the balls could rise by one radius. At 1e-4, the balls of a pile move at less than 5 mm/s.
        """
        above = position[self._dimension - 1 :: self._dimension] >= 0.0
        if not above.any():
            return 0.0
        energies = self._cached_system.kinetic_energies(velocity)
        return float(energies[above].mean()) / (MASS * STANDARD_GRAVITY * RADIUS)

    def ending(self, steps: NDArray[np.void]) -> SceneEnding | None:
        """Return how a pour ends: all balls are through, or the rest has been still for ``JAM_SECONDS``; else None.

        Args:
            steps: recent records of the trajectory, with ``time`` and the observables.
        """
        last = steps[-1]
        n_remaining, seconds = self.n_balls - int(last["balls_through"]), float(last["time"])
        if not n_remaining:
            sentence = f"emptied: all {self.n_balls} balls are through the outlet after {seconds:.4g} s"
            return SceneEnding("emptied", sentence, True)
        if last["agitation"] > JAM_AGITATION or steps["time"][0] > seconds - JAM_SECONDS:
            return None
        has_rested = (steps["agitation"][1:] <= JAM_AGITATION).all()
        if not has_rested or steps["balls_through"][1] != last["balls_through"]:
            return None
        sentence = (
            f"jammed at {seconds:.4g} s: {n_remaining} of {self.n_balls} balls rest above the outlet and no ball passes"
        )
        return SceneEnding("jammed", sentence, False)

    def potential_energy(self, position: FloatArray) -> float:
        """Return V [J] of the effects at q, shape (n_balls · d,); that of the weight is 0 at the outlet."""
        centres = position.reshape(self.n_balls, self._dimension)
        return sum(effect.potential_energy(centres, self._masses) for effect in self._conservative)

    @cached_property
    def _cached_system(self) -> BallSystem:
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
        """Return the centres [m], layer by layer from the bottom, inside the wall and above the cone, shape (n, d)."""
        pitch = PITCH * RADIUS
        max_offset = self.wall_radius - (1.0 + JITTER) * RADIUS
        half = int(max_offset / pitch)
        ticks = pitch * np.arange(-half, half + 1)
        grid = np.stack(np.meshgrid(*[ticks] * (dimension - 1), indexing="ij"), axis=-1).reshape(-1, dimension - 1)
        grid = grid[np.sqrt((grid**2).sum(axis=1)) <= max_offset]
        by_distance = np.argsort(np.round((grid**2).sum(axis=1), 12), kind="stable")
        per_layer = min(len(grid), max(1, round(self.n_balls ** (1.0 - 1.0 / dimension))))
        grid = grid[np.sort(by_distance[:per_layer])]
        index = np.arange(self.n_balls)
        height = CONE_HEIGHT + pitch * (1 + index // len(grid))
        centres = np.column_stack([grid[index % len(grid)], height])
        jitter = np.random.default_rng(self.seed).uniform(-JITTER, JITTER, centres.shape)
        return centres + RADIUS * jitter


def _build(name: str, options: Mapping[str, Any]) -> Scene:
    # a pile has no option "outlet", because its funnel is closed
    funnel = Funnel(options["balls"], _effects(options), options.get("outlet", 0.0), options["seed"])
    system = funnel.system()
    has_outlet, projection = bool(options.get("outlet")), options["projection"]
    observables = (
        Observable(
            "balls_through",
            lambda state: funnel.balls_through(state.position),
            is_count=True,
            label="balls through",
            head="through",
            rate="flow rate",
        ),
        Observable("agitation", lambda state: funnel.agitation(state.position, state.velocity)),
    )
    return Scene(
        name,
        options,
        system,
        funnel.start(),
        length=RADIUS,
        step_size=TIME_STEP,
        duration=POUR_SECONDS if has_outlet else 1.0,
        kinetic_energy=system.kinetic_energy,
        potential_energy=funnel.potential_energy,
        n_balls=funnel.n_balls,
        depth=None if projection is None else projection * RADIUS,
        longest_step=4.0 * TIME_STEP,
        observables=observables if has_outlet else (),
        ending=EndingRule(JAM_SECONDS, funnel.ending) if has_outlet else None,
    )


def _effects(options: Mapping[str, Any]) -> tuple[Effect, ...]:
    effects: list[Effect] = []
    for name, effect in (("gravity", Gravity), ("drag", Drag), ("friction", Friction)):
        if options[name] is not None:
            effects.append(effect(options[name]))
    if options["spring"] is not None:
        middle = (0.0,) if options["planar"] else (0.0, 0.0)
        effects.append(Spring(options["spring"], (*middle, CONE_HEIGHT)))
    if options["restitution"] is not None or options["tangential_restitution"] is not None:
        effects.append(Restitution(options["restitution"] or 0.0, options["tangential_restitution"] or 0.0))
    if options["planar"]:
        effects.append(Planar())
    return tuple(effects)


_OPTIONS: dict[str, Option] = {
    "balls": Option(1000, "number of balls", lowest=1, highest=1_000_000),
    "seed": Option(0, "seed of the initial jitter"),
    "gravity": Option(STANDARD_GRAVITY, "gravitational acceleration [m/s²]", can_be_off=True),
    "friction": Option(0.3, "friction coefficient; off: no friction laws, and balls do not turn", can_be_off=True),
    "restitution": Option(0.3, "normal restitution", highest=1.0, can_be_off=True),
    "tangential_restitution": Option(None, "tangential restitution", highest=1.0, can_be_off=True),
    "drag": Option(None, "linear drag on each centre [kg/s]", can_be_off=True),
    "spring": Option(None, "spring from each centre to the middle of the cone's top [N/m]", can_be_off=True),
    "projection": Option(
        0.02, "penetration [ball radii] to which positions are projected", lowest=1e-3, highest=1.0, can_be_off=True
    ),
    "planar": Option(False, "discs in a vertical plane instead of balls"),
}

_STUDY = StudyDefaults({"balls": 250}, duration=0.6)
"""A small pour: the flow begins after 0.2 s, and half of the balls are through the outlet at the end."""

FUNNEL = SceneKind(
    "balls pouring through a funnel",
    {**_OPTIONS, "outlet": Option(4.5, "radius of the outlet in ball radii; 0 closes it", highest=1000.0)},
    _build,
    _STUDY,
)
"""The scene ``funnel``."""

PILE = SceneKind("balls settling in a closed funnel", _OPTIONS, _build, _STUDY)
"""The scene ``pile``."""
