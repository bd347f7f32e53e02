"""The registry of scenes, from which a scene is built by its name and options.

To add a scene, define a ``SceneKind`` in its module, and add it to ``SCENES``.
"""

from collections.abc import Mapping
from typing import Any

from ...errors import ProblemError, suggestion
from ...names import check_options, read_name
from .funnel import FUNNEL, PILE
from .known_motions import KNOWN_MOTIONS
from .options import complete
from .rigid.registry import RIGID_SCENES
from .scene import Scene, SceneKind
from .woodpecker import WOODPECKER

SCENES: Mapping[str, SceneKind] = {
    "funnel": FUNNEL,
    "pile": PILE,
    "woodpecker": WOODPECKER,
    **KNOWN_MOTIONS,
    **RIGID_SCENES,
}
"""Kinds of scenes by name."""

EXAMPLE = "funnel(balls=300)"
"""A scene with an option, as error messages show it."""


def make_scene(name: str, options: Mapping[str, object] | None = None) -> Scene:
    """Return a scene: ``make_scene("funnel(balls=100, friction=None)")``, or ``make_scene("funnel", {"balls": 100})``.

    Args:
        name: name of the scene, with or without options.
        options: further options, which override those in the name.

    Raises:
        ProblemError: if the scene or an option is unknown (the message suggests the nearest name), or a value is out of
            range.
    """
    given: object = options
    if given is not None and not isinstance(given, Mapping):
        raise ProblemError(f"options of a scene must be a dictionary, such as {{'balls': 100}}, got {options!r:.60}.")
    base_name, named_options = parse_scene(name)
    if base_name not in SCENES:
        raise ProblemError(f"there is no scene {base_name!r}{suggestion(base_name, SCENES, 'proxbench list scenes')}")
    kind = SCENES[base_name]
    return kind.build(base_name, complete(base_name, kind.options, {**named_options, **(options or {})}))


def parse_scene(text: str) -> tuple[str, dict[str, Any]]:
    """Split a text such as ``"funnel(balls=100)"`` into name and options of a scene, which need not exist.

    Raises:
        ProblemError: if the text is not a name with or without options.
    """
    parsed = read_name(text, "scene", EXAMPLE, ProblemError)
    if parsed.parts:
        raise ProblemError(f"cannot read {text!r:.200} as a scene; give its options by name, as in {EXAMPLE}.")
    return parsed.plain, dict(parsed.options)


def convert_option(scene: str, name: str, value: object) -> object:
    """Return a value converted to the type of a scene's option.

    A value of a plugin scene is returned unchanged, because the scene checks it when it is built.

    Raises:
        ProblemError: if the option is unknown, or the value is out of range.
    """
    if scene not in SCENES:
        return value
    options = SCENES[scene].options
    check_options(f"the scene {scene!r}", [name], options, ProblemError)
    return options[name].checked(name, value)
