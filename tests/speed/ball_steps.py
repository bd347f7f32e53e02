"""Measure a step of a pour of balls by solver and tolerance.

``python tests/speed/ball_steps.py --balls 1000 --times 0.3 0.45`` pours balls into a funnel. For the state at each time
it prints the least and the median processor time of a step, and the mean number of sweeps. The solvers take turns; each
sample is ten successive steps of 1 ms from the same state.

``--threads 1 2`` compares sweeps to 1e-2 in sequential order and over slabs in one and in two threads, by wall times.
"""

import argparse
import time
from collections.abc import Callable, Sequence

import numpy as np
from pours import steps_at
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create
from proxbench.solvers.iteration.cores import one_library_thread

STEP, DEPTH = 1e-3, 1e-4
"""Δt [s], and the penetration [m] that the projection leaves."""

POURING = "SORprox(relaxation=1.5, form='factors')"

SOLVERS = (
    (POURING, 1e-2),
    ("SORprox(relaxation=1.1, form='factors', momentum=0.65)", 1e-2),
    ("MomentumFallback", 1e-2),
    ("SORprox(relaxation=1.1, form='factors', momentum=0.8)", 1e-4),
    ("MomentumFallback", 1e-4),
)

STEPS, SAMPLES = 10, 40


def over_slabs(threads: Sequence[int]) -> list[tuple[str, float]]:
    """Return sequential sweeps, and sweeps over slabs for each number of threads, with a tolerance."""
    return [SOLVERS[1]] + [(f"ColouredSORprox(relaxation=1.1, momentum=0.65, threads={n})", 1e-2) for n in threads]


def measure(balls: int, state: State, solvers: Sequence[tuple[str, float]], clock: Callable[[], float]) -> None:
    """Print a row of Markdown for each solver."""
    system = make_scene(f"funnel(balls={balls})").system
    rules = {key: MidpointRule(system, create(key[0]), Stop(key[1]), STEP, depth=DEPTH) for key in solvers}
    samples: dict[tuple[str, float], list[float]] = {key: [] for key in solvers}
    sweeps = {}
    for _ in range(SAMPLES + 1):
        for key, rule in rules.items():
            began, iterations = clock(), 0
            for step in rule.steps(state, STEPS):  # a simulation keeps no steps, which need new memory
                iterations += step.iterations
            samples[key].append(1e3 * (clock() - began) / STEPS)
            sweeps[key] = iterations / STEPS
    problem = step.problem
    assert problem is not None
    for (solver, tolerance), taken in samples.items():
        kept = taken[1:]  # the first sample compiles
        used = getattr(create(solver).prepare(problem), "threads", None)  # fewer than requested
        label = f"`{solver}`" if used is None else f"`{solver}` ({used} used)"
        cells = f"{tolerance:.0e} | {sweeps[solver, tolerance]:.0f} | {min(kept):.2f} | {np.median(kept):.2f}"
        print(f"| {balls} | {state.time:.2f} | {label} | {cells} |", flush=True)


def main() -> None:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--balls", type=int, default=1000)
    parser.add_argument("--times", type=float, nargs="+", default=[0.3, 0.45])
    parser.add_argument("--threads", type=int, nargs="+", default=[])
    given = parser.parse_args()
    clock = time.perf_counter if given.threads else time.process_time
    print("| balls | t [s] | solver | residual | sweeps | least [ms] | median [ms] |")
    print("| ---: | ---: | --- | --- | ---: | ---: | ---: |")
    scene = make_scene(f"funnel(balls={given.balls})")
    rule = MidpointRule(scene.system, create(POURING), Stop(1e-2), STEP, depth=DEPTH)
    for _, step in list(steps_at(rule, scene.start, given.times)):
        measure(given.balls, step.state, over_slabs(given.threads) if given.threads else SOLVERS, clock)


if __name__ == "__main__":
    with one_library_thread():
        main()
