"""Scenes of a plugin: a tower of balls, a faulty tower, a block given by functions, and wrapped built-in scenes."""

import os
import time
from dataclasses import replace
from typing import Any

import numpy as np
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.rigid.joints import WORLD, Joint
from proxbench.problems.motion.bodies.rigid.shapes import Box
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.bodies.system import MechanicalSystem, System
from proxbench.problems.motion.scenes.effects import Friction, Gravity, ball_system
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.linkages import jointed_bodies
from proxbench.problems.motion.scenes.scene import Scene, bare_scene
from proxbench.problems.motion.state import State

FAULTY_FROM = 60
"""The call from which a faulty tower fails."""


def tower(balls: int = 4, friction: float = 0.3) -> tuple[BallSystem, State]:
    ground = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    system = ball_system(np.full(balls, 0.1), np.ones(balls), [ground], [Gravity(), Friction(friction)])
    centres = np.zeros((balls, 3))
    centres[:, 2] = 0.11 + 0.205 * np.arange(balls)
    return system, State(0.0, centres.ravel(), system.without_spin(np.zeros((balls, 3))))


class Faulty:
    """A system with one of several faults."""

    def __init__(self, system: BallSystem, fault: str) -> None:
        self._system, self._fault, self._calls = system, fault, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._system, name)

    def assemble(self, *arguments: Any) -> Any:
        self._calls += 1
        if self._calls > FAULTY_FROM:
            faults = {"raise": self._raise, "exit": lambda: os._exit(3), "hang": lambda: time.sleep(1000), "eat": _eat}
            faults[self._fault]()
        return self._system.assemble(*arguments)

    def _raise(self) -> None:
        raise RuntimeError("oh no")


def _eat() -> None:
    np.ones(10**10)


def faulty(fault: str = "raise") -> tuple[System, State]:
    system, start = tower(2)
    return Faulty(system, fault), start


def block(mass: float = 1.0) -> tuple[MechanicalSystem, State]:
    masses, weight = mass * np.eye(2), np.array([0.0, -9.81 * mass])
    directions = np.array([[0.0, 1.0], [1.0, 0.0]])
    system = MechanicalSystem(
        mass=lambda position: masses,
        force=lambda position, velocity: weight,
        gap=lambda position: position[1:],
        directions=lambda position: directions,
        friction=[0.5],
        restitution_normal=[0.5],
        restitution_tangential=[0.0],
        is_reversible=True,
    )
    return system, State(0.0, np.array([0.0, 0.05]), np.array([1.0, 0.0]))


def coupled() -> tuple[MechanicalSystem, State]:
    """Two blocks on a slope, one behind the other on a rod; only the first has friction."""
    masses, columns = (
        np.diag([1.0, 1.0, 3.0, 3.0]),
        np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [1, 0, -1, 0]]).T,
    )
    weight = 9.81 * np.diag(masses) * np.tile([0.56, -0.83], 2)
    system = MechanicalSystem(
        mass=lambda position: masses,
        force=lambda position, velocity: weight,
        gap=lambda position: position[1::2],
        directions=lambda position: columns,
        friction=[0.5, 0.0],
        restitution_normal=[0.0, 0.0],
        restitution_tangential=[0.0, 0.0],
        rows_per_contact=[2, 1],
        joint_rows=[1],
    )
    return system, State(0.0, np.array([1.0, -1e-9, 0.0, -1e-9]), np.zeros(4))


def wiper(speed: float = 2.0) -> Scene:
    """A rod that a motor swings from its hinge at the ceiling to a limit, with its hinge closed at each step."""
    half = 0.25
    hinge = Joint(
        "revolute",
        0,
        WORLD,
        (0.0, 0.0, half),
        axis=(0.0, 1.0, 0.0),
        limits=(-1.0, 0.3),
        motor_speed=speed,
        motor_bound=9.0,
    )
    system = jointed_bodies([Box((0.05, 0.05, 2.0 * half))], np.ones(1), [hinge], gravity=9.81)
    start = State(0.0, np.array([0.0, 0.0, -half, 1.0, 0.0, 0.0, 0.0]), np.zeros(6))
    return replace(bare_scene("wiper", {"speed": speed}, system, start), depth=1e-6)


def broken(what: str = "flat") -> Scene:
    """A wiper of a flat rod, or one whose hinge is open."""
    if what == "flat":
        Box((0.1, 0.1, 0.0))
    scene = wiper()
    raised = np.add(scene.start.position, [0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    return replace(scene, start=replace(scene.start, position=raised))


def driven() -> Scene:
    """A wiper that declares a body as driven that it does not have."""
    return replace(wiper(), name="driven", driven_bodies=(7,))


def twin(balls: int = 20) -> Scene:
    return make_scene("funnel", {"balls": balls})


def bouncing() -> Scene:
    return make_scene("bouncing_ball")


def needy(balls: int) -> Scene:
    return twin(balls)


def nothing() -> str:
    return "no scene"


SCENES = {
    "tower": tower,
    "faulty": faulty,
    "block": block,
    "coupled": coupled,
    "wiper": wiper,
    "broken": broken,
    "driven": driven,
    "twin": twin,
    "bouncing": bouncing,
    "needy": needy,
    "nothing": nothing,
}
