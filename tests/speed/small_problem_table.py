"""Time of problems of one to ten contacts by Robust, external solvers and the C example, interleaved in one process.

``python tests/speed/small_problem_table.py`` prints a table in Markdown: median microseconds of processor time to
prepare and solve to 1e-8, from a problem that was made before, and the judged residual where it is larger. In each
round, each solver solves ten new problems successively. The first of them has its own row, because the caches then
contain the data of other solvers. With ``--many N`` the program also prints the wall time per problem of ``solve_many``
over N problems, by threads.
"""

import argparse
import gc
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from proxbench import solve_many
from proxbench.problems import ContactProblem, ProxbenchError, judge, load
from proxbench.solvers import Solution, Solver, Stop, create
from proxbench.solvers.composite.robust import prepare_by_parts
from proxbench.solvers.native.structures import include_folder
from threadpoolctl import threadpool_limits

PROBLEMS = ("woodpecker-lower-impact", "hard-sliding-block", "hard-sticking-box", "hard-stack-10")
"""One planar contact, four planar and four spatial ones, and ten without friction."""

FORMS = ("G", "G, own laws", "W, M⁻¹")
"""Forms of a problem; its laws are shared by all problems, or an equal copy."""

SOLVERS = ("ClarabelCoulomb", "Lemke", "PinocchioADMM", "PinocchioPGS")

EXAMPLE = Path(__file__).parents[2] / "docs" / "plugins" / "pgs.c"

TOLERANCE = 1e-8

N_SUCCESSIVE = 10
"""Problems that a solver solves successively in a round."""

SLOW = 2e3
"""Microseconds above which a solver is measured in every twentieth round."""

Call = Callable[[ContactProblem], Solution]
"""Prepares and solves a problem."""


def calls(folder: Path) -> dict[str, Call]:
    """Return the compared solvers by name; solvers whose libraries are missing are omitted."""
    stop, found = Stop(TOLERANCE, max_seconds=1.0), {}
    robust = create("Robust")
    found["Robust"] = lambda problem: robust.prepare(problem).solve(stop)
    found["Robust by parts"] = lambda problem: prepare_by_parts(problem).solve(stop)
    library = folder / "libpgs.so"
    command = f'cc -O2 -shared -fPIC -I"{include_folder()}" "{EXAMPLE}" -o "{library}" -lm'
    names = [*SOLVERS, f"Shared({library}, options='relaxation=1.5')"] if os.system(command) == 0 else [*SOLVERS]
    for entry in names:
        try:
            found[entry.replace(f"{library}", "pgs.c")] = _call(create(entry), stop)
        except ProxbenchError as error:
            print(f"{entry} is left out: {error}")
    return found


def _call(solver: Solver, stop: Stop) -> Call:
    return lambda problem: solver.prepare(problem).solve(stop)


def maker(name: str, form: str) -> Callable[[], ContactProblem]:
    """Return a function that makes a new problem in one of ``FORMS``."""
    problem = load(name)
    c, laws, factors = problem.free_velocity, problem.laws, problem.factors
    if form == "G":
        matrix = problem.delassus()
        return lambda: ContactProblem.from_delassus(matrix, c, laws=laws)
    if form == "G, own laws":
        return ContactProblem.from_delassus(problem.delassus(), c, laws=laws).fresh
    assert factors is not None
    directions, inverse_mass = factors.force_directions, factors.inverse_mass.matrix
    return lambda: ContactProblem.from_factors(directions, inverse_mass, c, laws=laws)


def measure(call: Call, make: Callable[[], ContactProblem]) -> list[float]:
    """Return the microseconds of processor time of successive calls."""
    problems, times = [make() for _ in range(N_SUCCESSIVE)], []
    for problem in problems:
        began = time.process_time()
        call(problem)
        times.append(1e6 * (time.process_time() - began))
    return times


def print_table(rounds: int) -> None:
    """Print two rows for each problem and form, and a column for each solver."""
    with tempfile.TemporaryDirectory() as folder:
        compared = calls(Path(folder))
        print(f"| problem | contacts | given by | | {' | '.join(compared)} |")
        print(f"|---|---:|---|---|{'---:|' * len(compared)}")
        rows = [(name, form, maker(name, form)) for name in PROBLEMS for form in FORMS]
        times: dict[tuple[int, str], list[list[float]]] = {}
        residuals: dict[tuple[int, str], float] = {}
        for row, (_, _, make) in enumerate(rows):
            for label, call in compared.items():
                if label not in SOLVERS or create(label).supports(make()) is None:
                    residuals[row, label], times[row, label] = judge(make(), call(make()).impulses).residual, []
        for turn in range(rounds):
            for row, label in times:
                is_slow = turn > 3 and np.median(times[row, label]) > SLOW
                if not is_slow or turn % 20 == 0:
                    times[row, label].append(measure(compared[label], rows[row][2]))
        for row, (name, form, make) in enumerate(rows):
            for words, part in (("in a row", slice(1, None)), ("first", slice(0, 1))):
                cells = [_cell(times.get((row, label)), part, residuals.get((row, label))) for label in compared]
                print(f"| `{name}` | {make().n_contacts} | {form} | {words} | {' | '.join(cells)} |")


def _cell(times: list[list[float]] | None, part: slice, residual: float | None) -> str:
    if times is None or residual is None:
        return "–"
    reached = "" if residual <= TOLERANCE else f" ({residual:.0e})"
    return f"{np.median(np.array(times)[:, part]):.0f}{reached}"


def print_many(count: int, rounds: int) -> None:
    """Print the microseconds per problem of ``solve_many``."""
    cores = len(os.sched_getaffinity(0))
    print("\n| problems | threads | µs per problem |\n|---|---:|---:|")
    for name in PROBLEMS:
        problems = [maker(name, "G")() for _ in range(count)]
        times: dict[int, list[float]] = {threads: [] for threads in range(1, cores + 1)}
        for turn in range(rounds + 1):
            for threads, of_threads in times.items():
                began = time.perf_counter()
                many = solve_many(problems, TOLERANCE, threads=threads)
                if turn:
                    of_threads.append(1e6 * (time.perf_counter() - began) / count)
        assert many.residuals.max() <= TOLERANCE
        for threads, of_threads in times.items():
            print(f"| {count} × `{name}` | {threads} | {np.median(of_threads):.1f} |")


def main() -> None:
    """Read the options and print the tables."""
    parser: Any = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=200, help="rounds of the table")
    parser.add_argument("--many", type=int, default=0, metavar="N", help="problems of solve_many")
    options = parser.parse_args()
    gc.disable()
    with threadpool_limits(1):
        print_table(options.rounds)
        if options.many:
            print_many(options.many, max(3, options.rounds // 20))


if __name__ == "__main__":
    main()
