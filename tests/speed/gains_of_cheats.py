"""Print the gain of each cheat of the catalogue if nothing is compared.

    PYTHONPATH=tests/faults/cheats python tests/speed/gains_of_cheats.py

The gain is 1 − t/t₀. Here t is the median time of the cheat's solves by the clock in its process, and t₀ that of the
honest solver on the same problem; both solvers take turns.
"""

import multiprocessing
import sys
import tempfile
from pathlib import Path

import numpy as np
from catalogue import DECISION, make_cheat
from cheating_solvers import Honest
from proxbench.bench.measure.contacts.case_process import Measurement
from proxbench.bench.measure.contacts.variants import perturbed_copy
from proxbench.problems import ContactProblem, load
from proxbench.solvers import Stop, create

STOPS = (Stop(tolerance=1e-2), Stop(tolerance=1e-4))
"""Ladder of a case; the last tolerance is timed."""

ROUND_SECONDS, TURNS = 0.1, 3


class Unchecked(Measurement):
    """A measurement that compares nothing before and after."""

    def _check_after(self, problem: ContactProblem) -> None:
        pass

    def _check_threads(self) -> None:
        pass


def median_seconds(name: str, folder: str) -> float:
    """Return the median time of a solve by a cheat, or by the honest solver if a dash precedes the name."""
    create("SORprox")  # already imported, as in the process of a case
    cheat = make_cheat(name.removeprefix("-"), Path(folder))
    solver = Honest() if name.startswith("-") else cheat
    problem = load(cheat.tried_on).anonymous()
    measurement = Unchecked(perturbed_copy(problem), solver)
    measurement.unsupported_reason()
    measurement.warm_up(STOPS[0])
    measurement.problem = problem
    for stop in STOPS:
        measurement.unsupported_reason()
        measurement.observe(stop)
        rounds = [measurement.round(stop, ROUND_SECONDS)[0] for _ in range(3)]
    return float(np.median([second for one in rounds for second in one.totals[1:]]))


def main() -> None:
    """Measure and print."""
    rows = [line.split("|") for line in DECISION.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    names = [row[1].strip(" `") for row in rows if "%" in row[3]]
    context = multiprocessing.get_context("spawn")
    for name in sys.argv[1:] or names:
        times: dict[str, list[float]] = {name: [], f"-{name}": []}
        for _ in range(TURNS):
            for one, found in times.items():
                with tempfile.TemporaryDirectory() as folder, context.Pool(1) as pool:
                    found.append(pool.apply(median_seconds, (one, folder)))
        own, honest = (float(np.median(found)) for found in times.values())
        print(
            f"{name:28s} {1e6 * honest:8.0f} → {1e6 * own:8.0f} µs: gain {100 * (1 - own / honest):.0f} %", flush=True
        )


if __name__ == "__main__":
    main()
