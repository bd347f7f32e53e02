"""Measure the times that a run shows under load, and compare them with the times of successive solves.

``python tests/speed/times_under_load.py`` measures five solvers on five problems to 1e-4 on an idle machine and under
four kinds of load, and prints a table of the 25 cases in Markdown. A cell is the time that the run shows over the
median of successive solves on the idle machine. ``*`` marks cells without a valid round, which enter no mean, ratio or
verdict.

``--runs 5`` repeats shorter runs under each load instead. It prints the verdicts of ``compare`` for all pairs of runs,
by the loads of both, and the problems with different fastest solvers (in bold) in several runs. All runs measure the
same solvers with the same code, so that every verdict of a difference is false. The exit code is 1 if there is one, or
if a winner changes. ``--loads "same core" bursts`` selects loads, ``--problems`` and ``--solvers`` the cases.
"""

import argparse
import multiprocessing
import os
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import combinations

import numpy as np
import pandas as pd
from proxbench.bench.runs import Run, compare, run
from proxbench.problems.exchange.catalog import load
from proxbench.solvers import Stop, create

SOLVERS = ("Robust", "SORprox(relaxation=1.5)", "NSGS", "InteriorPoint", "ClarabelSOCP")
PROBLEMS = ("hard-sticking-box", "funnel-30", "funnel-100", "pile-100", "funnel-1000")
DEFAULT_SOLVERS, DEFAULT_PROBLEMS = SOLVERS[:4], PROBLEMS[:3]
TOLERANCE = 1e-4

MAX_SOLVES, MAX_SECONDS = 400, 2.0
"""Number of successive solves of a case, and the time for them [s]."""

COPIED_BYTES = 320_000_000
BURST_SECONDS = (0.002, 0.02)


def spin(core: int) -> None:
    """Keep a core busy."""
    os.sched_setaffinity(0, {core})
    while True:
        pass


def copy(core: int) -> None:
    """Copy memory that exceeds every cache."""
    os.sched_setaffinity(0, {core})
    source = np.ones(COPIED_BYTES // 8)
    target = np.empty_like(source)
    while True:
        target[:] = source


def burst(core: int) -> None:
    """Keep a core busy for random times, between idle times of the same mean."""
    os.sched_setaffinity(0, {core})
    rng = np.random.default_rng(0)
    while True:
        end = time.perf_counter() + rng.uniform(*BURST_SECONDS)
        while time.perf_counter() < end:
            pass
        time.sleep(rng.uniform(*BURST_SECONDS))


def nothing(core: int) -> None:
    """Leave the machine idle."""


def loads() -> dict[str, tuple[Callable[[int], None], int]]:
    """Return the loads and their cores; a run claims the highest core."""
    cores = sorted(os.sched_getaffinity(0))
    same, other = cores[-1], cores[0]
    return {
        "idle": (nothing, same),
        "same core": (spin, same),
        "other core": (spin, other),
        "memory": (copy, other),
        "bursts": (burst, same),
    }


@contextmanager
def loaded(work: Callable[[int], None], core: int) -> Iterator[None]:
    """Load a core inside the ``with`` block."""
    process = multiprocessing.get_context("fork").Process(target=work, args=(core,), daemon=True)
    process.start()
    time.sleep(1.0)
    try:
        yield
    finally:
        process.kill()
        process.join()


def successive_seconds(problem: str, solver: str) -> float:
    """Return the median time of successive solves of new copies of a problem [s]."""
    given, method, stop = load(problem), create(solver), Stop(tolerance=TOLERANCE)
    times: list[float] = []
    end = time.perf_counter() + MAX_SECONDS
    while len(times) < 3 or (len(times) < MAX_SOLVES and time.perf_counter() < end):
        copied = given.fresh()
        began = time.perf_counter()
        method.prepare(copied).solve(stop)
        times.append(time.perf_counter() - began)
    return float(np.median(times[1:]))


def measured(folder: str, problems: Sequence[str], solvers: Sequence[str], passes: int) -> Run:
    """Measure solvers to one tolerance."""
    return run(problems, solvers, results=folder, tolerances=TOLERANCE, passes=passes)


def measured_under(load: str, folder: str, problems: Sequence[str], solvers: Sequence[str], passes: int) -> Run:
    """Measure under a load; repeat this if another run on this machine has claimed the loaded core."""
    work, core = loads()[load]
    while True:
        with loaded(work, core):
            found = measured(folder, problems, solvers, passes)
        if found.info.sessions[-1].core == max(os.sched_getaffinity(0)):
            return found
        print("another run has claimed the core; measuring again", file=sys.stderr)


def shown_ratio(measurement: Run, problem: str, solver: str, idle: float) -> str:
    """Return the time of a case over its successive time, as it is shown; ``–`` if Coulomb's law is not solved."""
    points = measurement.points
    row = points[(points["problem"] == problem) & (points["solver"] == solver)].iloc[0]
    if row["outcome"] != "solved":
        return "–"
    return f"{row['total_seconds'] / idle:.2f}{'*' if row['is_excluded'] else ''}"


def print_cases(folder: str) -> None:
    """Print the table of all cases."""
    idle = {(problem, solver): successive_seconds(problem, solver) for problem in PROBLEMS for solver in SOLVERS}
    runs = {name: measured_under(name, folder, PROBLEMS, SOLVERS, 2) for name in loads()}
    print("| problem | solver | successive [ms] |", " | ".join(runs), "|")
    print("| --- | --- | ---: |" + " ---: |" * len(runs))
    for (problem, solver), seconds in idle.items():
        cells = [shown_ratio(one, problem, solver, seconds) for one in runs.values()]
        print(f"| `{problem}` | `{solver}` | {1e3 * seconds:.3g} |", " | ".join(cells), "|")


def fastest(measurement: Run) -> dict[str, str]:
    """Return the fastest solver of each problem whose time is bold."""
    tables = measurement.report(charts=False).tables
    table = pd.read_csv(next(file for file in tables if file.name == "ratios.csv"))
    winners = table[table["standing"] == "fastest"]
    return dict(zip(winners["problem"], winners["solver"], strict=True))


def print_verdicts(folder: str, options: argparse.Namespace) -> bool:
    """Print the verdicts of all pairs of runs, and winners that change; return whether one is false or changes."""
    runs: list[tuple[str, Run]] = []
    for _ in range(options.runs):
        runs += [(name, measured_under(name, folder, options.problems, options.solvers, 3)) for name in options.loads]
    verdicts: defaultdict[str, Counter[str]] = defaultdict(Counter)
    false = 0
    for (first, one), (second, other) in combinations(runs, 2):
        found = compare(one, other)
        false += bool(
            found.slower() or found.faster() or len(found.changed("solved")) or len(found.changed("unsolved"))
        )
        verdicts[" and ".join(sorted((first, second), key=options.loads.index))][found.verdict] += 1
    for pair, counts in verdicts.items():
        print(f"{pair}: {sum(counts.values())} pairs")
        for verdict, count in counts.most_common():
            print(f"    {count} × {verdict}")
    winners = [fastest(one) for _, one in runs]
    changing = [name for name in options.problems if len({one[name] for one in winners if name in one}) > 1]
    excluded = [f"{(one.rounds['excluded'] != '').mean():.0%}" for _, one in runs]
    print(f"excluded rounds of the runs: {', '.join(excluded)}")
    print(f"{false} of {len(runs) * (len(runs) - 1) // 2} pairs have a false verdict")
    print(f"{len(changing)} of {len(options.problems)} problems have several winners in {len(runs)} runs", end=" ")
    print(f"({sum(map(len, winners))} in bold)")
    return bool(false or changing)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=0, help="number of short runs under each load")
    parser.add_argument("--loads", nargs="+", choices=list(loads()), default=list(loads()), help="loads of these runs")
    parser.add_argument("--problems", nargs="+", default=DEFAULT_PROBLEMS, help="their problems")
    parser.add_argument("--solvers", nargs="+", default=DEFAULT_SOLVERS, help="their solvers")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if not options.runs:
            print_cases(folder)
        elif print_verdicts(folder, options):
            sys.exit(1)


if __name__ == "__main__":
    main()
