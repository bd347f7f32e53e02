"""Count the sweeps of constant, growing and measured momentum to several tolerances, by scene and size.

``python tests/speed/momentum_rule.py problems`` solves problems of the library; names may follow.
``python tests/speed/momentum_rule.py pours 1000 4000 16000`` solves steps of pours of these numbers of balls, at the
times ``TIMES``, each cold and warm, and prints the mean of each rule.
``python tests/speed/momentum_rule.py starts 1000`` compares the starts of measured momentum on every tenth step from
0.3 s to 0.6 s, with standard errors.
``python tests/speed/momentum_rule.py robust`` compares the measured momentum of the sweeps that ``Robust`` selects with
β = 0.8, on the problems of ``SUITES``.

All print tables in Markdown. Cells are the sweeps of a solve, as the solver counts them; a dash marks residuals that
are not reached, and means count these as the limit. Columns "to" have β = min(bound, k/(k + 4)). Other programs do not
matter.
"""

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from pours import steps_at
from proxbench.bench.simulation.starts import scaled_start
from proxbench.problems import ContactProblem, ProxbenchError, load
from proxbench.problems.exchange.catalog import SUITES as PROBLEMS_OF_SUITE
from proxbench.problems.motion.scenes.funnel import RADIUS, Funnel
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Status, Stop, create
from proxbench.solvers.composite.sweep_selection import FAST_MOMENTUM, select_sweeps
from proxbench.solvers.prox.sorprox import SORprox

PROBLEMS = (
    "funnel-100",
    "funnel-300",
    "funnel-1000",
    "funnel-planar-300",
    "funnel-planar-1000",
    "funnel-frictionless-1000",
    "pile-100",
    "pile-300",
    "pile-1000",
    "pile-400-mixed-1",
)
"""Steps in flow and at rest."""

SUITES = ("bodies", "sequences", "funnel", "piles")
"""Suites with problems for which ``Robust`` selects momentum."""

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4)

RULES = {
    "ω = 1.5": "relaxation=1.5",
    "β = 0.65": "relaxation=1.1, momentum=0.65",
    "β = 0.8": "relaxation=1.1, momentum=0.8",
    "β = 0.9": "relaxation=1.1, momentum=0.9",
    "to 0.8": "relaxation=1.1, momentum=0.8, momentum_delay=4",
    "to 0.985": "relaxation=1.1, momentum=0.985, momentum_delay=4",
    "measured": "relaxation=1.1, momentum='measured'",
}
"""Options of ``SORprox`` by the name of a column."""

MAX_SWEEPS, MAX_POUR_SWEEPS = 3000, 1000
"""Limits of a solve of the library, and of a pour."""

TIME_STEP, TIMES = 1e-3, (0.3, 0.35, 0.4, 0.45, 0.5, 0.55)
"""Δt [s] of a pour, and the times [s] of the steps that are solved."""

START_TIMES = tuple(np.arange(0.3, 0.6, 0.01))
"""Times [s] at which starts are compared."""

POUR_SOLVER, POUR_STOP = "SORprox(relaxation=1.1, form='factors', momentum=0.65)", Stop(1e-2, 1000)
"""Solver and limits of the steps before these times."""

Sweeps = list[int | None]
"""Sweeps to each tolerance; None where it is not reached."""


def sweeps(problem: ContactProblem, options: str, limit: int, start: np.ndarray | None = None) -> Sweeps:
    """Return the sweeps to each tolerance."""
    prepared = create(f"SORprox({options}, form='factors')").prepare(problem)
    solved = [prepared.solve(Stop(tolerance, limit), start) for tolerance in TOLERANCES]
    return [one.iterations if one.status is Status.SOLVED else None for one in solved]


def poured(balls: int, times: Iterable[float] = TIMES) -> Iterator[tuple[ContactProblem, np.ndarray]]:
    """Yield the contact problems of a pour at some times [s], each with the impulses of the step before."""
    funnel = Funnel(balls)
    rule = MidpointRule(funnel.system(), create(POUR_SOLVER), POUR_STOP, TIME_STEP, depth=0.02 * RADIUS)
    for before, step in steps_at(rule, funnel.start(), times):
        assert step.problem is not None
        assert step.contacts is not None
        _, old, new = np.intersect1d(before.keys, step.contacts.keys, return_indices=True)
        start = np.zeros((step.problem.n_contacts, 3))
        start[new] = before.impulses[old]
        yield step.problem, start.ravel()


def print_head(*names: str) -> None:
    """Print the head of a table."""
    print(f"| {' | '.join(names)} | to | {' | '.join(RULES)} |\n|{' --- |' * (len(names) + 1 + len(RULES))}")


def print_rows(names: str, columns: Sequence[Sequence[float | None]], digits: int) -> None:
    """Print a row for each tolerance; bold marks the fewest sweeps."""
    for tolerance, *row in zip(TOLERANCES, *columns, strict=True):
        least = min((count for count in row if count is not None), default=0)
        texts = ["–" if count is None else f"{count:.{digits}f}" for count in row]
        cells = [f"**{text}**" if count == least else text for text, count in zip(texts, row, strict=True)]
        print(f"| {names} | {tolerance:.0e} | {' | '.join(cells)} |", flush=True)


def print_problems(names: Sequence[str]) -> None:
    """Print the sweeps on problems of the library, from zero."""
    print_head("problem", "contacts")
    for name in names or PROBLEMS:
        problem = load(name)
        columns = [sweeps(problem, options, MAX_SWEEPS) for options in RULES.values()]
        print_rows(f"`{name}` | {problem.layout.n_blocks}", columns, 0)


def print_pours(sizes: Sequence[int]) -> None:
    """Print the mean sweeps over the steps of pours."""
    print_head("balls", "contacts", "start")
    for balls in sizes:
        steps = list(poured(balls))
        contacts = np.mean([problem.n_contacts for problem, _ in steps])
        for name, is_warm in (("cold", False), ("warm", True)):
            columns = []
            for options in RULES.values():
                found = [sweeps(one, options, MAX_POUR_SWEEPS, start if is_warm else None) for one, start in steps]
                reached = np.array([[MAX_POUR_SWEEPS if x is None else x for x in row] for row in found], dtype=float)
                columns.append(reached.mean(axis=0).tolist())
            print_rows(f"{balls} | {contacts:.0f} | {name}", columns, 1)


def print_starts(sizes: Sequence[int]) -> None:
    """Print the mean sweeps of measured momentum from each start, with standard errors."""
    print("| balls | contacts | to | cold | warm | scaled |\n| ---: | ---: | --- | ---: | ---: | ---: |")
    for balls in sizes:
        steps = list(poured(balls, START_TIMES))
        contacts = np.mean([problem.n_contacts for problem, _ in steps])
        starts = {
            "cold": [None for _ in steps],
            "warm": [start for _, start in steps],
            "scaled": [scaled_start(problem, start) for problem, start in steps],
        }
        for tolerance in TOLERANCES:
            cells = []
            for chosen in starts.values():
                counts = []
                for (problem, _), start in zip(steps, chosen, strict=True):
                    prepared = create(f"SORprox({RULES['measured']}, form='factors')").prepare(problem)
                    counts.append(prepared.solve(Stop(tolerance, MAX_POUR_SWEEPS), start).iterations)
                cells.append(f"{np.mean(counts):.1f} ± {np.std(counts, ddof=1) / np.sqrt(len(counts)):.1f}")
            print(f"| {balls} | {contacts:.0f} | {tolerance:.0e} | {' | '.join(cells)} |", flush=True)


def print_robust() -> None:
    """Print the sweeps to 1e-2, 1e-4 and 1e-6 with constant and with measured momentum."""
    print("| problem | contacts | β = 0.8 | measured |\n| --- | ---: | ---: | ---: |")
    for name in dict.fromkeys(member for suite in SUITES for member in PROBLEMS_OF_SUITE[suite]):
        try:
            problem = load(name)
        except ProxbenchError:
            continue  # it has not been generated
        selected = select_sweeps(problem)
        if not isinstance(selected, SORprox) or selected.momentum != FAST_MOMENTUM:
            continue
        cells = []
        for solver in (replace(selected, momentum=0.8), selected):
            prepared = solver.prepare(problem)
            found = [prepared.solve(Stop(tolerance, MAX_SWEEPS)) for tolerance in (1e-2, 1e-4, 1e-6)]
            cells.append(", ".join(str(one.iterations) if one.status is Status.SOLVED else "–" for one in found))
        print(f"| `{name}` | {problem.n_contacts} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "problems":
        print_problems(sys.argv[2:])
    elif sys.argv[1] == "robust":
        print_robust()
    elif sys.argv[1] == "starts":
        print_starts([int(word) for word in sys.argv[2:]])
    else:
        print_pours([int(word) for word in sys.argv[2:]])
