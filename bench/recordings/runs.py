"""Recordings of a stored run: one file a problem, with all solvers that came through side by side."""

from pathlib import Path

from ...solvers.interface import Stop
from ..measure.plan import resolved
from ..store.outcome import Outcome
from ..store.store import Store, plain_name
from .file import SUFFIX
from .solves import RecordedSolves, record_solves

TOLERANCE = 1e-8
"""What recorded solvers are asked for; a run's own ladder ends where most only creep."""

MAX_ITERATIONS = 1000

FOLDER = "recordings"
"""Where they are, in the folder of the run."""


def record_run(run_dir: Path) -> list[RecordedSolves]:
    """Solve the problems of a run once more, observed, and write what happens as recordings into its folder.

    Cases that timed out, crashed or misbehaved when they were measured are left out. Recordings of an earlier call are
    replaced.

    Raises:
        BenchError: if the folder is no run, or cannot be written.
        SolverError: for a solver object that no name makes again.
        ProblemError: for a problem object that no name loads again.
    """
    store = Store.open(run_dir)
    planned = store.read_info()["plan"]
    cases, _ = store.read_cases()
    came_through = {(case["problem"], case["solver"]) for case in cases if case["outcome"] == Outcome.MEASURED}
    stop = Stop(TOLERANCE, MAX_ITERATIONS, planned["limits"]["solve_seconds"])
    made = []
    for name in planned["problems"]:
        solvers = [solver for solver in planned["solvers"] if (name, solver) in came_through]
        if solvers and (problem := resolved(name)).n_contacts:
            file = run_dir / FOLDER / f"{plain_name(name)}{SUFFIX}"
            made.append(record_solves(problem, solvers, stop, file, force=True))
    return made
