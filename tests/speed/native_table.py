"""Solvers in C and Rust: the examples against SORprox on a suite, and the overhead of calls and preparation.

``python tests/speed/native_table.py sweeps`` prints a table in Markdown: the sweeps of SORprox and of the examples to
1e-6, at most 2000, and the times to prepare and to solve, those of the examples as multiples of SORprox's. Solves are
interleaved in one process. ``calls`` prints the overhead of a call and of a preparation: median, quartiles and extremes
of the medians of repetitions.
"""

import argparse
import gc
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from proxbench.problems import ContactProblem, judge, suite
from proxbench.solvers import Solution, Solver, Status, Stop, create
from proxbench.solvers.native.structures import include_folder
from threadpoolctl import threadpool_limits

EXAMPLES = Path(__file__).parents[2] / "docs" / "plugins"

STOP = Stop(1e-6, max_iterations=2000, max_seconds=10.0)

IDLE = Path(__file__).parents[1] / "solvers" / "native"
"""Folder of a library and a program that do nothing by default."""


def build(folder: Path) -> dict[str, Solver]:
    """Return the examples that this machine can compile, by name."""
    include = f'-I"{include_folder()}"'
    c = f"cc -O2 {include}"
    commands = {
        "pgs.c, library": ("Shared", "libpgs_c.so", f'{c} -shared -fPIC "{EXAMPLES}/pgs.c" -lm'),
        "pgs.rs, library": ("Shared", "libpgs_rust.so", f'rustc -O --crate-type cdylib "{EXAMPLES}/pgs.rs"'),
        "pgs.c, program": ("Executable", "pgs", f'{c} "{EXAMPLES}/pgs_process.c" "{EXAMPLES}/pgs.c" -lm'),
    }
    found = {}
    for name, (kind, file, command) in commands.items():
        if os.system(f'{command} -o "{folder / file}"') == 0:
            found[name] = create(f"{kind}({folder / file})")
        else:
            print(f"{name} is left out: it cannot be compiled")
    return found


def sweep_rows(solvers: dict[str, Solver], problems: Sequence[ContactProblem], rounds: int) -> Iterator[str]:
    """Yield a row of Markdown for each problem that all support, and the sums and geometric means of the columns."""
    compared: dict[str, Solver] = {"SORprox": create("SORprox")} | solvers
    others = [name for name in compared if name != "SORprox"]
    heads = [
        "Problem",
        "SORprox: sweeps",
        "prepare, solve [µs]",
        *(f"{name}: sweeps | prepare, solve" for name in others),
    ]
    yield f"| {' | '.join(heads)} |"
    yield f"| --- | ---: | ---: |{' ---: | ---: |' * len(others)}"
    found = [(one, *measure(compared, one, rounds)) for one in problems if not _refused(compared, one)]
    ratios = {name: [] for name in others}
    for problem, answers, times in found:
        base = np.array(times["SORprox"])
        cells = [_text(answers["SORprox"]), _pair(1e6 * np.median(base, axis=0))]
        for name in others:
            ratio = np.median(np.array(times[name]) / base, axis=0)
            cells += [_text(answers[name]), _pair(ratio)]
            ratios[name] += [ratio] if _outcome(answers[name]) == _outcome(answers["SORprox"]) else []
        yield f"| `{problem.name}` | {' | '.join(cells)} |"
    cells = [f"{_number_solved(found, 'SORprox')} solved", ""]
    for name in others:
        mean = np.exp(np.log(ratios[name]).mean(axis=0))
        cells += [f"{_number_solved(found, name)} solved, {len(ratios[name])} of {len(found)} equal", _pair(mean)]
    yield f"| all; mean where equal | {' | '.join(cells)} |"


Times = dict[str, list[tuple[float, float]]]
"""Seconds to prepare and to solve in each round, by solver."""


def measure(solvers: dict[str, Solver], problem: ContactProblem, rounds: int) -> tuple[dict[str, Solution], Times]:
    """Return the answers, and the times of interleaved rounds."""
    answers = {name: solver.prepare(problem).solve(STOP) for name, solver in solvers.items()}
    times: Times = {name: [] for name in solvers}
    for _ in range(rounds):
        for name, solver in solvers.items():
            fresh = problem.fresh()
            began = time.perf_counter()
            prepared = solver.prepare(fresh)
            middle = time.perf_counter()
            prepared.solve(STOP)
            times[name].append((middle - began, time.perf_counter() - middle))
    return answers, times


def _refused(solvers: dict[str, Solver], problem: ContactProblem) -> bool:
    return any(solver.supports(problem) is not None for solver in solvers.values())


def _pair(values: np.ndarray) -> str:
    return ", ".join(map(_number, values))


def _number(value: float) -> str:
    """Return three digits without an exponent."""
    return f"{float(f'{value:.3g}'):.10g}"


def _number_solved(found: Sequence[tuple[ContactProblem, dict[str, Solution], Times]], name: str) -> int:
    return sum(is_solved(problem, answers[name]) for problem, answers, _ in found)


def is_solved(problem: ContactProblem, solution: Solution) -> bool:
    """Return whether the judge confirms the claim of a solution."""
    return solution.status is Status.SOLVED and judge(problem, solution.impulses).residual <= STOP.tolerance


def _text(solution: Solution) -> str:
    return f"{solution.iterations}" + ("" if solution.status is Status.SOLVED else f", {solution.status.value}")


def _outcome(solution: Solution) -> tuple[Status, int]:
    return solution.status, solution.iterations


def idle(folder: Path) -> dict[str, Solver]:
    """Return a library and a program that return Λ = 0 immediately."""
    include = f'-I"{include_folder()}" -D_POSIX_C_SOURCE=200809L'
    library, program = folder / "libidle.so", folder / "idle"
    if os.system(f'cc -O2 {include} -shared -fPIC "{IDLE}/faulty.c" -o "{library}" -lm'):
        raise SystemExit("there is no C compiler")
    program.write_text(f"#!{sys.executable}\n" + (IDLE / "faulty_program.py").read_text())
    program.chmod(0o755)
    return {"library": create(f"Shared({library})"), "program": create(f"Executable({program})")}


def ten_contacts() -> ContactProblem:
    """Return ten spatial contacts between bodies with 40 degrees of freedom, in factors."""
    rng = np.random.default_rng(3)
    return ContactProblem.from_factors(rng.normal(size=(40, 30)), np.ones(40), rng.normal(size=30), 0.3)


def call_rows(solvers: dict[str, Solver], repetitions: int, calls: int) -> Iterator[str]:
    """Yield a row of Markdown for each kind: microseconds to prepare and to call, over repetitions of many calls."""
    yield "| Solver | preparation [µs] | call [µs] |"
    yield "| --- | ---: | ---: |"
    problem = ten_contacts()
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in solvers}
    for _ in range(repetitions):
        for name, solver in solvers.items():
            prepared, preparing, calling = solver.prepare(problem), [], []
            for fresh in [problem.fresh() for _ in range(calls)]:
                began = time.perf_counter()
                solver.prepare(fresh)
                preparing.append(time.perf_counter() - began)
            for _ in range(calls):
                began = time.perf_counter()
                prepared.solve(STOP)
                calling.append(time.perf_counter() - began)
            found[name].append((float(np.median(preparing)), float(np.median(calling))))
    for name, medians in found.items():
        yield f"| {name} | {' | '.join(_spread(1e6 * np.array(column)) for column in zip(*medians, strict=True))} |"


def _spread(medians: np.ndarray) -> str:
    low, first, middle, third, high = map(_number, np.quantile(medians, [0.0, 0.25, 0.5, 0.75, 1.0]))
    return f"{middle} (quartiles {first} and {third}, range {low} to {high})"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+", choices=("sweeps", "calls"), help="what to print")
    parser.add_argument("--suite", default="quick", help="suite of the sweeps")
    parser.add_argument("--rounds", type=int, default=11, help="interleaved solves of each problem")
    parser.add_argument("--repetitions", type=int, default=21, help="repetitions of the calls")
    parser.add_argument("--calls", type=int, default=500, help="calls in a repetition")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1):
        gc.freeze()
        for table in options.tables:
            if table == "sweeps":
                rows = sweep_rows(build(Path(folder)), suite(options.suite), options.rounds)
            else:
                rows = call_rows(idle(Path(folder)), options.repetitions, options.calls)
            for row in rows:
                print(row, flush=True)


if __name__ == "__main__":
    main()
