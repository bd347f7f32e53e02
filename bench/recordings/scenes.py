"""The recorder that suits a scene."""

import math
from pathlib import Path

from ...problems.mechanics.balls import BallSystem
from ...problems.scenes.registry import Scene
from ..errors import BenchError
from .balls import BallRecorder
from .simulation import StepRecorder
from .woodpecker import WoodpeckerRecorder

FRAMES = 1000
"""Pictures of one recording: half a minute of film, and less than 100 MB with a thousand balls."""


def scene_recorder(scene: Scene, file: Path, n_steps: int, force: bool = False) -> StepRecorder:
    """Return the recorder of a scene, which draws about ``FRAMES`` of ``n_steps`` steps; curves have all of them.

    Raises:
        BenchError: if the scene cannot be drawn, or the file cannot be written.
    """
    every = max(1, math.ceil(n_steps / FRAMES))
    if scene.name == "woodpecker":
        return WoodpeckerRecorder(file, force, every)
    if isinstance(scene.system, BallSystem):
        options = scene.options
        title = f"{scene.name}, {options['balls']} {'discs' if options['planar'] else 'balls'}"
        gravity = float(options["gravity"] or 0.0)
        return BallRecorder(scene.system, file, title, gravity, force, every, scene.balls_through)
    raise BenchError(f"there is no recorder for the scene {scene.name!r}; leave --record out.")
