"""Count the sweeps of constant and growing momentum to several tolerances, by scene and size.

``python tests/speed/momentum_rule.py`` prints a table in Markdown; names of problems may follow. Cells are the sweeps
of a solve from zero, as the solver counts them, and a dash marks residuals that 3000 sweeps do not reach. Columns "to"
have β = min(bound, k/(k + 4)). Other programs do not matter.
"""

import sys
from collections.abc import Sequence

from proxbench.problems import ContactProblem, load
from proxbench.solvers import Status, Stop, create

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

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)

RULES = {
    "ω = 1.5": "relaxation=1.5",
    "β = 0.65": "relaxation=1.1, momentum=0.65",
    "β = 0.8": "relaxation=1.1, momentum=0.8",
    "β = 0.9": "relaxation=1.1, momentum=0.9",
    "to 0.8": "relaxation=1.1, momentum=0.8, momentum_delay=4",
    "to 0.9": "relaxation=1.1, momentum=0.9, momentum_delay=4",
    "to 0.985": "relaxation=1.1, momentum=0.985, momentum_delay=4",
}
"""Options of ``SORprox`` by the name of a column."""

MAX_SWEEPS = 3000


def sweeps(problem: ContactProblem, options: str) -> list[int | None]:
    """Return the sweeps to each tolerance; None where they are not reached."""
    prepared = create(f"SORprox({options}, form='factors')").prepare(problem)
    solved = [prepared.solve(Stop(tolerance, MAX_SWEEPS)) for tolerance in TOLERANCES]
    return [one.iterations if one.status is Status.SOLVED else None for one in solved]


def main(names: Sequence[str]) -> None:
    """Print the table."""
    print(f"| problem | contacts | to | {' | '.join(RULES)} |\n| --- | ---: | --- |{' ---: |' * len(RULES)}")
    for name in names or PROBLEMS:
        problem = load(name)
        columns = [sweeps(problem, options) for options in RULES.values()]
        for tolerance, *row in zip(TOLERANCES, *columns, strict=True):
            known = [count for count in row if count is not None]
            least = min(known, default=0)
            cells = ["–" if count is None else f"**{count}**" if count == least else f"{count}" for count in row]
            print(f"| `{name}` | {problem.layout.n_blocks} | {tolerance:.0e} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
