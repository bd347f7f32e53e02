"""One run of a scene in an engine: the time of its steps, the errors of its motion, and residuals of some steps.

As a program, ``python -m proxbench.bench.measure.trajectories.engines.measurement SCENE ENGINE SETTING`` measures one
run and prints it as the last line of its output.
"""

import math
import os
import sys
import time
from collections.abc import Sequence

import msgspec
import numpy as np

from .....problems.contact.judge import judge
from .description import BodyStates, Description, Motion
from .engine import ENGINES, Engine, build
from .scenes import describe
from .solved_problem import SolvedProblem

JUDGED_FRAMES = 10
"""Number of frames of a run whose first step is judged."""

ACCURATE_RESIDUAL = 1e-8
"""Residual to which Proxbench solves the problems of an engine again."""

MAX_BODIES_SOLVED_AGAIN = 10
"""Largest number of bodies in scenes whose problems are solved again; hundreds of balls would take longer than the
motion."""


class Measurement(msgspec.Struct, frozen=True, kw_only=True):
    """A run, as it is stored.

    Attributes:
        scene: name of the scene.
        engine: name of the engine.
        setting: name of the setting.
        time_step: time step [s].
        wall_seconds: wall time of the steps per simulated second, 0 if the run failed.
        processor_seconds: processor time of the steps per simulated second, 0 if the run failed.
        errors: errors by name, in the order of the scene.
        own_residual: largest residual of the judged steps under the engine's own model, None if it publishes none.
        residual: largest judged residual of the judged steps under Coulomb's law, None if impulses are unknown.
        solved_residual: largest residual of Proxbench's solver ``Robust`` on the same problems; None for many bodies.
        failure: why the run has no measurement; empty if it has one.
    """

    scene: str
    engine: str
    setting: str
    time_step: float
    wall_seconds: float = 0.0
    processor_seconds: float = 0.0
    errors: dict[str, float] = {}
    own_residual: float | None = None
    residual: float | None = None
    solved_residual: float | None = None
    failure: str = ""


def measure(
    description: Description, engine: Engine, time_step: float
) -> tuple[Motion, float, float, list[SolvedProblem]]:
    """Step an engine through a scene.

    Returns:
        The motion; wall and processor time of all steps [s]; the problems of at most ``JUDGED_FRAMES`` steps, those
        with contacts.
    """
    per_frame = round(description.frame / time_step)
    n_frames = round(description.duration / description.frame)
    judged = set(np.linspace(n_frames // JUDGED_FRAMES, n_frames - 1, JUDGED_FRAMES).astype(int).tolist())
    frames, solved = [engine.states()], []
    wall = processor = 0.0
    for frame in range(n_frames):
        if frame in judged:
            engine.store_state()
        for count in (1, per_frame - 1):
            began, began_processor = time.perf_counter(), time.process_time()
            for _ in range(count):
                engine.step()
            wall += time.perf_counter() - began
            processor += time.process_time() - began_processor
            if count == 1 and frame in judged:
                problem = engine.solved_problem()
                solved += [problem] if problem is not None else []
        frames.append(engine.states())
    times = description.frame * np.arange(n_frames + 1)
    return motion_of(times, frames), wall, processor, solved


def motion_of(times: Sequence[float] | np.ndarray, frames: Sequence[BodyStates]) -> Motion:
    """Return frames as one motion."""
    arrays = (np.array([getattr(frame, name) for frame in frames]) for name in ("positions", "velocities", "spins"))
    return Motion(np.asarray(times), *arrays)


def measure_setting(scene: str, engine: str, setting: str) -> Measurement:
    """Measure one run in this process, given the names of its scene, engine and setting."""
    description = describe(scene)
    engine_setting = next(known for known in ENGINES[engine].settings if known.name == setting)
    time_step = description.step * engine_setting.step_factor
    motion, wall, processor, solved = measure(description, build(engine, description, engine_setting), time_step)
    errors = description.measure(description, motion) if np.isfinite(motion.positions).all() else ()
    solved_again = solved if len(description.bodies) <= MAX_BODIES_SOLVED_AGAIN else []
    return Measurement(
        scene=scene,
        engine=engine,
        setting=setting,
        time_step=time_step,
        wall_seconds=wall / description.duration,
        processor_seconds=processor / description.duration,
        errors=dict(zip(description.errors, map(float, errors), strict=bool(errors))),
        own_residual=max((step.own_residual for step in solved if step.own_residual is not None), default=None),
        residual=max((judge(step.problem, step.impulses).residual for step in solved), default=None),
        solved_residual=max(map(_residual_of_robust, solved_again), default=None),
        failure="" if errors else "the motion is not finite",
    )


def _residual_of_robust(solved: SolvedProblem) -> float:
    """Return the judged residual to which ``Robust`` solves a problem."""
    from .....problems.contact.solver import Stop
    from .....solvers.registry import create

    solution = create("Robust").prepare(solved.problem).solve(Stop(ACCURATE_RESIDUAL, 10_000, math.inf))
    return judge(solved.problem, solution.impulses).residual


def stay_on_one_core() -> None:
    """Restrict this process to one core, if possible; otherwise threads that exchange work wait for each other."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


if __name__ == "__main__":
    stay_on_one_core()
    print(msgspec.json.encode(measure_setting(*sys.argv[1:])).decode())
