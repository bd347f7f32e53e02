"""The columns of the frames are the fields of the records, and their values those that were stored."""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest
from proxbench.bench import load
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
from proxbench.bench.store.store import Store
from proxbench.problems import Verdict

TIMES = ("prepare_seconds", "solve_seconds", "total_seconds")


def quartiles(median: float) -> Quartiles:
    return Quartiles(min=median - 2.0, q1=median - 1.0, median=median, q3=median + 1.0)


def stored(folder: Path, points: list[Point]) -> Path:
    store = Store.create(folder)
    plan = PlanRecord(problems=["p"], solvers=["S"], tolerances=[0.1], limits=Limits())
    machine = msgspec.convert(describe_machine(), Machine)
    store.write_run(RunRecord(run_id="r", plan=plan, machine=machine, plugins=[]))
    store.write_case(
        CaseRecord(
            problem="p",
            digest="d",
            solver="S",
            model="coulomb",
            has_iterates=True,
            n_rows=3,
            n_contacts=1,
            outcome=Outcome.MEASURED,
            reason="why",
            traceback="",
            stderr="",
            wall_seconds=0.5,
            peak_memory_bytes=2**40,
            curve=Curve(iteration=[1, 2], residual=[np.inf, 0.25]),
            points=points,
        )
    )
    return folder


NOT_ATTEMPTED = Point(tolerance=1e-2, outcome=Outcome.NOT_ATTEMPTED, status="", reason="why")
MEASURED = Point(
    tolerance=1e-1,
    outcome=Outcome.DIVERGED,
    status="diverged",
    reason="",
    measured=Measured(
        iterations=7,
        residual=np.inf,
        model_residual=0.5,
        prepare_seconds=quartiles(3.0),
        solve_seconds=quartiles(4.0),
        total_seconds=quartiles(7.0),
        repeats=1,
        verdict={"residual": 99.0, "complementarity": 0.125, "velocity_error": None, "infeasible": False, "new": 1.0},
        impulse_error=None,
    ),
)


@pytest.mark.parametrize("points", [[], [NOT_ATTEMPTED], [MEASURED, NOT_ATTEMPTED]])
def test_columns_are_the_fields_of_the_records_however_little_was_measured(points: list[Point], tmp_path: Path) -> None:
    run = load(stored(tmp_path / "run", points))
    lists = {"curve", "points"}
    assert set(run.cases) == set(CaseRecord.__struct_fields__) - lists | {"is_finished"}
    numbers = {*Measured.__struct_fields__, *(field.name for field in dataclasses.fields(Verdict))}
    numbers -= {"verdict", "errors", "rounds", "hashes", "component_residuals"}
    spread = {f"{time}_{part}" for time in TIMES for part in ("min", "q1", "q3")}
    identity = {"problem", "solver", "model"}
    assert set(run.points) == identity | (set(Point.__struct_fields__) - {"measured"}) | numbers | spread
    assert len(run.points) == len(points)
    assert run.points["residual"].dtype == run.points["iterations"].dtype == np.float64


def test_values_are_those_that_were_stored(tmp_path: Path) -> None:
    run = load(stored(tmp_path / "run", [MEASURED, NOT_ATTEMPTED]))
    case, (measured, missing) = run.cases.iloc[0], run.points.to_dict("records")
    assert (case["outcome"], case["n_rows"], case["peak_memory_bytes"]) == ("measured", 3, 2**40)
    assert [measured[f"total_seconds{part}"] for part in ("_min", "_q1", "", "_q3")] == [5.0, 6.0, 7.0, 8.0]
    assert (measured["iterations"], measured["complementarity"], measured["infeasible"]) == (7, 0.125, False)
    assert run.iterations["iteration"].tolist() == [1, 2]
    assert missing["outcome"] == Outcome.NOT_ATTEMPTED
    assert np.isnan([missing[name] for name in ("residual", "iterations", "total_seconds", "complementarity")]).all()


def test_a_residual_that_is_no_number_is_infinite_and_any_other_number_unknown(tmp_path: Path) -> None:
    run = load(stored(tmp_path / "run", [MEASURED]))
    point = run.points.iloc[0]
    assert point["residual"] == np.inf
    assert point["model_residual"] == 0.5
    assert run.iterations["residual"].tolist() == [np.inf, 0.25]
    assert np.isnan(point["velocity_error"])
    assert np.isnan(point["impulse_error"])
