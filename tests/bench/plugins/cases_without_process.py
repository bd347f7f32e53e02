"""Cases without a process, with their problem, points and answers."""

from typing import Any

import numpy as np
from msgspec.structs import replace
from proxbench.bench.measure.contacts.case import Case, MeasuredRound
from proxbench.bench.measure.ladder import CasePass
from proxbench.bench.measure.timed_round import TimedRound
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.plans import Limits
from proxbench.bench.store.records import Point
from proxbench.problems import ContactProblem
from proxbench.solvers import Status
from stored_cases import case_record, timed_round

PROBLEM = ContactProblem.from_delassus(np.diag([2.0, 1.0, 1.0]), (-1.0, 0.6, 0.8), 0.3, name="sliding")
SOLUTION = np.array([0.5, -0.15 * 0.6, -0.15 * 0.8])
"""Impulses of a sliding contact: Λ_N = 1/2, and friction μ Λ_N = 0.15 against c_T, whose length is 1."""

LADDER = (1e-2, 1e-4, 1e-6)


def made_case(*points: Point, number: int = 0, limits: Limits | None = None, solver: str = "SORprox") -> Case:
    """Return a case without a process that has some points already."""
    stored = case_record(points=list(points)) if points else None
    return Case(
        PROBLEM,
        solver_spec(solver),
        limits or Limits(),
        LADDER,
        problem_data=b"",
        stored=stored,
        case_pass=CasePass(0, number),
    )


def timed(seconds: float = 1e-3, count: int = 1, **changes: Any) -> TimedRound:
    """Return solves that take ``seconds`` each, a tenth of which to prepare."""
    plain = {
        "status": Status.SOLVED,
        "iterations": 5,
        "message": "",
        "prepare": [0.1 * seconds] * count,
        "solve": [0.9 * seconds] * count,
        "processor": [seconds] * count,
        "involuntary": 0,
        "voluntary": 0,
        "waited": 0.0,
    }
    return TimedRound(**{**plain, **changes})


def measured_round(
    seconds: float = 1e-3, excluded: str = "", impulses: np.ndarray = SOLUTION, **changes: Any
) -> MeasuredRound:
    record, rows = timed_round(0, seconds, excluded=excluded), np.atleast_2d(impulses)
    made = timed(seconds, **changes)
    return MeasuredRound(replace(made, answer_iterations=[made.iterations] * len(rows)), record, rows)
