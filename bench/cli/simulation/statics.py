"""The command ``proxbench statics``."""

from functools import partial
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import options

if TYPE_CHECKING:
    from ....problems.arrays import FloatArray
    from ....problems.contact.problem import ContactProblem
    from ....problems.motion.scenes.scene import Scene

MIN_PUSH = 1e-9
"""Largest push, relative to the weight, that is printed as no push."""

MARGIN_HINT = "if the bodies should touch, close small gaps with --margin METRES"
"""Remedy for a scene without closed contacts."""

_loads = partial(typer.Option, rich_help_panel="Loads and contacts")


def statics(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help='Like "stack(friction=0.3)".')],
    push: Annotated[str | None, _loads(metavar="X,Y,Z", help="Direction of the largest push; x by default.")] = None,
    margin: Annotated[float, _loads(metavar="METRES", help="Gap below which contacts count as closed.")] = 0.0,
    friction: Annotated[
        bool, options.flag("--friction", help="Find the least friction coefficient, equal at all contacts.")
    ] = False,
    plugin: options.PluginFiles = None,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Check whether the bodies of a scene can stand in its initial state, by a cone program.

    The exit code is 1 if they cannot. The equilibrium of a scene that can stand may still be unstable.
    """
    from ....problems.motion.equilibrium import HasMargin, find_equilibrium, least_friction, problem_at_rest
    from ....problems.motion.mechanism import mechanism_text
    from ...plugins.remote_scene import local_or_remote_scene
    from ...report.layout.text import print_json

    loaded_scene = local_or_remote_scene(scene)
    problem = problem_at_rest(loaded_scene.system, loaded_scene.start, margin)
    equilibrium = find_equilibrium(problem)
    row: dict[str, Any] = {
        "scene": scene,
        "contacts": problem.n_contacts,
        "can_stand": equilibrium.can_stand,
        "imbalance": equilibrium.imbalance,
        "mechanism": "" if equilibrium.can_stand else mechanism_text(problem, equilibrium.mechanism),
    }
    direction = _push_direction(loaded_scene, push)
    if direction is not None:
        row |= _largest_push(problem, *direction)
    if friction:
        coefficient = least_friction(problem)
        row["least_friction"] = coefficient if isfinite(coefficient) else None
    if as_json:
        print_json(row)
    elif not quiet:
        has_no_contacts = not problem.n_contacts and not margin and isinstance(loaded_scene.system, HasMargin)
        print(_sentence(row) + (f"; {MARGIN_HINT}" if has_no_contacts else ""))
    return int(not equilibrium.can_stand)


def _push_direction(scene: "Scene", push: str | None) -> "tuple[FloatArray, FloatArray] | None":
    """Return the direction of the push and the velocities of bodies that move along it.

    Without ``push``, the direction is x, or None if the bodies are neither balls nor rigid bodies.

    Raises:
        BenchError: if ``push`` is not a direction of the scene's dimension, or cannot apply to its bodies.
    """
    import numpy as np  # help must not wait for it

    from ....problems.motion.bodies.balls import BallSystem
    from ...errors import BenchError

    bodies = scene.balls or scene.bodies
    if bodies is None:
        if push is None:
            return None
        raise BenchError(
            f"the bodies of {scene.name} are neither balls nor rigid bodies, so their axes are not known; omit --push."
        )
    dimension = bodies.dimension if isinstance(bodies, BallSystem) else 3
    words = ["1", *["0"] * (dimension - 1)] if push is None else push.split(",")
    try:
        direction = np.array([float(word) for word in words])
    except ValueError:
        direction = np.zeros(0)
    if direction.shape != (dimension,) or not np.isfinite(direction).all() or not direction.any():
        raise BenchError(
            f"--push must be {dimension} numbers, not all zero, like 1{',0' * (dimension - 1)}; got {push!r}."
        )
    return direction, bodies.translation(direction)


def _largest_push(problem: "ContactProblem", direction: "FloatArray", velocity: "FloatArray") -> dict[str, Any]:
    """Return the largest push as JSON values; an infinite one is ``None``."""
    from ....problems.motion.equilibrium import largest_push

    factor = largest_push(problem, velocity).factor
    return {"push": direction.tolist(), "largest_push": factor if isfinite(factor) else None}


def _sentence(row: dict[str, Any]) -> str:
    """Return the result as one sentence without a full stop."""
    if row["can_stand"]:
        parts = ["can stand"]
    else:
        share = f"{100.0 * row['imbalance']:.3g} %"
        parts = [f"cannot stand: bodies accelerate at {share} of the free acceleration", row["mechanism"]]
    if row["can_stand"] and "push" in row:
        direction = ",".join(f"{number:g}" for number in row["push"])
        parts.append(f"it bears {_push_text(row['largest_push'])} along {direction}")
    if "least_friction" in row:
        coefficient = row["least_friction"]
        parts.append(
            "no friction coefficient suffices"
            if coefficient is None
            else f"it needs a friction coefficient of {coefficient:.6g}"
        )
    return f"{row['scene']} {'; '.join(parts)}"


def _push_text(push: float | None) -> str:
    if push is None:
        return "any push"
    return f"a push of up to {push:.4g} of its weight" if push > MIN_PUSH else "no push"
