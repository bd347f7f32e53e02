"""Measure what a run shows while other programs load the machine, and print it beside the time of successive solves.

``python tests/speed/times_under_load.py`` measures five solvers on five problems to 1e-4 on an idle machine and under
four kinds of load, and prints a table of the 25 cases in Markdown. A cell is the time that the run shows over the
median of successive solves on the idle machine. ``*`` marks cells without a valid round, which enter no mean, ratio or
verdict.

``--runs 5`` repeats shorter runs under each load instead. It prints the verdicts of ``compare`` between each run on the
idle machine and each run under load, and how many problems have different fastest solvers (in bold) in several runs.
"""

import argparse
import multiprocessing
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import combinations

import numpy as np
import pandas as pd
from proxbench.bench.runs import Run, compare, run
from proxbench.problems.exchange.catalog import load
from proxbench.solvers import Stop, create

SOLVERS = ("Robust", "SORprox(relaxation=1.5)", "NSGS", "InteriorPoint", "ClarabelSOCP")
PROBLEMS = ("hard-sticking-box", "funnel-30", "funnel-100", "pile-100", "funnel-1000")
FEW_SOLVERS, FEW_PROBLEMS = SOLVERS[:4], PROBLEMS[:3]
TOLERANCE = 1e-4

MOST_SOLVES, MOST_SECONDS = 400, 2.0
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
    """Load a core meanwhile."""
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
    end = time.perf_counter() + MOST_SECONDS
    while len(times) < 3 or (len(times) < MOST_SOLVES and time.perf_counter() < end):
        copied = given.fresh()
        began = time.perf_counter()
        method.prepare(copied).solve(stop)
        times.append(time.perf_counter() - began)
    return float(np.median(times[1:]))


def measured(folder: str, problems: tuple[str, ...], solvers: tuple[str, ...], passes: int) -> Run:
    """Measure solvers to one tolerance."""
    return run(problems, solvers, results=folder, tolerances=TOLERANCE, passes=passes)


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
    runs = {}
    for name, (work, core) in loads().items():
        with loaded(work, core):
            runs[name] = measured(folder, PROBLEMS, SOLVERS, 2)
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


def print_verdicts(folder: str, number: int) -> None:
    """Print verdicts between runs on the idle machine and under load, and winners that change."""
    runs: dict[str, list[Run]] = {name: [] for name in loads()}
    for _ in range(number):
        for name, (work, core) in loads().items():
            with loaded(work, core):
                runs[name].append(measured(folder, FEW_PROBLEMS, FEW_SOLVERS, 3))
    for name, several in runs.items():
        with_idle = [(one, two) for one in runs["idle"] for two in several]
        pairs = list(combinations(several, 2)) if name == "idle" else with_idle
        verdicts = Counter(compare(one, two).verdict for one, two in pairs)
        print(f"idle and {name}: {len(pairs)} pairs")
        for verdict, count in verdicts.most_common():
            print(f"    {count} × {verdict}")
    winners = [fastest(one) for several in runs.values() for one in several]
    changing = [problem for problem in FEW_PROBLEMS if len({one[problem] for one in winners if problem in one}) > 1]
    bold = sum(map(len, winners))
    print(
        f"{len(changing)} of {len(FEW_PROBLEMS)} problems have several winners in {len(winners)} runs ({bold} in bold)"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=0, help="number of short runs under each load")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if options.runs:
            print_verdicts(folder, options.runs)
        else:
            print_cases(folder)


if __name__ == "__main__":
    main()
