"""The list of scenes, and how a name with options becomes one that can be simulated.

A scene of another kind is one more entry of ``SCENES``: what it is, its options, and a function that builds it.
"""

from collections.abc import Mapping
from typing import Any

from ...errors import ProblemError, suggestion
from ...names import check_options, read_name
from .effects import Drag, Effect, Friction, Gravity, Planar, Restitution, Spring
from .funnel import CONE_HEIGHT, RADIUS, TIME_STEP, Funnel
from .known_motions import KNOWN_MOTIONS
from .options import Option, complete
from .scene import Scene, SceneKind, kinetic_energy
from .woodpecker import (
    FRICTION,
    GRAVITY,
    OVERLAP,
    POLE_RADIUS,
    RESTITUTION,
    potential_energy,
    published_start,
    section_start,
    woodpecker,
)

EXAMPLE = "funnel(balls=300)"

POUR_SECONDS = 5.0
"""Time that a thousand balls have to leave through the outlet [s]; a pour ends earlier when all are through."""


def make_scene(name: str, options: Mapping[str, object] | None = None) -> Scene:
    """Return a scene: ``make_scene("funnel(balls=100, friction=None)")``, or ``make_scene("funnel", {"balls": 100})``.

    Raises:
        ProblemError: for an unknown scene or option, with the nearest name, or a value out of range.
    """
    plain, written = read_scene(name)
    if plain not in SCENES:
        raise ProblemError(f"there is no scene {plain!r}{suggestion(plain, SCENES)}")
    kind = SCENES[plain]
    return kind.build(plain, complete(plain, kind.options, {**written, **(options or {})}))


def read_scene(text: str) -> tuple[str, dict[str, Any]]:
    """Return the plain name of a scene and the options that are written with it, whether there is such a scene or not.

    Raises:
        ProblemError: if the text is no name, or no name with options.
    """
    written = read_name(text, "scene", EXAMPLE, ProblemError)
    if written.parts:
        raise ProblemError(f"cannot read {text!r:.200} as a scene; name its options: {EXAMPLE}.")
    return written.plain, dict(written.options)


def check_option(scene: str, name: str, value: object) -> object:
    """Return a value as the option ``name`` of a scene holds it; scenes of plugins check theirs when they are built.

    Raises:
        ProblemError: for an unknown option, or a value out of range.
    """
    if scene not in SCENES:
        return value
    options = SCENES[scene].options
    check_options(f"the scene {scene!r}", [name], options, ProblemError)
    return options[name].checked(name, value)


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
    system = woodpecker(options["friction"], options["restitution"] or 0.0, gravity)
    start = published_start() if options["start"] == "published" else section_start(OVERLAP)
    return Scene(
        name,
        options,
        system,
        start,
        length=POLE_RADIUS,
        step_size=2e-5,
        duration=1.0,
        kinetic_energy=kinetic_energy(system, start),
        potential_energy=lambda position: potential_energy(position, gravity),
        coordinates={"sleeve angle [rad]": 1, "bird angle [rad]": 2, "sleeve height [m]": 0},
        has_few_contacts=True,
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
    ),
    **KNOWN_MOTIONS,
}
"""Scenes by name."""
