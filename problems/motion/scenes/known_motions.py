"""Registry entries of the scenes whose motion is known in closed form.

The options of a scene are the fields of its class.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import Field, fields
from functools import partial
from typing import Any

from ...arrays import FloatArray
from ..bodies.balls import BallSystem
from ..bodies.rigid.rigid_bodies import RigidBodies
from .bouncing import BouncingBall
from .effects import Gravity
from .impacts import NewtonsCradle, ObliqueImpact
from .inclines import BlockOnIncline, SlidingSphere, SphereOnIncline
from .options import Option
from .resting import Stack, VGroove
from .scene import ClosedFormScene, Scene, SceneKind, completed, kinetic_energy

DEFAULT_STEP_SIZE = 1e-3
"""Default Δt of a fixed step [s]."""

DEFAULT_LENGTH = 0.1
"""Reference length [m] of penetrations in scenes without a radius."""


def scene_kind(scene_class: Any, summary: str, duration: float = 1.0, *, has_few_contacts: bool = True) -> SceneKind:
    """Return the registry entry of a class whose fields are the options of its scene.

    Args:
        scene_class: a ``ClosedFormScene``, or another class with ``system`` and ``start``; it may have ``observables``,
            ``ending``, ``step_size``, ``depth`` and ``driven_bodies``.
        summary: one-line description for lists.
        duration: default duration of a simulation [s].
        has_few_contacts: see ``Scene``.
    """
    texts = _attribute_texts(scene_class)
    options = {field.name: _option(field, texts.get(field.name, "")) for field in fields(scene_class)}
    return SceneKind(summary, options, partial(_make_scene, scene_class, duration, has_few_contacts))


def _make_scene(
    scene_class: Any, duration: float, has_few_contacts: bool, name: str, options: Mapping[str, Any]
) -> Scene:
    motion = scene_class(**options)
    system, start = motion.system(), motion.start()
    balls, gravity = system if isinstance(system, BallSystem) else None, Gravity(getattr(motion, "gravity", 0.0))
    driven_bodies = getattr(motion, "driven_bodies", ())
    potential_energy: Callable[[FloatArray], float] | None
    if balls is not None:
        potential_energy = partial(_gravity_energy, balls, gravity)
    elif isinstance(system, RigidBodies):
        potential_energy = system.potential_energy
    else:
        potential_energy = motion.potential_energy
    return completed(
        Scene(
            name,
            options,
            system,
            start,
            length=getattr(motion, "radius", DEFAULT_LENGTH),
            step_size=getattr(motion, "step_size", DEFAULT_STEP_SIZE),
            duration=duration,
            kinetic_energy=kinetic_energy(system, start, driven_bodies),
            potential_energy=potential_energy,
            n_balls=balls.n_balls if balls else 0,
            depth=getattr(motion, "depth", None),
            has_few_contacts=has_few_contacts,
            exact=motion.exact if isinstance(motion, ClosedFormScene) else None,
            observables=getattr(motion, "observables", ()),
            ending=getattr(motion, "ending", None),
            driven_bodies=driven_bodies,
        )
    )


def _gravity_energy(balls: BallSystem, gravity: Gravity, position: FloatArray) -> float:
    return gravity.potential_energy(balls.centres(position), balls.masses)


def _option(field: "Field[Any]", meaning: str) -> Option:
    """Return the option of a field; the class checks narrower ranges."""
    default = field.default
    is_integer = isinstance(default, int) and not isinstance(default, bool)
    return Option(
        default,  # type: ignore[arg-type]
        meaning,
        lowest=0 if is_integer else -math.inf,
        highest=10_000 if is_integer else math.inf,
        can_be_off="None" in str(field.type),
    )


def _attribute_texts(scene_class: type) -> dict[str, str]:
    """Return the descriptions of attributes in the docstring of a class."""
    attributes = (inspect.getdoc(scene_class) or "").partition("Attributes:\n")[2].partition("\n\n")[0]
    matches = re.findall(r"^ {4}(\w+): (.+(?:\n {8}.+)*)", attributes, re.MULTILINE)
    return {name: " ".join(text.split()).rstrip(".") for name, text in matches}


KNOWN_MOTIONS: Mapping[str, SceneKind] = {
    "bouncing_ball": scene_kind(BouncingBall, "a ball that bounces infinitely often in finite time", 1.5),
    "sliding_sphere": scene_kind(SlidingSphere, "a sphere that slides at first and then rolls"),
    "oblique_impact": scene_kind(ObliqueImpact, "a sphere that hits level ground obliquely"),
    "newtons_cradle": scene_kind(NewtonsCradle, "a row of balls that touch, struck by the first one"),
    "sphere_on_incline": scene_kind(SphereOnIncline, "a sphere that rolls or slides down an incline"),
    "block_on_incline": scene_kind(BlockOnIncline, "a block that slides, stops or stays on an incline"),
    "stack": scene_kind(Stack, "balls at rest on top of each other"),
    "v_groove": scene_kind(VGroove, "a sphere in a groove, level or inclined"),
}
"""Scenes with an exact solution, by name."""
