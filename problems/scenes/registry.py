"""The list of scenes, and how a name with options becomes one that can be simulated.

A scene of another kind is one more entry of ``SCENES``: what it is, its options, and a function that builds it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..arrays import FloatArray
from ..errors import ProblemError, suggestion
from ..mechanics.state import State
from ..mechanics.system import System
from .effects import Drag, Effect, Friction, Gravity, Planar, Restitution, Spring
from .funnel import CONE_HEIGHT, RADIUS, TIME_STEP, Funnel
from .options import Option, OptionValue, complete
from .woodpecker import (
    FRICTION,
    GRAVITY,
    OVERLAP,
    POLE_RADIUS,
    RESTITUTION,
    kinetic_energy,
    potential_energy,
    published_start,
    section_start,
    woodpecker,
)

POUR_SECONDS = 5.0
"""Time that a thousand balls have to leave through the outlet [s]; a pour ends earlier when all are through."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene with its options chosen, ready to be simulated.

    Attributes:
        name: its name in the registry.
        options: the value of every option.
        system: what moves.
        start: the first state.
        length: what penetrations are related to [m], the radius of a ball or of the pole.
        step_size: Δt [s] if nobody says otherwise.
        duration: how long it is simulated [s] if nobody says otherwise.
        kinetic_energy: u ↦ T [J].
        potential_energy: q ↦ V [J].
        balls_through: q ↦ how many balls have left through the outlet, None where there is no outlet.
        agitation: (q, u) ↦ mean kinetic energy of the balls that have not left, over m g r; None where there is none.
        n_balls: number of balls, 0 where there are none.
        depth: penetration [m] to which positions are projected, None where they are not.
        longest_step: Δt_max [s] of a variable step if nobody says otherwise: nothing is jumped over in it.
        coordinates: index of each coordinate that has a name of its own, by that name, in the order of figures.
    """

    name: str
    options: Mapping[str, OptionValue]
    system: System
    start: State
    length: float
    step_size: float
    duration: float
    kinetic_energy: Callable[[FloatArray], float]
    potential_energy: Callable[[FloatArray], float]
    balls_through: Callable[[FloatArray], int] | None = None
    agitation: Callable[[FloatArray, FloatArray], float] | None = None
    n_balls: int = 0
    depth: float | None = None
    longest_step: float = 4.0 * TIME_STEP
    coordinates: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class SceneKind:
    """An entry of the registry.

    Attributes:
        summary: what it is, for people.
        options: its options by name.
        build: makes the scene from its name and the value of every option.
        has_few_contacts: whether accurate solves and variable steps are affordable, and what people want.
    """

    summary: str
    options: Mapping[str, Option]
    build: Callable[[str, Mapping[str, Any]], Scene]
    has_few_contacts: bool = False


def make_scene(name: str, options: Mapping[str, object] | None = None) -> Scene:
    """Return the scene called ``name``: ``make_scene("funnel", {"balls": 100, "friction": None})``.

    Raises:
        ProblemError: for an unknown scene or option, with the nearest name, or a value out of range.
    """
    if name not in SCENES:
        raise ProblemError(f"there is no scene {name!r}{suggestion(name, SCENES)}")
    kind = SCENES[name]
    return kind.build(name, complete(name, kind.options, options or {}))


def _funnel(name: str, options: Mapping[str, Any]) -> Scene:
    # a pile is a funnel without the option of an outlet: it is closed
    funnel = Funnel(options["balls"], _effects(options), options.get("outlet", 0.0), options["seed"])
    system = funnel.system()
    has_outlet, projection = bool(options.get("outlet")), options["projection"]
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
        balls_through=funnel.balls_through if has_outlet else None,
        agitation=funnel.agitation if has_outlet else None,
        n_balls=funnel.n_balls,
        depth=None if projection is None else projection * RADIUS,
        longest_step=4.0 * TIME_STEP,
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


def _woodpecker(name: str, options: Mapping[str, Any]) -> Scene:
    gravity = options["gravity"] or 0.0
    return Scene(
        name,
        options,
        woodpecker(options["friction"], options["restitution"] or 0.0, gravity),
        published_start() if options["start"] == "published" else section_start(OVERLAP),
        length=POLE_RADIUS,
        step_size=2e-5,
        duration=1.0,
        kinetic_energy=kinetic_energy,
        potential_energy=lambda position: potential_energy(position, gravity),
        longest_step=0.02,
        coordinates={"sleeve angle [rad]": 1, "bird angle [rad]": 2, "sleeve height [m]": 0},
    )


_GRAVITY = Option(GRAVITY, "acceleration of weight [m/s²]", can_be_off=True)
_FRICTION = Option(FRICTION, "friction coefficient; off: no friction laws, and balls do not turn", can_be_off=True)

_BALLS: dict[str, Option] = {
    "balls": Option(1000, "number of balls", lowest=1, highest=1_000_000),
    "seed": Option(0, "of the jitter of the start"),
    "gravity": _GRAVITY,
    "friction": _FRICTION,
    "restitution": Option(0.3, "normal restitution", highest=1.0, can_be_off=True),
    "tangential_restitution": Option(None, "tangential restitution", highest=1.0, can_be_off=True),
    "drag": Option(None, "linear drag on each centre [kg/s]", can_be_off=True),
    "spring": Option(None, "spring from each centre to the middle of the cone's top [N/m]", can_be_off=True),
    "projection": Option(
        0.02, "penetration [ball radii] to which positions are projected", lowest=1e-3, highest=1.0, can_be_off=True
    ),
    "planar": Option(False, "discs in a vertical plane instead of balls"),
}

SCENES: Mapping[str, SceneKind] = {
    "funnel": SceneKind(
        "balls pouring through a funnel",
        {**_BALLS, "outlet": Option(4.5, "radius of the outlet in ball radii; 0 closes it", highest=1000.0)},
        _funnel,
    ),
    "pile": SceneKind("balls settling in a closed funnel", _BALLS, _funnel),
    "woodpecker": SceneKind(
        "the woodpecker toy, hopping down its pole",
        {
            "gravity": _GRAVITY,
            "friction": _FRICTION,
            "restitution": Option(RESTITUTION[0], "normal restitution of the beak", highest=1.0, can_be_off=True),
            "start": Option("published", "first state", choices=("published", "cycle")),
        },
        _woodpecker,
        has_few_contacts=True,
    ),
}
"""Scenes by name."""
