"""Compare the cost of engines at equal penetration in a pour of thousands of balls.

``python tests/speed/engines_at_scale.py --balls 1000 4000`` (with ``pip install ".[engines]"``) lets Proxbench pour the
balls for ``--start`` seconds. From that state, with all spins set to zero, each setting of each engine simulates
``RELAXATION`` seconds for its own penetration to develop, and then ``--seconds``, which are timed. Engines take turns
after each frame of 10 ms, in one process on one core, so that other load hits all alike.

The first table shows each setting: the deepest overlap of two balls over the timed frames, its median, the descent of
the centre of mass, and wall and processor time per simulated second. The second one shows, for several overlaps, the
cheapest setting of each engine that stays below it, and its processor time over that of Proxbench.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from proxbench.bench.measure.trajectories.engines.description import BodyStates, Description, Setting
from proxbench.bench.measure.trajectories.engines.engine import Engine, build
from proxbench.bench.measure.trajectories.engines.measurement import stay_on_one_core
from proxbench.bench.measure.trajectories.engines.scenes import deepest_overlap, pour
from proxbench.problems.motion.scenes.funnel import RADIUS, Funnel
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create
from threadpoolctl import threadpool_limits

RELAXATION = 0.05
"""Simulated time before the measurement [s]."""

CG = {"solver": "CG", "stiff": True}
RIGID = {"maximal_coordinates": True, "island_size": 1024}
ELLIPTIC = CG | {"cone": "elliptic", "impratio": 10}


def at_steps(name: str, milliseconds: Sequence[float], **options: Any) -> list[Setting]:
    """Return a setting for each step; its factor is Δt [s], since the description has a step of 1 s."""
    return [Setting(f"{name}, {step:g} ms", 1e-3 * step, options) for step in milliseconds]


SETTINGS = {
    "mujoco": [
        *at_steps("CG, elliptic", (0.25, 0.5, 1.0, 2.0), **ELLIPTIC),
        *at_steps("CG, elliptic, tolerance 1e-4", (0.5, 1.0), tolerance=1e-4, **ELLIPTIC),
        *at_steps("CG, elliptic, 10 iterations", (0.5, 1.0), iterations=10, **ELLIPTIC),
        *at_steps("CG, pyramidal", (0.5, 1.0, 2.0), **CG),
    ],
    "pybullet": [
        *at_steps("10 iterations", (0.25, 0.5, 1.0), iterations=10, **RIGID),
        *at_steps("50 iterations", (0.25, 0.5, 1.0), iterations=50, **RIGID),
        *at_steps("multibodies, 10 iterations", (1.0,), iterations=10),
    ],
    "proxbench": [
        *at_steps("1e-2", (0.5, 1.0, 2.0), tolerance=1e-2),
        *at_steps("1e-4", (0.5, 1.0, 2.0), tolerance=1e-4),
        *at_steps("1e-2, depth 0.005 r", (1.0,), tolerance=1e-2, depth=0.005),
    ],
}
"""Settings of each engine."""

LEVELS = (0.01, 0.025, 0.05, 0.1, 0.2)
"""Overlaps [radii] at which engines are compared."""

SOLVER, STOP = "MomentumFallback", {"max_iterations": 500, "max_seconds": 60.0}


class OwnPour:
    """A pour in Proxbench from a given state."""

    def __init__(self, balls: int, state: State, time_step: float, tolerance: float, depth: float = 0.02) -> None:
        system = make_scene(f"funnel(balls={balls}, restitution=0.0)").system
        stop = Stop(tolerance, **STOP)
        rule = MidpointRule(system, create(SOLVER), stop, time_step, depth=depth * RADIUS)
        self.state, self._steps = state, rule.steps(state, 10**9)

    def step(self) -> None:
        """Advance by one step."""
        self.state = next(self._steps).state

    def states(self) -> BodyStates:
        """Return the states of all balls."""
        velocity = self.state.velocity.reshape(-1, 6)
        return BodyStates(self.state.position.reshape(-1, 3), velocity[:, :3], velocity[:, 3:])


@dataclass
class Measured:
    """A setting that is measured, with its times per frame [s] and the overlaps after each frame [radii]."""

    engine: str
    setting: Setting
    run: Engine | OwnPour
    first_height: float = 0.0
    wall: float = 0.0
    processor: float = 0.0
    overlaps: list[float] = field(default_factory=list)
    descent: float = 0.0

    def advance(self, scene: Description, is_timed: bool) -> None:
        """Simulate one frame."""
        steps = round(scene.frame / self.setting.step_factor)
        began, began_processor = time.perf_counter(), time.process_time()
        for _ in range(steps):
            self.run.step()
        wall, processor = time.perf_counter() - began, time.process_time() - began_processor
        positions = self.run.states().positions
        if is_timed:
            self.wall += wall
            self.processor += processor
            self.overlaps.append(deepest_overlap(scene, positions))
            self.descent = self.first_height - float(positions[:, 2].mean())
        else:
            self.first_height = float(positions[:, 2].mean())


def poured(balls: int, seconds: float) -> State:
    """Return the state of a pour after ``seconds``, without spins and impulses."""
    start = Funnel(balls).start()
    own = OwnPour(balls, start, 1e-3, 1e-3)
    for _ in range(round(seconds / 1e-3)):
        own.step()
    velocity = own.state.velocity.reshape(-1, 6).copy()
    velocity[:, 3:] = 0.0
    return State(0.0, own.state.position, velocity.ravel())


def description(balls: int, state: State) -> Description:
    """Return the scene that begins at a state."""
    scene = pour(balls)
    places, speeds = state.position.reshape(-1, 3).tolist(), state.velocity.reshape(-1, 6)[:, :3].tolist()
    bodies = tuple(
        replace(body, position=tuple(place), velocity=tuple(speed))
        for body, place, speed in zip(scene.bodies, places, speeds, strict=True)
    )
    return replace(scene, bodies=bodies, step=1.0)


def measure(balls: int, start: float, seconds: float, engines: Sequence[str]) -> list[Measured]:
    """Return all settings after the simulation."""
    state = poured(balls, start)
    scene = description(balls, state)
    measured = []
    for engine in engines:
        for setting in SETTINGS[engine]:
            if engine == "proxbench":
                run: Engine | OwnPour = OwnPour(balls, state, setting.step_factor, **setting.options)
            else:
                run = build(engine, scene, setting)
            measured.append(Measured(engine, setting, run))
    relaxing = round(RELAXATION / scene.frame)
    for frame in range(relaxing + round(seconds / scene.frame)):
        for one in measured:
            one.advance(scene, frame >= relaxing)
    return measured


def print_tables(balls: int, measured: Sequence[Measured], seconds: float) -> None:
    """Print both tables in Markdown."""
    print(
        f"\n{balls} balls\n\n| engine | setting | overlap [r] | median | descent [mm] | wall [s/s] | processor [s/s] |"
    )
    print("|" + " --- |" * 7)
    for one in measured:
        cells = [one.engine, one.setting.name, f"{max(one.overlaps):.3f}", f"{np.median(one.overlaps):.3f}"]
        cells += [f"{1e3 * one.descent:.1f}", f"{one.wall / seconds:.2f}", f"{one.processor / seconds:.2f}"]
        print(f"| {' | '.join(cells)} |")
    print("\n| overlap below [r] | engine | cheapest setting | processor [s/s] | over Proxbench |\n|" + " --- |" * 5)
    for level in LEVELS:
        best = {
            engine: min(
                (one for one in measured if one.engine == engine and max(one.overlaps) <= level),
                key=lambda one: one.processor,
                default=None,
            )
            for engine in dict.fromkeys(one.engine for one in measured)
        }
        own = best.get("proxbench")
        for engine, one in best.items():
            cells = [f"{level:g}", engine]
            if one is None:
                cells += ["none", "–", "–"]
            else:
                ratio = "–" if own is None else f"{one.processor / own.processor:.1f}"
                cells += [one.setting.name, f"{one.processor / seconds:.2f}", ratio]
            print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Read the command line and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--balls", type=int, nargs="+", default=[1000, 4000])
    parser.add_argument("--start", type=float, default=0.4, help="time of the state from which engines begin [s]")
    parser.add_argument("--seconds", type=float, default=0.1, help="simulated time that is timed [s]")
    parser.add_argument("--engine", action="append", choices=[*SETTINGS], help="may be repeated; default: all")
    given = parser.parse_args()
    stay_on_one_core()
    with threadpool_limits(1):
        for balls in given.balls:
            print_tables(balls, measure(balls, given.start, given.seconds, given.engine or [*SETTINGS]), given.seconds)


if __name__ == "__main__":
    main()
