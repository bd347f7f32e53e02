"""Costs of a step, and of a sweep beside a copy of the same bytes, by the number of balls.

``python tests/speed/large_steps.py 1000 16000 64000`` takes a heap of each size: a lattice of balls that barely
overlap, jittered and moving at random, on a plane. Times are processor times; sizes take turns, and the least of all
rounds counts, because the work of a round does not vary.
"""

import resource
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import njit
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.scenes.effects import Friction, Gravity, Restitution, ball_system
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule, step_problem
from proxbench.solvers import Stop, create

RADIUS, MASS, PITCH, JITTER, SPEED = 0.01, 0.01, 1.97, 0.02, 0.3
"""Radius [m] and mass [kg], distance and jitter of the lattice [radii], and speed [m/s] of the balls."""

STEP, TOLERANCE, DEPTH = 1e-3, 1e-2, 1e-4
"""Length of a step [s], tolerance of its solve, and penetration [m] that the projection leaves."""

SOLVER = "SORprox(relaxation=1.1, form='factors', momentum=0.65)"

STEPS, SWEEPS, ROUNDS = 2, 10, 8
"""Successive steps and sweeps of one sample, and samples of each size."""


def heap(n_balls: int) -> tuple[BallSystem, State]:
    """Return a heap of balls and its first state."""
    side = round(n_balls ** (1.0 / 3.0) + 0.5)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    lattice = grid[np.argsort(grid[:, 2], kind="stable")][:n_balls]
    rng = np.random.default_rng(0)
    centres = RADIUS * (1.0 + PITCH * lattice + rng.uniform(-JITTER, JITTER, (n_balls, 3)))
    effects = (Gravity(9.81), Friction(0.3), Restitution(0.3, 0.0))
    surfaces = [Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
    system = ball_system(np.full(n_balls, RADIUS), np.full(n_balls, MASS), surfaces, effects)
    return system, State(0.0, centres.ravel(), system.at_rest(rng.normal(scale=SPEED, size=(n_balls, 3))))


@njit(cache=True, fastmath={"reassoc"})
def stream(count, bodies, records, held, change):  # type: ignore[no-untyped-def]
    """Read and write the arrays of a sweep from their begin to their end, without anything else."""
    total, touched = 0.0, 0
    for _ in range(count):
        for k in range(len(records)):
            total += records[k]
        for k in range(len(bodies)):
            touched += bodies[k]
        for k in range(len(held)):
            held[k], change[k] = held[k] + 1.0, change[k] + 1.0
    return total, touched


def samples(n_balls: int) -> tuple[dict[str, Callable[[], Any]], int, int]:
    """Return what is timed at one size, the number of contacts, and the bytes a contact that a sweep moves."""
    system, state = heap(n_balls)
    rule = MidpointRule(system, create(SOLVER), Stop(TOLERANCE), STEP, depth=DEPTH)
    assembly = system.assemble(state.position, state.velocity, STEP)
    assert assembly.contacts is not None
    problem = step_problem(assembly, assembly.contacts, state.velocity)
    prepared: Any = create(SOLVER).prepare(problem)
    iterates = prepared.begin(np.zeros(problem.n_rows))
    own = iterates._sweep
    held, change = np.zeros_like(iterates._held), np.zeros_like(iterates._held)
    moved = own.records.nbytes + own.bodies.nbytes + 2 * (held.nbytes + change.nbytes)
    timed = {
        "step": lambda: list(rule.steps(state, STEPS)),
        "sweep": lambda: iterates.sweep(SWEEPS),
        "stream": lambda: stream(SWEEPS, own.bodies, own.records, held, change),
    }
    return timed, problem.n_contacts, moved // problem.n_contacts


def main(sizes: Sequence[int]) -> None:
    """Print the costs at each size."""
    print(" balls  contacts  sweeps  ms a step  bytes  ns a contact and sweep  streaming  ratio  MB so far")
    prepared = {n: samples(n) for n in sizes}
    times: dict[tuple[int, str], list[float]] = {}
    for turn in range(ROUNDS + 1):
        for n, (timed, _, _) in prepared.items():
            for name, work in timed.items():
                began = time.process_time()
                work()
                if turn:  # the first one compiles
                    times.setdefault((n, name), []).append(time.process_time() - began)
    for n, (timed, contacts, moved) in prepared.items():
        sweeps = [step.iterations for step in timed["step"]()]
        sweep, streaming = (1e9 * min(times[n, name]) / SWEEPS / contacts for name in ("sweep", "stream"))
        step = 1e3 * min(times[n, "step"]) / STEPS
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{n:6} {contacts:9} {np.mean(sweeps):7.1f} {step:10.2f} {moved:6} {sweep:23.1f} {streaming:10.1f} "
            f"{sweep / streaming:6.2f} {memory:10.0f}"
        )


if __name__ == "__main__":
    main([int(word) for word in sys.argv[1:]] or [1000, 16000])
