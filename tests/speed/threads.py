"""Measure sweeps in plain order and by slabs, in one and in several threads, and against a stream of the same bytes.

``python tests/speed/threads.py --balls 1000 4000 16000 --threads 1 2`` pours balls into a funnel for 0.45 s (Δt 1 ms),
and prints a line for each way to sweep the contacts of that state: microseconds of ten sweeps (least and median),
nanoseconds per sweep and contact, and the ratio of the least times to that of one thread by slabs. The ways take
turns. ``--momentum 0`` omits the stage of the momentum. Sweeps by slabs include ξ. The last line is a kernel that
reads the records once, and reads and writes Λ and its change.

A second table has whole solves to a residual of 1e-2 from zero, in milliseconds (least and median). A third one has the
sweeps to residuals of 1e-2 and 1e-4, in plain order and by slabs, for several relaxations and momenta.

Labels contain the number of threads that run, as in "threads=1 (of 2)" if the problem has too few contacts for the two
that were requested. ``--force`` runs all of them, unless there are too few slabs.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numba import njit
from pours import steps_at
from proxbench.problems import ContactProblem
from proxbench.problems.arrays import FloatArray
from proxbench.problems.motion.scenes.funnel import RADIUS, Funnel
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.iteration.cores import one_library_thread
from proxbench.solvers.prox.parallel import coloured_sweep
from proxbench.solvers.prox.parallel.coloured_sweep import ColouredIterates, ColouredSweep
from proxbench.solvers.sweeps.batches.balls import BallSweep
from proxbench.solvers.sweeps.factors import FactorSweep
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes

STEPS, TIME_STEP = 450, 1e-3
DEPTH = 0.02 * RADIUS
SWEEPS, MAX_SWEEPS = 10, 3000
RELAXATION, TOLERANCE = 1.1, 1e-2
SOLVER = "SORprox(relaxation=1.1, momentum=0.65, form='factors')"


def poured(balls: int) -> ContactProblem:
    """Return the contacts of a pour at 0.45 s."""
    funnel = Funnel(balls)
    rule = MidpointRule(funnel.system(), create(SOLVER), Stop(TOLERANCE, 1000), TIME_STEP, depth=DEPTH)
    ((_, step),) = steps_at(rule, funnel.start(), [STEPS * TIME_STEP])
    assert step.problem is not None
    return step.problem


@njit(fastmath=True)
def stream(records, bodies, impulses, change):  # type: ignore[no-untyped-def]
    """Read the records, and read and write two arrays."""
    total, count = 0.0, 0
    for k in range(len(records)):
        total += records[k]
    for k in range(len(bodies)):
        count += bodies[k]
    for k in range(len(impulses)):
        impulses[k] = 0.5 * impulses[k] + change[k]
        change[k] = 0.5 * change[k]
    return total + count


def streamed(sweep: ColouredSweep) -> Callable[[int], Any]:
    """Return a function that streams the bytes of a number of sweeps."""
    balls = sweep.ball_batches
    bodies, records = sweep.piece_batches[1:3] if balls is None else (balls.bodies, balls.records)
    impulses, change = np.zeros((2, 3 * len(bodies) // 2))

    def run(count: int) -> None:
        for _ in range(count):
            stream(records, bodies.view(np.int64), impulses, change)

    return run


def slab_sweeps(problem: ContactProblem, sizes: FloatArray, threads: Sequence[int]) -> dict[str, ColouredSweep]:
    """Return a sweep by slabs for each requested number of threads; its label has the number that runs."""
    sweeps = {}
    for requested in threads:
        sweep = ColouredSweep.over(problem, sizes, requested)
        excess = f" (of {requested})" if sweep.threads < requested else ""
        sweeps[f"by slabs, threads={sweep.threads}{excess}"] = sweep
    return sweeps


def measure(problem: ContactProblem, threads: Sequence[int], momentum: float, seconds: float) -> None:
    """Print the table of one problem."""
    sizes, start = diagonal_step_sizes(problem, RELAXATION), np.zeros(problem.n_rows)
    over_balls = BallSweep.over(problem, sizes)
    assert over_balls is not None
    ways = {
        "plain order": over_balls.begin(start, momentum).sweep,
        "plain order over pieces": FactorSweep.over(problem, sizes).begin(start, momentum).sweep,
    }
    coloured = slab_sweeps(problem, sizes, threads)
    for name, sweep in coloured.items():
        ways[name] = partial(ColouredIterates.sweep, ColouredIterates(sweep, start, momentum))
    ways["stream of the same bytes"] = streamed(sweep)
    times: dict[str, list[float]] = {name: [] for name in ways}
    end = time.perf_counter() + seconds
    while len(times["plain order"]) < 3 or time.perf_counter() < end:
        for name, run in ways.items():
            began = time.perf_counter()
            run(SWEEPS)
            times[name].append(time.perf_counter() - began)
    reference, *_ = coloured
    kept = {name: np.array(values[1:]) for name, values in times.items()}
    print(
        f"{problem.n_contacts} contacts, {len(sweep.slabs.first_batch) - 1} slabs, {len(kept['plain order'])} windows"
    )
    for name, values in kept.items():
        each = 1e9 * values.min() / (SWEEPS * problem.n_contacts)
        ratio = kept[reference].min() / values.min()
        print(f"  {name:28} {1e6 * values.min():9.0f} {1e6 * np.median(values):9.0f} us {each:6.1f} ns {ratio:6.2f}")


def measure_solves(problem: ContactProblem, threads: Sequence[int], momentum: float, seconds: float) -> None:
    """Print the times of whole solves of one problem."""
    options = f"relaxation={RELAXATION}, momentum={momentum}"
    solvers = [f"SORprox({options}, form='factors')", *(f"ColouredSORprox({options}, threads={n})" for n in threads)]
    prepared = {name: create(name).prepare(problem) for name in solvers}
    times: dict[str, list[float]] = {name: [] for name in solvers}
    sweeps: dict[str, int] = {}
    end = time.perf_counter() + seconds
    while len(times[solvers[0]]) < 3 or time.perf_counter() < end:
        for name, solver in prepared.items():
            began = time.perf_counter()
            sweeps[name] = solver.solve(Stop(TOLERANCE)).iterations
            times[name].append(time.perf_counter() - began)
    for name, values in times.items():
        kept = 1e3 * np.array(values[1:])
        used = getattr(prepared[name], "threads", None)
        label = name if used is None else f"{name} ({used} used)"
        print(f"  {label:70} {sweeps[name]:4} sweeps {kept.min():8.2f} {np.median(kept):8.2f} ms")


def count_sweeps(problem: ContactProblem) -> None:
    """Print the sweeps to two residuals in plain order and by slabs, or a dash above ``MAX_SWEEPS``."""
    for relaxation, momentum in ((1.1, 0.65), (1.1, 0.8), (1.5, 0.0)):
        options = f"relaxation={relaxation}, momentum={momentum}"
        counts = []
        for tolerance in (1e-2, 1e-4):
            for solver in (f"SORprox({options}, form='factors')", f"ColouredSORprox({options})"):
                solution = solve(problem, solver, tolerance, max_iterations=MAX_SWEEPS, max_seconds=np.inf)
                counts.append(str(solution.iterations) if solution.status is Status.SOLVED else "–")
        print(f"  {options:30} 1e-2: {counts[0]}, by slabs {counts[1]};  1e-4: {counts[2]}, by slabs {counts[3]}")


def main() -> None:
    """Read the command line and print all tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--balls", type=int, nargs="+", default=[1000, 4000, 16000])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--momentum", type=float, default=0.65)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--force", action="store_true", help="run all requested threads, even if that takes longer")
    given = parser.parse_args()
    if given.force:
        coloured_sweep.MIN_CONTACTS_PER_THREAD, coloured_sweep.MIN_EFFICIENCY = 1, 0.0
    for balls in given.balls:
        print(f"{balls} balls: ", end="", flush=True)
        problem = poured(balls)
        measure(problem, given.threads, given.momentum, given.seconds)
        measure_solves(problem, given.threads, given.momentum, given.seconds)
        count_sweeps(problem)


if __name__ == "__main__":
    with one_library_thread():
        main()
