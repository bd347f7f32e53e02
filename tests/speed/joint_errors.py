"""Measure how far joints open, and the energy error, with and without closing them at the end of each step.

``costs_of_accuracy.py --tables joints swing linkages`` prints the tables.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from proxbench.problems.motion.bodies.rigid.joints import RigidJoints
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.linkages import DEPTH
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

SCENES = ("pendulum", "chain", "four_bar")
STEPS = (20e-3, 10e-3)
"""Δt [s]."""

SECONDS = 10.0
"""Simulated time [s]."""

SWINGS = (("chain", 10e-3), ("chain", 2e-3), ("ball_on_chain", 0.47e-3))
"""Scenes with a chain, and Δt [s]."""

STOP = Stop(1e-10, 100_000)

COUNTS = (1000, 10_000, 100_000)
"""Numbers of steps after which the energy of linkages is compared."""


def joints(seconds: float = SECONDS) -> Iterator[dict[str, Any]]:
    """Yield the largest errors of each scene for each step, without and with projection."""
    for name in SCENES:
        for step in STEPS:
            without, closed = (joint_errors(name, step, seconds, depth) for depth in (None, DEPTH))
            row: dict[str, Any] = {"scene": name, "step": step}
            for error in without:
                row |= {f"{error}, without": without[error], f"{error}, with": closed[error]}
            yield row


def swing(seconds: float = SECONDS) -> Iterator[dict[str, Any]]:
    """Yield the largest errors of a chain, and of a heavy ball on it, without and with projection."""
    for name, step in SWINGS:
        for projection, depth in (("without", None), ("with", DEPTH)):
            began = time.process_time()
            errors = joint_errors(name, step, seconds, depth)
            taken = time.process_time() - began
            yield {"scene": name, "step": step, "projection": projection, **errors, "seconds": taken}


def linkages(counts: tuple[int, ...] = COUNTS, step: float = 1e-3) -> Iterator[dict[str, Any]]:
    """Yield the largest error of the energy, relative to the largest kinetic one, up to several numbers of steps."""
    for name in ("pendulum", "four_bar"):
        for projection, depth in (("without", None), ("with", DEPTH)):
            found = {f"{count} steps": joint_errors(name, step, count * step, depth)["energy"] for count in counts}
            yield {"scene": name, "projection": projection, **found}


def joint_errors(name: str, step: float, seconds: float, depth: float | None) -> dict[str, float]:
    """Return the largest opening [m or rad], |Wᵀu| [m/s or rad/s], and error of the energy over the kinetic one."""
    scene = make_scene(name)
    system = scene.system
    assert isinstance(system, RigidBodies)
    assert isinstance(system.joints, RigidJoints)
    assert scene.potential_energy is not None
    opening = speed = error = kinetic = 0.0
    begin = scene.kinetic_energy(scene.start.velocity) + scene.potential_energy(scene.start.position)
    for taken in MidpointRule(system, create("Robust"), STOP, step, depth=depth).steps(
        scene.start, round(seconds / step)
    ):
        poses, velocity = system.poses(taken.state.position), taken.state.velocity
        errors = system.joints.errors_at(poses)
        opening = max(opening, float(np.abs(errors.residual).max()))
        speed = max(speed, float(np.abs(errors.directions.T @ velocity).max()))
        moving = scene.kinetic_energy(velocity)
        error = max(error, abs(moving + scene.potential_energy(taken.state.position) - begin))
        kinetic = max(kinetic, moving)
    return {"opening": opening, "|Wᵀu|": speed, "energy": error / kinetic}
