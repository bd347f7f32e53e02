"""Shared fixtures: records with numbers that JSON cannot represent and names that are not valid file names."""

import math

import pytest
from proxbench.bench.measure.machine import this_machine
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits, PlanRecord
from proxbench.bench.store.records import CaseRecord, Curve, Point, RunRecord
from stored_cases import case_record, measured_in, timed_round


@pytest.fixture
def case() -> CaseRecord:
    """A crashed case with one point."""
    measured = measured_in(
        [timed_round(0, 1.0, repeats=5)],
        residual=math.inf,
        model_residual=1e-3,
        verdict={"infeasible": False, "velocity_error": math.nan},
    )
    return case_record(
        problem="a/../b",
        solver="S(x='y')",
        model="Coulomb",
        outcome=Outcome.CRASHED,
        curve=Curve(iteration=[1], residual=[math.inf]),
        points=[Point(tolerance=1e-3, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)],
    )


@pytest.fixture(scope="session")
def record() -> RunRecord:
    """A run of one solver on one problem."""
    return RunRecord(
        run_id="run",
        plan=PlanRecord(problems=["p"], solvers=["S"], tolerances=[0.1], limits=Limits()),
        machine=this_machine(),
        plugins=[],
    )
