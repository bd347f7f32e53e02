"""Recordings of simulations that are stored: bodies and impulses at the states that were kept, curves of all steps."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...problems.arrays import FloatArray
from ...problems.errors import suggestion
from ...problems.motion.bodies.system import System
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.midpoint import step_problem
from ...problems.motion.stepping.step import Step
from ..errors import BenchError
from ..report.layout.text import counted
from .balls import BallRecorder
from .simulation import SMALLEST, CoordinateRecorder, StepRecorder
from .woodpecker import WoodpeckerRecorder

FRAMES = 1000
"""Pictures of one recording: half a minute of film, and less than 100 MB with a thousand balls."""


VIEWS: dict[str, Callable[[Path, bool, int], StepRecorder]] = {"woodpecker": WoodpeckerRecorder}
"""Recordings that draw the bodies of a scene, by the name of its ``view``."""


def scene_recorder(scene: Scene, file: Path, n_steps: int, force: bool = False) -> StepRecorder:
    """Return the recorder of a scene, which draws about ``FRAMES`` of ``n_steps`` steps; curves have all of them.

    Raises:
        BenchError: if the file cannot be written.
    """
    every = max(1, math.ceil(n_steps / FRAMES))
    if scene.view is not None:
        if scene.view not in VIEWS:
            raise BenchError(f"the scene {scene.name!r} has no view {scene.view!r}{suggestion(scene.view, VIEWS)}")
        return VIEWS[scene.view](file, force, every)
    if scene.balls is not None:
        title = f"{scene.name}, {counted(scene.n_balls, 'disc' if scene.balls.dimension == 2 else 'ball')}"
        weight: Any = scene.options.get("gravity")
        gravity = float(weight) if isinstance(weight, int | float) else 0.0
        return BallRecorder(scene.balls, file, title, gravity, force, every, scene.observables, scene.potential_energy)
    return CoordinateRecorder(scene, file, force, every)


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
        scene: what was simulated.
        steps: one row a step: time, iterations, residual, kinetic_energy, potential_energy.
        states: some of the states between them, the first one the start.
        file: the recording, ending in ``.rrd``.
        impulse_seconds: where states hold forces, over which time impulses are drawn [s].
        force: replace a file that exists.

    Raises:
        BenchError: if no step was taken, or the file exists or cannot be written.
    """
    if not len(steps):
        raise BenchError("the simulation has no steps to record; resume it first.")
    times = np.array([scene.start.time, *steps["time"]])
    numbers = np.searchsorted(times, [state.time for state in states])
    drawn = (
        (int(number), step_to(scene.system, state, float(times[number] - times[number - 1]), impulse_seconds))
        for number, state in zip(numbers[1:], states[1:], strict=True)
    )
    with scene_recorder(scene, file, len(steps), force) as recorder:
        recorder.start(states[0])
        recorder.replay(times, _curves(scene, steps, times), drawn)


def _curves(scene: Scene, steps: NDArray[np.void], times: FloatArray) -> dict[str, FloatArray]:
    """Return what is known of all steps, by the name of the curve; nan where nothing is drawn."""
    start = scene.start
    kinetic = np.array([scene.kinetic_energy(start.velocity), *steps["kinetic_energy"]])
    energies = {"energy/kinetic": kinetic}
    if scene.potential_energy is not None:
        potential = np.array([scene.potential_energy(start.position), *steps["potential_energy"]])
        energies |= {"energy/potential": potential, "energy/total": kinetic + potential}
    return {
        "step_size": np.array([np.nan, *np.log10(np.diff(times))]),
        "iterations": np.array([0.0, *steps["iterations"]]),
        "residual": np.array([np.nan, *np.log10(np.maximum(steps["residual"], SMALLEST))]),
        **energies,
    }


def step_to(system: System, state: State, length: float, impulse_seconds: float | None = None) -> Step:
    """Return the step of ``length`` [s] that led to ``state``, as far as the state says: contacts and their impulses.

    The contacts are those at its midpoint, q_E − u_E Δt/2. States of a variable step hold forces in place of impulses,
    of which ``impulse_seconds`` [s] make impulses again.
    """
    midpoint = system.move(state.position, state.velocity, -0.5 * length)
    assembly = system.assemble(midpoint, state.velocity, length)
    contacts = assembly.contacts
    if contacts is None or not len(state.keys):
        return Step(state, None, np.zeros(0), None, None, 0)
    held = np.zeros((len(contacts.keys), contacts.rows_per_contact))
    _, ours, theirs = np.intersect1d(contacts.keys, state.keys, assume_unique=True, return_indices=True)
    held[ours] = state.impulses[theirs] * (1.0 if impulse_seconds is None else impulse_seconds)
    return Step(state, step_problem(assembly, contacts, state.velocity), held.ravel(), contacts, None, 0)
