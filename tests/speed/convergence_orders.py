"""Measure the order of convergence of the midpoint rule in the scenes of rigid bodies that have a closed form.

Each scene is simulated to the same time with steps that are halved, and its end is compared with the closed form. A
scene is *exact* if only the error of the solver remains. ``costs_of_accuracy.py --tables orders free`` prints the
orders as a table, and the energy and momentum of free bodies over 10⁵ steps.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from proxbench.problems.arrays import FloatArray
from proxbench.problems.motion.bodies.rigid.orientation import Y_AXIS, about, rotation_matrices
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.bodies.rigid.shapes import Box
from proxbench.problems.motion.scenes.rigid.boxes import BoxOnIncline, ThrownBox, TippingBox
from proxbench.problems.motion.scenes.rigid.linkages import (
    BallOnChain,
    Chain,
    FourBar,
    Pendulum,
    rod_direction,
    swing_modes,
)
from proxbench.problems.motion.scenes.rigid.rolling import RollingCylinder, RollingSphere
from proxbench.problems.motion.scenes.rigid.spinning_top import SpinningTop
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create
from scipy.integrate import solve_ivp

STOP = Stop(1e-10, 100_000)
EXACT = 1e-9
"""Remaining error [SI units] of a solver with a tolerance of 1e-10."""

AMPLITUDE = 1e-5
"""Largest angle [rad] of a normal mode. The error of the linear theory is 2e5 times its square where a heavy ball hangs
on the chain, which does not follow the fall of its rods."""

N_FREE_STEPS = 100_000


@dataclass(frozen=True)
class Case:
    """A scene with a closed form.

    Attributes:
        name: name of the scene and of the compared quantity.
        system: the mechanical system.
        start: its first state.
        seconds: simulated time [s].
        count: number of the longest steps.
        error: function that returns the error of the last state.
        order: the expected order; infinite where the rule is exact.
        depth: depth that the projection allows [m]; None without projection.
    """

    name: str
    system: RigidBodies
    start: State
    seconds: float
    count: int
    error: Callable[[State], float]
    order: float
    depth: float | None = None

    def errors(self, n_halvings: int = 2) -> list[float]:
        """Return the errors with steps that are halved ``n_halvings`` times."""
        errors = []
        for halving in range(n_halvings + 1):
            count = self.count * 2**halving
            rule = MidpointRule(self.system, create("Robust"), STOP, self.seconds / count, depth=self.depth)
            for step in rule.steps(self.start, count):
                assert step.status in (None, Status.SOLVED), f"{self.name}: a step is not solved"
            errors.append(self.error(step.state))
        return errors


def _case(name: str, scene: Any, seconds: float, count: int, order: float) -> Case:
    """Return a case of a scene whose whole state is known."""
    exact, depth = scene.exact(seconds), getattr(scene, "depth", None)

    def error(end: State) -> float:
        return float(max(np.abs(end.position - exact.position).max(), np.abs(end.velocity - exact.velocity).max()))

    return Case(name, scene.system(), scene.start(), seconds, count, error, order, depth)


def _stopping(name: str, scene: Any, stop_time: float) -> Case:
    """Return a case of a body that stops after 2/3 of the time, at 1/3 or 2/3 of a step for any number of steps."""
    return _case(name, scene, 1.5 * stop_time, 25, 2.0)


def _tipping() -> Case:
    """Return the box that turns about its edge by θ̈ = 3 g/(4 R) sin(lean + θ).

    Its error is a Δt + b Δt²: half a step by which the directions at the edge are late, and the error of the midpoint
    rule, which is the larger one above 0.8 ms. Steps are therefore shorter.
    """
    scene, seconds = TippingBox(), 0.2
    rate = 0.75 * scene.gravity / scene.arm
    angles = solve_ivp(
        lambda _, q: [q[1], rate * np.sin(scene.lean + q[0])], (0.0, seconds), [0.0, 0.0], rtol=1e-12, atol=1e-14
    )
    tilt = float(angles.y[0, -1])
    return Case(
        "tipping_box", scene.system(), scene.start(), seconds, 1600, lambda end: abs(scene.tilt(end) - tilt), 1.0
    )


def _swinging(name: str, scene: Any, angles: Callable[[float], State], seconds: float) -> Case:
    """Return a chain in a normal mode after 1/4 or 3/4 of a period, when all its angles are zero."""
    start, exact = angles(1.0), angles(0.0)
    return Case(
        name,
        scene.system(),
        start,
        seconds,
        16,
        lambda end: float(np.abs(end.position - exact.position).max()),
        2.0,
        scene.depth,
    )


def _chain() -> Case:
    """Return a chain in its second normal mode, after 3/4 of a period."""
    scene = Chain(n_links=3)
    frequencies, modes = scene.normal_modes()
    mode = AMPLITUDE * modes[:, 1] / np.abs(modes[:, 1]).max()
    return _swinging("chain", scene, lambda part: scene.state(part * mode), 1.5 * np.pi / frequencies[1])


def _ball_on_chain() -> Case:
    """Return a ball 10⁴ times as heavy as a rod, whose rods swing across its pull with their highest frequency."""
    scene = BallOnChain(n_links=3)
    system, links = scene.system(), scene.n_links
    lengths = np.full(links + 1, scene.length)
    offsets = np.append(0.5 * lengths[:-1], scene.radius)
    frequencies, modes = swing_modes(lengths, offsets, system.masses, system.moments[:, 1], scene.gravity)
    mode = AMPLITUDE * modes[:, -1] / np.abs(modes[:, -1]).max()

    def state(part: float) -> State:
        rods, ball = part * mode[:-1], float(part * mode[-1])
        end = scene.length * np.sum([rod_direction(angle) for angle in rods.tolist()], axis=0)
        pose = np.concatenate([end + scene.radius * rod_direction(ball), about(Y_AXIS, ball)])
        return State(0.0, np.concatenate([scene.chain.state(rods).position, pose]), np.zeros(6 * (links + 1)))

    return _swinging("ball_on_chain", scene, state, 1.5 * np.pi / frequencies[-1])


def _top(friction: float | None, order: float) -> Case:
    """Return the spinning top, on its tip with friction or on a joint without it, whose axis is compared."""
    scene, seconds = SpinningTop(friction=friction), 0.2
    exact = scene.axis_of(scene.exact(seconds))
    where = "spinning_top, on its tip" if friction else "spinning_top, on a joint"
    return Case(
        where,
        scene.system(),
        scene.start(),
        seconds,
        50,
        lambda end: float(np.linalg.norm(scene.axis_of(end) - exact)),
        order,
        scene.depth,
    )


def cases() -> Iterator[Case]:
    """Yield all scenes with a closed form."""
    yield _case("box_on_incline", BoxOnIncline(speed=1.0), 0.4, 10, np.inf)
    yield _case("thrown_box, sliding", ThrownBox(), 1.0, 10, np.inf)
    thrown = ThrownBox()
    yield _stopping("thrown_box, stopped", thrown, thrown.speed / (thrown.friction * thrown.gravity))
    yield _stopping("rolling_sphere, stopped", RollingSphere(), RollingSphere().stop_time)
    yield _stopping("rolling_cylinder, stopped", RollingCylinder(), RollingCylinder().stop_time)
    yield _tipping()
    yield _top(None, 2.0)
    yield _top(0.3, 1.0)
    yield _case("pendulum", Pendulum(), 0.5, 25, 2.0)
    yield _chain()
    yield _case("four_bar", FourBar(), 0.4, 40, 2.0)
    yield _ball_on_chain()


def orders() -> Iterator[dict[str, Any]]:
    """Yield the errors and the order of each scene."""
    for case in cases():
        errors = case.errors()
        order = "exact" if max(errors) <= EXACT else f"{np.log2(errors[-2] / errors[-1]):.2f}"
        row = {"scene": case.name, "step": case.seconds / case.count}
        yield row | {f"error, step/{2**k}": error for k, error in enumerate(errors)} | {"order": order}


def free(count: int = N_FREE_STEPS) -> Iterator[dict[str, Any]]:
    """Yield the largest relative errors of energy and angular momentum of free bodies, at every hundredth step."""
    twists = {
        "flies without turning": [1.0, 2.0, 3.0, 0.0, 0.0, 0.0],
        "turns about its longest axis": [0.0, 0.0, 0.0, 5.0, 0.01, 0.01],
        "tumbles": [1.0, 0.0, 0.0, 0.01, 10.0, 0.01],
    }
    n = len(twists)
    system = RigidBodies([Box((0.3, 0.2, 0.1))] * n, np.ones(n), is_gyroscopic=True)
    poses = np.column_stack([np.zeros((n, 2)), 1e4 * np.arange(n), np.ones(n), np.zeros((n, 3))])
    start = State(0.0, poses.ravel(), np.concatenate([*twists.values()]))

    def kept(state: State) -> FloatArray:
        """Return energy, momentum, |Jω| and angular momentum in space of each body, shape (n, 8)."""
        u, turns = system.twists(state.velocity), rotation_matrices(system.poses(state.position)[:, 3:])
        own = system.moments * u[:, 3:]
        energy = 0.5 * ((u[:, :3] ** 2).sum(axis=1) + (own * u[:, 3:]).sum(axis=1))
        spatial = np.einsum("nij,nj->ni", turns, own)
        return np.column_stack([energy, u[:, :3], np.linalg.norm(own, axis=1), spatial])

    begin = kept(start)
    scales = np.column_stack([begin[:, 0], np.ones((n, 3)), *[np.maximum(begin[:, 4], 1e-300)] * 4])
    largest = np.zeros_like(begin)
    for number, step in enumerate(MidpointRule(system, create("Robust"), STOP, 1e-3).steps(start, count)):
        if number % 100 == 99:
            largest = np.maximum(largest, np.abs(kept(step.state) - begin) / scales)
    for name, errors in zip(twists, largest, strict=True):
        found = {"energy": errors[0], "momentum": errors[1:4].max(), "|Jω|": errors[4]}
        yield {"free body": name, "steps": count, **found, "angular momentum in space": errors[5:].max()}
