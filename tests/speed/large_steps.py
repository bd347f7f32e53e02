"""Times of a step, and of a sweep compared with a copy of the same bytes, by the number of balls.

``python tests/speed/large_steps.py 1000 16000 64000`` takes a heap of each size: a lattice of balls that barely
overlap, jittered and moving at random, on a plane. Balls are numbered in the order of the lattice, and for comparison
in a random order, also for sweeps over slabs. Sweeps read records of 64-bit numbers, and for comparison of 32-bit
numbers. Times are processor
times; sizes take turns, and the least of all rounds counts, because the work of a round does not vary. The lattice
overlaps by more than a step may leave, and its first steps project positions until all balls are separated. The time of
a step is the mean of the next two, and the column of sweeps shows both; the last column counts the first steps.
"""

import argparse
import resource
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import njit
from proxbench.bench.simulation.starts import STARTS, WARM, StepSolver
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.scenes.effects import Friction, Gravity, Restitution, ball_system
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule, step_problem
from proxbench.solvers import Stop, create
from proxbench.solvers.iteration.cores import one_library_thread
from proxbench.solvers.sweeps.batches.ball_kernels import sweep_balls

RADIUS, MASS, PITCH, JITTER, SPEED = 0.01, 0.01, 1.97, 0.02, 0.3
"""Radius [m] and mass [kg], distance and jitter of the lattice [radii], and speed [m/s] of the balls."""

STEP, TOLERANCE, DEPTH = 1e-3, 1e-2, 1e-4
"""Length of a step [s], tolerance of its solve, and penetration [m] that the projection leaves."""

MOMENTUM = 0.65
SOLVER = f"SORprox(relaxation=1.1, form='factors', momentum={MOMENTUM})"
SLAB_SOLVER = f"ColouredSORprox(relaxation=1.1, momentum={MOMENTUM})"

STEPS, SWEEPS, ROUNDS = 2, 10, 8
"""Successive steps and sweeps of one sample, and samples of each size."""

MAX_FIRST_STEPS = 50
"""Largest number of steps before the measured ones."""


def heap(n_balls: int, is_shuffled: bool = False) -> tuple[BallSystem, State]:
    """Return a heap of balls and its first state."""
    side = round(n_balls ** (1.0 / 3.0) + 0.5)
    grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    lattice = grid[np.argsort(grid[:, 2], kind="stable")][:n_balls]
    rng = np.random.default_rng(0)
    if is_shuffled:
        lattice = rng.permutation(lattice)
    centres = RADIUS * (1.0 + PITCH * lattice + rng.uniform(-JITTER, JITTER, (n_balls, 3)))
    effects = (Gravity(9.81), Friction(0.3), Restitution(0.3, 0.0))
    surfaces = [Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]
    system = ball_system(np.full(n_balls, RADIUS), np.full(n_balls, MASS), surfaces, effects)
    return system, State(0.0, centres.ravel(), system.without_spin(rng.normal(scale=SPEED, size=(n_balls, 3))))


@njit(cache=True, fastmath={"reassoc"})
def stream(count, bodies, records, impulses, change):  # type: ignore[no-untyped-def]
    """Read and write the arrays of a sweep from beginning to end, and do nothing else."""
    total, touched = 0.0, 0
    for _ in range(count):
        for k in range(len(records)):
            total += records[k]
        for k in range(len(bodies)):
            touched += bodies[k]
        for k in range(len(impulses)):
            impulses[k], change[k] = impulses[k] + 1.0, change[k] + 1.0
    return total, touched


class Sweeps:
    """Sweeps over the first step of a heap."""

    def __init__(self, system: BallSystem, state: State) -> None:
        assembly = system.assemble(state.position, state.velocity, STEP)
        assert assembly.contacts is not None
        problem = step_problem(assembly, assembly.contacts, state.velocity)
        prepared: Any = create(SOLVER).prepare(problem)
        self.iterates = prepared.begin(np.zeros(problem.n_rows))
        self.data = self.iterates._sweep
        slabs: Any = create(SLAB_SOLVER).prepare(problem)
        self.over_slabs = slabs.begin(np.zeros(problem.n_rows))
        self.short_records = self.data.records.astype(np.float32)
        self.impulses, self.change = np.zeros_like(self.iterates._impulses), np.zeros_like(self.iterates._impulses)
        self.n_contacts = problem.n_contacts

    @property
    def bytes_per_contact(self) -> int:
        """Bytes that a sweep moves per contact."""
        own = self.data
        total = own.records.nbytes + own.bodies.nbytes + 2 * (self.impulses.nbytes + self.change.nbytes)
        return total // self.n_contacts

    def sweep(self) -> None:
        """Sweep."""
        self.iterates.sweep(SWEEPS)

    def sweep_over_slabs(self) -> None:
        """Sweep over slabs, and compute ξ."""
        self.over_slabs.sweep(SWEEPS)

    def sweep_short(self) -> None:
        """Sweep over records of 32-bit numbers."""
        own, now = self.data, self.iterates
        arrays = now._impulses, now._motion, now._change, now._previous_motion
        sweep_balls(SWEEPS, own.bodies, self.short_records, own.balls.spin_ratio, *arrays, MOMENTUM, 0.0, 0, MOMENTUM)

    def stream(self) -> None:
        """Read and write the arrays of a sweep in sequence."""
        stream(SWEEPS, self.data.bodies, self.data.records, self.impulses, self.change)


def separated(rule: MidpointRule, state: State) -> tuple[State, int]:
    """Return the state after the first step that leaves no overlap, and the number of steps."""
    count = 0
    for step in rule.steps(state, MAX_FIRST_STEPS):
        state, count = step.state, count + 1
        if not step.overlap:
            break
    return state, count


def samples(n_balls: int, solver: str, start: str) -> tuple[dict[str, Callable[[], Any]], tuple[int, int, int]]:
    """Return the timed functions at one size, and three counts.

    These are the contacts of the lattice, the bytes per contact that a sweep moves, and the first steps.
    """
    system, state = heap(n_balls)
    rule = MidpointRule(system, StepSolver(create(solver), start), Stop(TOLERANCE), STEP, depth=DEPTH)
    ordered, shuffled = Sweeps(system, state), Sweeps(*heap(n_balls, is_shuffled=True))
    first, n_steps = separated(rule, state)
    timed = {
        "step": lambda: list(rule.steps(first, STEPS)),
        "sweep": ordered.sweep,
        "stream": ordered.stream,
        "32 bits": ordered.sweep_short,
        "shuffled": shuffled.sweep,
        "slabs": ordered.sweep_over_slabs,
        "shuffled slabs": shuffled.sweep_over_slabs,
    }
    return timed, (ordered.n_contacts, ordered.bytes_per_contact, n_steps)


def main(sizes: Sequence[int], solver: str, start: str) -> None:
    """Print the costs at each size; ``solver`` solves the steps from ``start``."""
    print(
        " balls  contacts    sweeps  ms a step  bytes  ns a contact and sweep  streaming  ratio  32 bits  shuffled"
        "  slabs  shuffled slabs  MB  first steps"
    )
    prepared = {n: samples(n, solver, start) for n in sizes}
    times: dict[tuple[int, str], list[float]] = {}
    for turn in range(ROUNDS + 1):
        for n, (timed, _) in prepared.items():
            for name, work in timed.items():
                began = time.process_time()
                work()
                if turn:  # the first round compiles
                    times.setdefault((n, name), []).append(time.process_time() - began)
    for n, (timed, (contacts, moved, n_steps)) in prepared.items():
        sweeps = ", ".join(str(step.iterations) for step in timed["step"]())
        each = {name: 1e9 * min(times[n, name]) / SWEEPS / contacts for name in timed}
        sweep, streaming = each["sweep"], each["stream"]
        step = 1e3 * min(times[n, "step"]) / STEPS
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{n:6} {contacts:9} {sweeps:>9} {step:10.2f} {moved:6} {sweep:23.1f} {streaming:10.1f} "
            f"{sweep / streaming:6.2f} {each['32 bits']:8.1f} {each['shuffled']:9.1f} {each['slabs']:6.1f} "
            f"{each['shuffled slabs']:15.1f} {memory:4.0f} {n_steps:12}"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("balls", type=int, nargs="*", default=[1000, 16000])
    parser.add_argument("--solver", default=SOLVER, help="solver of the steps; sweeps are always those of %(default)s")
    parser.add_argument("--start", choices=STARTS, default=WARM, help="start of each solve")
    words = parser.parse_args()
    with one_library_thread():
        main(words.balls, words.solver, words.start)
