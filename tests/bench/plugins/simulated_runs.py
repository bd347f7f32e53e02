"""Runs from a model of noise, without measurements: processes, rounds, disturbances and whole runs scatter."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits, PlanRecord
from proxbench.bench.store.records import CaseRecord, Machine, Point, Round, RunRecord, Session
from proxbench.bench.store.store import Store
from proxbench.problems import ContactProblem
from proxbench.problems.arrays import FloatArray
from stored_cases import case_record, measured_in, timed_round

PROCESS, ROUND, RUN = 0.05, 0.03, 0.03
"""Standard deviations of logarithms of times: between processes, rounds and runs."""

DISTURBED, DISTURBANCE = 0.1, 0.5
"""Share of disturbed rounds, and the mean logarithm of the factor by which they take longer."""

SOLVERS = ("A", "B", "C", "D", "E", "F", "G", "H")
PROBLEMS = tuple(f"p-{number}" for number in range(8))
ACCURACIES = (1e-2, 1e-6)

MACHINE = Machine(
    processor="P",
    cores=2,
    logical_cores=4,
    memory_bytes=2**33,
    system="S",
    python="3.12",
    versions={"numpy": "2"},
    thread_pools=[],
    commit="",
    dirty=False,
    source="0" * 64,
)


def seconds_of(place: int) -> float:
    """Return the true time of a case by its place [s]: from 0.1 ms to 10 ms."""
    return float(1e-4 * 10.0 ** (2.0 * (place * 0.37 % 1.0)))


def rounds_of(chance: np.random.Generator, seconds: float, processes: FloatArray) -> list[Round]:
    """Return two rounds of each pass, each pass in its own process."""
    rounds = []
    for (number, process), turn in itertools.product(enumerate(processes), range(2)):
        noise = process + chance.normal(0.0, ROUND)
        noise += chance.exponential(DISTURBANCE) if chance.random() < DISTURBED else 0.0
        rounds.append(timed_round(number, seconds * float(np.exp(noise)), turn=turn))
    return rounds


def solved_point(tolerance: float, rounds: list[Round]) -> Point:
    """Return a point that is solved."""
    measured = measured_in(rounds, residual=0.5 * tolerance, model_residual=0.5 * tolerance)
    return Point(tolerance=tolerance, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)


def simulated_cases(
    seed: int, factors: Mapping[str, float] | None = None, passes: int = 3, solvers: tuple[str, ...] = SOLVERS
) -> list[CaseRecord]:
    """Return the cases of a run; times of some solvers, or on one problem ("A on p-0"), are multiplied by a factor."""
    chance, factors = np.random.default_rng(seed), factors or {}
    of_run = float(np.exp(chance.normal(0.0, RUN)))
    cases = []
    for place, (problem, solver) in enumerate(itertools.product(PROBLEMS, solvers)):
        factor = factors.get(solver, 1.0) * factors.get(f"{solver} on {problem}", 1.0)
        seconds = of_run * factor * seconds_of(place)
        processes = chance.normal(0.0, PROCESS, passes)
        points = [
            solved_point(accuracy, rounds_of(chance, (1 + step) * seconds, processes))
            for step, accuracy in enumerate(ACCURACIES)
        ]
        cases.append(case_record(problem=problem, solver=solver, points=points, digest="0" * 64))
    return cases


def store_run(
    folder: Path,
    cases: list[CaseRecord],
    machine: Machine = MACHINE,
    problems: Sequence[ContactProblem] = (),
    **others: Any,
) -> Path:
    """Write a run of these cases that stores some problems; return its folder.

    ``others`` are fields of its record, its limits and its number of passes.
    """
    tolerances = {point.tolerance for case in cases for point in case.points} or ACCURACIES
    plan = PlanRecord(
        problems=list(dict.fromkeys(case.problem for case in cases)),
        solvers=list(dict.fromkeys(case.solver for case in cases)),
        tolerances=sorted(tolerances, reverse=True),
        limits=others.pop("limits", Limits()),
        passes=others.pop("passes", 1),
    )
    store = Store.create(folder)
    session = Session(started="2026-01-01", core=1, busy_cores=[0.0, 0.0], machine=machine)
    carried = {problem.name: problem.digest for problem in problems}
    others = {"plugins": [], "sessions": [session], "carried": carried, **others}
    record = RunRecord(run_id=folder.name, plan=plan, machine=machine, plugins=others["plugins"])
    store.write_run(msgspec.structs.replace(record, **others))
    for problem in problems:
        store.write_problem(problem)
    for case in cases:
        store.write_case(case)
    return folder
