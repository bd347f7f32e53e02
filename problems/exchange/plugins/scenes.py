"""Scenes that plugins offer: functions with keyword options that return a scene, or a system with its initial state."""

import inspect
import sys
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from typing import Any

from ...errors import PluginError, ProblemError, first_line, raised_at, suggestion
from ...motion.scenes.registry import SCENES, parse_scene
from ...motion.scenes.scene import Scene, bare_scene, completed
from ...motion.state import State
from ...names import check_options
from .offers import Offer, offers


def plugin_scenes() -> list[Offer]:
    """Return the scenes that plugins offer, including rejected ones with the reason."""
    return offers("scene", SCENES)


def plugin_scene(name: str) -> Offer | None:
    """Return the offer of a scene by its plain name; None for a scene of Proxbench.

    Raises:
        ProblemError: if the scene is unknown; the message suggests the nearest name.
        PluginError: if the name is rejected.
    """
    if name in SCENES:
        return None
    candidates = plugin_scenes()
    for offer in candidates:
        if offer.name == name and offer.rejection:
            raise PluginError(offer.rejection)
        if offer.name == name:
            return offer
    known = [*SCENES, *(offer.name for offer in candidates)]
    raise ProblemError(f"there is no scene {name!r}{suggestion(name, known, 'proxbench list scenes')}")


def build_plugin_scene(text: str, options: Mapping[str, Any]) -> Scene:
    """Return a scene of a plugin; this runs the plugin.

    Args:
        text: name of the scene, with or without options.
        options: further options.

    Raises:
        ProblemError: if the scene or an option is unknown.
        PluginError: if the plugin does not return a scene.
    """
    name, inline_options = parse_scene(text)
    offer = plugin_scene(name)
    assert offer is not None
    make, head = offer.load(), f"scene {name!r} of {offer.source}"
    defaults = scene_options(make, head)
    all_options = {**inline_options, **options}
    check_options(f"the scene {name!r}", all_options, defaults, ProblemError)
    try:
        with redirect_stdout(sys.stderr):
            result = make(**all_options)
    except ProblemError:
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{head} cannot be built: {first_line(error)}{raised_at(error)}.") from error
    return _scene(name, {**defaults, **all_options}, result, head)


def scene_options(make: Callable[..., Any], head: str) -> dict[str, Any]:
    """Return the options of a function that makes a scene, with their defaults.

    Raises:
        PluginError: if an option has no default; ``head`` begins the message.
    """
    parameters = inspect.signature(make).parameters.values()
    for parameter in parameters:
        if parameter.default is inspect.Parameter.empty or parameter.kind is inspect.Parameter.POSITIONAL_ONLY:
            raise PluginError(f"{head} takes {parameter.name!r} without a default; every option must have one.")
    return {parameter.name: parameter.default for parameter in parameters}


def _scene(name: str, options: Mapping[str, Any], result: Any, head: str) -> Scene:
    if isinstance(result, Scene):
        return completed(replace(result, name=name, options=options))
    if not (isinstance(result, tuple) and len(result) == 2 and isinstance(result[1], State)):
        raise PluginError(f"{head} must return a Scene, or a system and its first State, got {type(result).__name__}.")
    return bare_scene(name, options, *result)
