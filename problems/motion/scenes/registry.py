"""The list of scenes, and how a name with options becomes one that can be simulated.

A scene of another kind is one more entry of ``SCENES``, a ``SceneKind`` from the file of the scene.
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
