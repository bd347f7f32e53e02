"""Measure how far joints open and bodies penetrate if a linkage or a chain lies on the ground.

``costs_of_accuracy.py --tables resting`` prints the table.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import cos, sin
from typing import Any

import numpy as np
from proxbench.problems.arrays import FloatArray
from proxbench.problems.motion.bodies.rigid.joints import Joint, RigidJoints
from proxbench.problems.motion.bodies.rigid.orientation import Y_AXIS, about
from proxbench.problems.motion.bodies.rigid.rigid_bodies import FixedBody, RigidBodies
from proxbench.problems.motion.bodies.rigid.shapes import Box, Capsule, HalfSpace, Shape
from proxbench.problems.motion.scenes.effects import Friction, Gravity
from proxbench.problems.motion.scenes.rigid.effects import rigid_bodies
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

STEPS = (10e-3, 5e-3)
"""Δt [s]."""

SECONDS = 10.0
"""Simulated time [s]."""

DEPTH = 1e-5
"""Penetration of contacts at the start of a linkage at rest, and that which the projection leaves [m]."""

STOP = Stop(1e-10, 100_000)


def on_floor(shapes: list[Shape], joints: list[Joint]) -> RigidBodies:
    """Return bodies of 1 kg with these joints on the ground z = 0."""
    effects = (Gravity(), Friction(0.5))
    system = rigid_bodies(shapes, np.ones(len(shapes)), [FixedBody(HalfSpace())], effects)
    return replace(system, joints=RigidJoints(joints, len(shapes)))


def trestle(lean: float = 0.4, length: float = 1.0, width: float = 0.05) -> tuple[RigidBodies, State]:
    """Return two legs that are hinged at their tops and stand on the ground, at rest."""
    top = (0.0, 0.0, 0.5 * length)
    system = on_floor([Box((width, width, length))] * 2, [Joint("revolute", 0, 1, top, top, Y_AXIS)])
    height = 0.5 * length * cos(lean) + 0.5 * width * sin(lean) - DEPTH
    across = 0.5 * length * sin(lean)
    poses = [[-across, 0.0, height, *about(Y_AXIS, lean)], [across, 0.0, height, *about(Y_AXIS, -lean)]]
    return system, State(0.0, np.array(poses).ravel(), np.zeros(12))


def falling_chain(n_links: int = 10, slope: float = 0.3, radius: float = 0.02) -> tuple[RigidBodies, State]:
    """Return capsules on ball joints in a straight line that leans from the ground at ``slope`` [rad], at rest."""
    half = 0.1
    begin, end = (0.0, 0.0, -half), (0.0, 0.0, half)
    joints = [Joint("ball", link, link - 1, begin, end) for link in range(1, n_links)]
    system = on_floor([Capsule(radius, 1.6 * half)] * n_links, joints)
    axis = np.array([cos(slope), 0.0, sin(slope)])
    centres = [[0.0, 0.0, radius - DEPTH] + (0.8 + 2.0 * link) * half * axis for link in range(n_links)]
    turn = about(Y_AXIS, 0.5 * np.pi - slope)
    return system, State(0.0, np.array([[*centre, *turn] for centre in centres]).ravel(), np.zeros(6 * n_links))


def contact_errors(
    system: RigidBodies, start: State, step: float, seconds: float, depth: float | None
) -> dict[str, float]:
    """Return the largest opening [m or rad] and penetration [m], and the movement in the last half of the time [m]."""
    assert isinstance(system.joints, RigidJoints)
    opening = penetration = moved = 0.0
    half: FloatArray | None = None
    for taken in MidpointRule(system, create("Robust"), STOP, step, depth=depth).steps(start, round(seconds / step)):
        poses = system.poses(taken.state.position)
        opening = max(opening, float(np.abs(system.joints.errors_at(poses).residual).max()))
        penetration = max(penetration, -float(system.contacts_within(poses, 0.0).gap.min(initial=0.0)))
        if half is not None:
            moved = max(moved, float(np.abs(poses[:, :3] - half).max()))
        elif taken.state.time >= 0.5 * seconds * (1.0 - 1e-9):
            half = poses[:, :3]
    return {"opening": opening, "penetration": penetration, "moved": moved}


def resting(seconds: float = SECONDS) -> Iterator[dict[str, Any]]:
    """Yield the errors of a trestle and a falling chain for each step, without and with projection."""
    for name, (system, start) in (("two legs", trestle()), ("falling chain", falling_chain())):
        for step in STEPS:
            row: dict[str, Any] = {"scene": name, "step": step}
            for projection, depth in (("without", None), ("with", DEPTH)):
                errors = contact_errors(system, start, step, seconds, depth)
                row |= {f"{error}, {projection}": value for error, value in errors.items()}
            yield row
