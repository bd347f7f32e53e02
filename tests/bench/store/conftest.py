"""Shared: records of a run and of a case, with numbers that JSON cannot write and names that are no file names."""

import math

import msgspec
import pytest
from proxbench.bench.measure.machine import describe_machine
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import (
    CaseRecord,
    Curve,
    Limits,
    Machine,
    Measured,
    PlanRecord,
    Point,
    Quartiles,
    RunRecord,
)

TIMES = Quartiles(min=1.0, q1=1.0, median=1.0, q3=1.0)


@pytest.fixture
def case() -> CaseRecord:
    """A crashed case with one point."""
    measured = Measured(
        iterations=3,
        residual=math.inf,
        model_residual=1e-3,
        prepare_seconds=TIMES,
        solve_seconds=TIMES,
        total_seconds=TIMES,
        repeats=5,
        verdict={"infeasible": False, "velocity_error": math.nan},
        impulse_error=None,
    )
    return CaseRecord(
        problem="a/../b",
        digest="0",
        solver="S(x='y')",
        model="Coulomb",
        has_iterates=True,
        n_rows=3,
        n_contacts=1,
        outcome=Outcome.CRASHED,
        reason="",
        traceback="",
        stderr="",
        wall_seconds=1.5,
        peak_memory_bytes=2**40,
        curve=Curve(iteration=[1], residual=[math.inf]),
        points=[Point(tolerance=1e-3, outcome=Outcome.SOLVED, status="solved", reason="", measured=measured)],
    )


@pytest.fixture(scope="session")
def record() -> RunRecord:
    """A run of one solver on one problem."""
    return RunRecord(
        run_id="run",
        plan=PlanRecord(problems=["p"], solvers=["S"], tolerances=[0.1], limits=Limits()),
        machine=msgspec.convert(describe_machine(), Machine),
        plugins=[],
    )
