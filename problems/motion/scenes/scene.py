"""Scenes, and the registry entries that create them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import FloatArray
from ...errors import ProblemError
from ..bodies.balls import BallSystem
from ..bodies.rigid.rigid_bodies import RigidBodies
from ..bodies.rigid.starts import check_start
from ..bodies.surfaces import Plane
from ..bodies.system import MechanicalSystem, System
from ..state import State
from ..trajectories.limit_cycle import KnownCycle
from .options import Option, OptionValue

LENGTH = 1.0
"""Reference length of penetrations in scenes without a radius [m]."""

STEP_SIZE = 5e-4
"""Default Δt of a fixed step [s]."""

MAX_STEP = 0.02
"""Default Δt_max of a variable step for the motion of a few bodies [s]."""


@dataclass(frozen=True)
class Observable:
    """A number that a scene records at each step.

    Attributes:
        name: name of its column.
        compute: returns its value at a state.
        is_count: whether it is a count, a whole number that changes in jumps.
        label: its name in charts and recordings; empty if it is not shown.
        head: heading of its column in tables.
        rate: name of its mean rate of change in studies; empty if studies do not compare the rate.
    """

    name: str
    compute: Callable[[State], float]
    is_count: bool = False
    label: str = ""
    head: str = ""
    rate: str = ""


@dataclass(frozen=True)
class SceneEnding:
    """Why a simulation ends before its duration.

    Attributes:
        name: identifier in files and JSON.
        sentence: description of the ending, without a full stop.
        is_success: whether the scene ended as intended.
    """

    name: str
    sentence: str
    is_success: bool


@dataclass(frozen=True)
class EndingRule:
    """Rule that ends a simulation before its duration.

    Attributes:
        seconds: simulated time that ``find`` looks back [s].
        find: returns the ending from the last steps, or None. The steps are a structured array with the fields
            ``time`` [s] and the observables. They cover the last ``seconds`` and one step before them, if available.
    """

    seconds: float
    find: Callable[[NDArray[np.void]], SceneEnding | None]


@dataclass(frozen=True)
class StudyDefaults:
    """Defaults of a study of a scene.

    Attributes:
        options: options of the scene.
        duration: simulated time [s]; that of the scene if None.
        is_limit_cycle: whether ``options`` and ``duration`` describe one period of a limit cycle, so that the error at
            the end is the deviation from the start, apart from the descent. This does not hold for other options or
            durations.
    """

    options: Mapping[str, OptionValue] = field(default_factory=dict)
    duration: float | None = None
    is_limit_cycle: bool = False


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene with values for all options, ready to be simulated.

    Attributes:
        name: its name in the registry.
        options: the value of every option.
        system: the mechanical system.
        start: the initial state.
        length: reference length of penetrations [m], such as the radius of a ball.
        step_size: default Δt of a fixed step [s].
        duration: default simulated time [s].
        kinetic_energy: u ↦ T [J], without that of driven bodies.
        potential_energy: q ↦ V [J], None if it is not known.
        n_balls: number of balls, 0 if there are none.
        depth: penetration [m] to which ``Moreau`` projects positions, None if it does not; other steppers ignore it.
        longest_step: default Δt_max of a variable step [s], short enough to detect every contact.
        coordinates: index of each named coordinate by its name, in the order in which figures show them.
        has_few_contacts: whether contacts are so few that accurate solves and variable steps are the default.
        exact: returns the state at t [s] in closed form; None if there is no closed form.
        balls: sizes and surfaces of the balls, to draw them; None if there are none.
        bodies: rigid bodies with their shapes and joints, to draw them; None if there are none.
        observables: numbers recorded at each step, in addition to those of all simulations.
        ending: the rule that may end a simulation before its duration, None if there is none.
        contact_names: names of the contacts by their keys, empty if they have none.
        limit_cycle: the known limit cycle, None if there is none.
        view: name of the view that draws the scene in recordings; if None, its balls, rigid bodies or coordinates are
            drawn.
        driven_bodies: indices of rigid bodies whose motion is prescribed; recordings draw them as walls.
    """

    name: str
    options: Mapping[str, OptionValue]
    system: System
    start: State
    length: float
    step_size: float
    duration: float
    kinetic_energy: Callable[[FloatArray], float]
    potential_energy: Callable[[FloatArray], float] | None
    n_balls: int = 0
    depth: float | None = None
    longest_step: float = MAX_STEP
    coordinates: Mapping[str, int] = field(default_factory=dict)
    has_few_contacts: bool = False
    exact: Callable[[float], State] | None = None
    balls: BallSystem | None = None
    bodies: RigidBodies | None = None
    observables: Sequence[Observable] = ()
    ending: EndingRule | None = None
    contact_names: Sequence[str] = ()
    limit_cycle: KnownCycle | None = None
    view: str | None = None
    driven_bodies: Sequence[int] = ()

    def __post_init__(self) -> None:
        if self.balls is None and isinstance(self.system, BallSystem):
            object.__setattr__(self, "balls", self.system)
        if self.bodies is None and isinstance(self.system, RigidBodies):
            object.__setattr__(self, "bodies", self.system)


@dataclass(frozen=True)
class SceneKind:
    """An entry of the registry.

    Attributes:
        summary: its description for users.
        options: its options by name.
        build: returns the scene from its name and the values of all options.
        study: defaults of studies of the scene.
    """

    summary: str
    options: Mapping[str, Option]
    build: Callable[[str, Mapping[str, Any]], Scene]
    study: StudyDefaults = field(default_factory=StudyDefaults)


def bare_scene(name: str, options: Mapping[str, OptionValue], system: System, start: State) -> Scene:
    """Return the scene of a system and its initial state, with defaults for everything else.

    Raises:
        ProblemError: if rigid bodies cannot start from this state; see ``check_start``.
    """
    balls = system if isinstance(system, BallSystem) else None
    return completed(
        Scene(
            name,
            options,
            system,
            start,
            length=LENGTH if balls is None else float(balls.radii.max()),
            step_size=STEP_SIZE,
            duration=1.0,
            kinetic_energy=kinetic_energy(system, start),
            potential_energy=system.potential_energy if isinstance(system, BallSystem | RigidBodies) else None,
            n_balls=0 if balls is None else balls.n_balls,
        )
    )


WORLD_RADIUS = 1e4
"""Distance from the origin beyond which a body ends the simulation [m]."""


def completed(scene: Scene) -> Scene:
    """Check the start of a scene of rigid bodies, and apply ``bounded`` to it; return other scenes unchanged.

    Raises:
        ProblemError: if rigid bodies cannot start from this state (see ``check_start``), or a body is farther than
            ``WORLD_RADIUS`` from the origin.
    """
    bodies = scene.system
    if not isinstance(bodies, RigidBodies):
        return scene
    check_start(bodies, scene.start)
    distances = np.linalg.norm(bodies.centres(scene.start.position), axis=1)
    if distances.max(initial=0.0) > WORLD_RADIUS:
        body = int(distances.argmax())
        raise ProblemError(
            f"body {body} is {distances[body]:.6g} m from the origin at the start, beyond the limit of "
            f"{WORLD_RADIUS:g} m; move it closer."
        )
    return bounded(scene, bodies)


FARTHEST = "farthest"
"""Name of the observable that records the largest distance of a body from the origin [m]."""


def bounded(scene: Scene, bodies: RigidBodies, radius: float = WORLD_RADIUS) -> Scene:
    """Return a scene of rigid bodies that ends when a body is farther than ``radius`` [m] from the origin.

    The observable ``FARTHEST`` records the largest distance.
    """
    scene_rule = scene.ending

    def farthest(state: State) -> float:
        return float(np.linalg.norm(bodies.centres(state.position), axis=1).max(initial=0.0))

    def find(steps: NDArray[np.void]) -> SceneEnding | None:
        time, distance = float(steps["time"][-1]), float(steps[FARTHEST][-1])
        if distance > radius:
            sentence = (
                f"ended at {time:.4g} s: a body is {distance:.6g} m from the origin, beyond the limit of "
                f"{radius:g} m; earlier steps are kept"
            )
            return SceneEnding("left-world", sentence, False)
        return None if scene_rule is None else scene_rule.find(steps)

    observables = [observable for observable in scene.observables if observable.name != FARTHEST]
    ending = EndingRule(0.0 if scene_rule is None else scene_rule.seconds, find)
    return replace(scene, observables=(*observables, Observable(FARTHEST, farthest)), ending=ending)


OVERLAP = 1e-9
"""Initial depth of contacts [m], so that the first step finds them."""

RESTING_OVERLAP = 1e-5
"""Initial depth of faces that rest or slide on each other [m].

A solution within the tolerance τ may open a contact with the velocity τ max|c|, where c are the free velocities, and
nothing closes it again. A contact of depth d therefore lasts for at least d/(τ max|c|). If the contact opens, its body
falls for a step, tilts, and opens other contacts. With τ = 1e-6, max|c| = g Δt and Δt = 10 ms, this depth lasts for
100 s."""


GROUND = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""Level ground, z = 0."""


class ClosedFormScene(ABC):
    """A scene with a closed-form motion; subclasses are frozen dataclasses, whose fields are its options."""

    @abstractmethod
    def system(self) -> System:
        """Return the mechanical system."""

    def start(self) -> State:
        """Return the state at time 0."""
        return self.exact(0.0)

    @abstractmethod
    def exact(self, time: float) -> State:
        """Return the state at ``time`` [s] in closed form, with velocities after an impact at that time."""


def kinetic_energy(system: System, start: State, driven_bodies: Sequence[int] = ()) -> Callable[[FloatArray], float]:
    """Return u ↦ T [J] of a system with its mass matrix at ``start``, without the energy of driven bodies."""
    if isinstance(system, RigidBodies) and driven_bodies:
        is_free = np.ones((system.n_bodies, 1))
        is_free[list(driven_bodies)] = 0.0
        return lambda velocity: system.kinetic_energy((is_free * system.twists(velocity)).ravel())
    if isinstance(system, BallSystem | RigidBodies):
        return system.kinetic_energy
    if isinstance(system, MechanicalSystem):
        mass = system.mass(start.position)
        return lambda velocity: 0.5 * float(velocity @ mass @ velocity)
    inverse = system.assemble(start.position, start.velocity, 1.0).inverse_mass.matrix.toarray()
    return lambda velocity: 0.5 * float(velocity @ np.linalg.solve(inverse, velocity))


def check_positive(scene: object, what: str, *names: str) -> None:
    """Check that the attributes ``names`` of a scene are positive and finite; messages call the scene ``what``.

    Raises:
        ProblemError: if an attribute is not; the message names the first such attribute.
    """
    for name in names:
        value = getattr(scene, name)
        if not 0.0 < value < inf:
            raise ProblemError(f"{name} of {what} must be positive, got {value}.")
