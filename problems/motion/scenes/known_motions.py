"""Scenes whose motion is known in closed form, as entries of the registry; options are the fields of their classes."""

import inspect
import math
import re
from collections.abc import Mapping
from dataclasses import Field, fields
from functools import partial
from typing import Any

from ...arrays import FloatArray
from ..bodies.balls import BallSystem
from .bouncing import BouncingBall
from .effects import Gravity
from .impacts import NewtonsCradle, ObliqueImpact
from .inclines import BlockOnIncline, SphereOnIncline
from .options import Option
from .resting import Stack, VGroove
from .rolling import SlidingSphere
from .scene import Scene, SceneKind, kinetic_energy

STEP_SIZE = 1e-3
"""Δt [s] of a fixed step."""

LENGTH = 0.1
"""Length of scenes without a radius [m], over which penetrations are given."""


def _kind(made: Any, summary: str, duration: float = 1.0) -> SceneKind:
    """Return the entry of the class ``made``, which is simulated for ``duration`` [s] by default."""
    meanings = _meanings(made)
    options = {field.name: _option(field, meanings.get(field.name, "")) for field in fields(made)}
    return SceneKind(summary, options, partial(_built, made, duration))


def _built(made: Any, duration: float, name: str, options: Mapping[str, Any]) -> Scene:
    motion = made(**options)
    system, start = motion.system(), motion.start()
    balls, weight = system if isinstance(system, BallSystem) else None, Gravity(getattr(motion, "gravity", 0.0))
    return Scene(
        name,
        options,
        system,
        start,
        length=getattr(motion, "radius", LENGTH),
        step_size=STEP_SIZE,
        duration=duration,
        kinetic_energy=kinetic_energy(system, start),
        potential_energy=partial(_weight, balls, weight) if balls else motion.potential_energy,
        n_balls=balls.n_balls if balls else 0,
        has_few_contacts=True,
        exact=motion.exact,
    )


def _weight(balls: BallSystem, weight: Gravity, position: FloatArray) -> float:
    return weight.potential_energy(balls.centres(position), balls.masses)


def _option(field: "Field[Any]", meaning: str) -> Option:
    """Return the option of a field, whose range the class checks."""
    default = field.default
    whole = isinstance(default, int) and not isinstance(default, bool)
    return Option(
        default,  # type: ignore[arg-type]
        meaning,
        lowest=0 if whole else -math.inf,
        highest=10_000 if whole else math.inf,
        can_be_off="None" in str(field.type),
    )


def _meanings(made: type) -> dict[str, str]:
    """Return the descriptions of attributes in the docstring of a class."""
    attributes = (inspect.getdoc(made) or "").partition("Attributes:\n")[2].partition("\n\n")[0]
    found = re.findall(r"^ {4}(\w+): (.+(?:\n {8}.+)*)", attributes, re.MULTILINE)
    return {name: " ".join(text.split()).rstrip(".") for name, text in found}


KNOWN_MOTIONS: Mapping[str, SceneKind] = {
    "bouncing_ball": _kind(BouncingBall, "a ball that bounces infinitely often in finite time", 1.5),
    "sliding_sphere": _kind(SlidingSphere, "a sphere that slides at first and then rolls"),
    "oblique_impact": _kind(ObliqueImpact, "a sphere that hits level ground obliquely"),
    "newtons_cradle": _kind(NewtonsCradle, "a row of balls that touch, struck by the first one"),
    "sphere_on_incline": _kind(SphereOnIncline, "a sphere that rolls or slides down an incline"),
    "block_on_incline": _kind(BlockOnIncline, "a block that slides, stops or stays on an incline"),
    "stack": _kind(Stack, "balls at rest one upon the other"),
    "v_groove": _kind(VGroove, "a sphere in a groove, level or inclined"),
}
"""Scenes with an exact answer by name."""
