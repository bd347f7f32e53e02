"""The registry of scenes, which builds a scene from its name with options.

To add a scene, add to ``SCENES`` a ``SceneKind`` from the file of the scene.
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
"""Scenes by name."""

EXAMPLE = "funnel(balls=300)"


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
    """Return the plain name of a scene and the options written with it; the scene need not exist.

    Raises:
        ProblemError: if the text is not a name with or without options.
    """
    written = read_name(text, "scene", EXAMPLE, ProblemError)
    if written.parts:
        raise ProblemError(f"cannot read {text!r:.200} as a scene; name its options: {EXAMPLE}.")
    return written.plain, dict(written.options)


def check_option(scene: str, name: str, value: object) -> object:
    """Return a value converted to the type of a scene's option; scenes of plugins check theirs when they are built.

    Raises:
        ProblemError: for an unknown option, or a value out of range.
    """
    if scene not in SCENES:
        return value
    options = SCENES[scene].options
    check_options(f"the scene {scene!r}", [name], options, ProblemError)
    return options[name].checked(name, value)
