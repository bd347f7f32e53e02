"""Recordings of stored simulations: bodies and impulses at the stored states, curves of all steps."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...problems.errors import suggestion
from ...problems.motion.bodies.system import System
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.midpoint import step_problem
from ...problems.motion.stepping.step import Step
from ..errors import BenchError
from .bodies.balls import BallRecorder
from .bodies.rigid_bodies import RigidRecorder
from .bodies.woodpecker import WoodpeckerRecorder
from .scene_recorder import CoordinateRecorder, SceneRecorder

FRAMES = 1000
"""Number of drawn steps for which the playback speed is set: at most 17 s, less than 100 MB with a thousand balls."""

VIEWS: dict[str, type[SceneRecorder]] = {"woodpecker": WoodpeckerRecorder}
"""Recorders that draw the bodies of a scene, by the name of its ``view``."""


def scene_recorder(scene: Scene, file: Path, n_steps: int, force: bool = False) -> SceneRecorder:
    """Return the recorder of a scene, with a playback speed for about ``FRAMES`` of ``n_steps`` steps.

    Raises:
        BenchError: if the view of the scene is unknown.
    """
    if scene.view is not None and scene.view not in VIEWS:
        raise BenchError(f"the scene {scene.name!r} has no view {scene.view!r}{suggestion(scene.view, VIEWS)}")
    recorder: type[SceneRecorder]
    if scene.view is not None:
        recorder = VIEWS[scene.view]
    elif scene.bodies is not None:
        recorder = RigidRecorder
    else:
        recorder = CoordinateRecorder if scene.balls is None else BallRecorder
    return recorder(scene, file, force, max(1, math.ceil(n_steps / FRAMES)))


def record_stored(
    scene: Scene,
    steps: NDArray[np.void],
    states: Sequence[State],
    file: Path,
    *,
    impulse_seconds: float | None = None,
    force: bool = False,
) -> None:
    """Write the recording of a simulation.

    Args:
        scene: the simulated scene.
        steps: one row per step, as in ``SceneRecorder.record``.
        states: stored states, beginning with the start.
        file: the recording, ending in ``.rrd``.
        impulse_seconds: time over which forces of states act as impulses [s]; None if the states contain impulses.
        force: replace an existing file.

    Raises:
        BenchError: if no step was taken, or the file exists or cannot be written.
    """
    if not len(steps):
        raise BenchError("the simulation has no steps to record; resume it first.")
    times = np.array([scene.start.time, *steps["time"]])
    step_numbers = np.searchsorted(times, [state.time for state in states])
    drawn = (
        (int(number), step_ending_at(scene.system, state, float(times[number] - times[number - 1]), impulse_seconds))
        for number, state in zip(step_numbers[1:], states[1:], strict=True)
    )
    scene_recorder(scene, file, len(steps), force).record(steps, drawn)


def step_ending_at(system: System, state: State, length: float, impulse_seconds: float | None = None) -> Step:
    """Return the step of ``length`` [s] that ended at ``state``, with the contacts and impulses of the state.

    The contacts are those at its midpoint, q_E − u_E Δt/2, where q_E and u_E are those of ``state``. If
    ``impulse_seconds`` [s] is given, the state contains forces, which are converted to impulses over this time.
    """
    midpoint = system.move(state.position, state.velocity, -0.5 * length)
    assembly = system.assemble(midpoint, state.velocity, length)
    contacts = assembly.contacts
    if contacts is None or not len(state.keys):
        return Step(state, None, np.zeros(0), None, None, 0)
    impulses = np.zeros((len(contacts.keys), contacts.width))
    _, in_contacts, in_state = np.intersect1d(contacts.keys, state.keys, assume_unique=True, return_indices=True)
    impulses[in_contacts] = state.impulses[in_state] * (1.0 if impulse_seconds is None else impulse_seconds)
    return Step(state, step_problem(assembly, contacts, state.velocity), contacts.rows(impulses), contacts, None, 0)
