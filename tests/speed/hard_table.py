"""Print problems that ``Robust`` does not solve in time, and the effect of changes that make problems hard.

``python tests/speed/hard_table.py FILE …`` solves problem files, each to 1e-6 and 1e-8 within ``--seconds``, and prints
the judged residual and the processor time. Then it prints the median, the least and the largest number of iterations of
a solver over variants of small problems: in other orders of contacts, with every contact given twice, and with random
relative changes of 1e-6 of each row of c.
"""

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.transformations import duplicated, permuted
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import step_problem
from proxbench.solvers import Stop, create
from proxbench.solvers.iteration.cores import one_library_thread

TOLERANCES = (1e-6, 1e-8)
NOISE = 1e-6
VARIANTS = 20


def file_rows(files: Sequence[Path], seconds: float) -> Iterator[str]:
    """Yield a row of Markdown for each file and tolerance."""
    yield "| problem | contacts | tolerance | residual | time [s] | status |"
    yield "| --- | ---: | ---: | ---: | ---: | --- |"
    for file in files:
        problem = load(file)
        for tolerance in TOLERANCES:
            began = time.process_time()
            solution = create("Robust").prepare(problem.fresh()).solve(Stop(tolerance, 10**9, seconds))
            spent = time.process_time() - began
            residual = judge(problem, solution.impulses).residual
            counts = f"{problem.n_contacts} | {tolerance:.0e} | {residual:.1e} | {spent:.3g}"
            yield f"| `{file.stem}` | {counts} | {solution.status.value} |"


def two_cubes() -> ContactProblem:
    """Return two stacked cubes at rest with μ = 0.95."""
    scene = make_scene("box_stack(n_boxes=2, friction=0.95)")
    assembly = scene.system.assemble(scene.start.position, scene.start.velocity, 1e-3)
    assert assembly.contacts is not None
    return step_problem(assembly, assembly.contacts, scene.start.velocity)


def reordered(problem: ContactProblem, rng: np.random.Generator) -> ContactProblem:
    """Return the problem with its contacts in a random order."""
    return permuted(problem, rng.permutation(problem.n_contacts)).problem


def with_noise(problem: ContactProblem, rng: np.random.Generator) -> ContactProblem:
    """Return the problem with random relative changes of each row of c."""
    changes = 1.0 + NOISE * rng.uniform(-1.0, 1.0, problem.n_rows)
    return ContactProblem(problem.free_velocity * changes, problem.laws, problem.matrix, problem.factors)


def with_copies(problem: ContactProblem, rng: np.random.Generator) -> ContactProblem:
    """Return the problem with every contact twice, in a random order."""
    for contact in range(problem.n_contacts):
        problem = duplicated(problem, contact).problem
    return reordered(problem, rng)


def variant_rows(seconds: float) -> Iterator[str]:
    """Yield a row of Markdown for each problem, change and solver."""
    problems = {"two cubes, μ = 0.95": two_cubes(), "`bodies-stack-10`": load("bodies-stack-10")}
    changes: dict[str, Callable[[ContactProblem, np.random.Generator], ContactProblem]] = {
        "order": reordered,
        "order, each contact twice": with_copies,
        "noise of 1e-6 in c": with_noise,
    }
    yield "| problem | change | solver | unchanged | median | least | largest | unsolved | largest time [s] |"
    yield "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for name, problem in problems.items():
        for solver in ("SORprox(relaxation=1.5)", "Robust"):
            plain = solve(problem, solver, seconds)[0]
            for change, apply in changes.items():
                rng = np.random.default_rng(0)
                results = [solve(apply(problem, rng), solver, seconds) for _ in range(VARIANTS)]
                counts, times, solved = zip(*results, strict=True)
                cells = f"{np.median(counts):.0f} | {min(counts)} | {max(counts)} | {VARIANTS - sum(solved)}"
                yield f"| {name} | {change} | `{solver}` | {plain} | {cells} | {max(times):.2g} |"


def solve(problem: ContactProblem, solver: str, seconds: float) -> tuple[int, float, bool]:
    """Return the iterations to 1e-8, the processor time [s], and whether the problem is solved."""
    began = time.process_time()
    solution = create(solver).prepare(problem).solve(Stop(1e-8, 100_000, seconds))
    return solution.iterations, time.process_time() - began, solution.status.value == "solved"


def main() -> None:
    """Read the command line and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="*")
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    for line in file_rows(given.files, given.seconds):
        print(line, flush=True)
    print()
    for line in variant_rows(min(given.seconds, 5.0)):
        print(line, flush=True)


if __name__ == "__main__":
    with one_library_thread():
        main()
