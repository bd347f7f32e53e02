"""The columns of the frames are the fields of the records, with the stored values."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from proxbench.bench import load
from proxbench.bench.errors import BenchError
from proxbench.bench.store.conversion import content_of, record_of
from proxbench.bench.store.fields import Quartiles
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import CaseRecord, Curve, Measured, ObservedSolve, Point, RunRecord
from proxbench.bench.store.store import Store
from proxbench.problems import Verdict

TIMES = ("prepare_seconds", "solve_seconds", "total_seconds", "processor_seconds")


Stored = Callable[[list[Point]], Path]


def quartiles(median: float) -> Quartiles:
    return Quartiles(min=median - 2.0, q1=median - 1.0, median=median, q3=median + 1.0)


@pytest.fixture
def stored(case: CaseRecord, record: RunRecord, tmp_path: Path) -> Stored:
    """Store a run of one case with these points, and return its folder."""

    def store(points: list[Point]) -> Path:
        made = Store.create(tmp_path / "run")
        made.write_run(record)
        curve = Curve(iteration=[1, 2], residual=[np.inf, 0.25])
        made.write_case(replace(case, problem="p", solver="S", outcome=Outcome.MEASURED, curve=curve, points=points))
        return made.folder

    return store


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
        processor_seconds=quartiles(6.0),
        repeats=1,
        verdict={"residual": 99.0, "complementarity": 0.125, "velocity_error": None, "infeasible": False, "new": 1.0},
        impulse_error=None,
    ),
)


@pytest.mark.parametrize("points", [[], [NOT_ATTEMPTED], [MEASURED, NOT_ATTEMPTED]])
def test_columns_are_the_fields_of_the_records_however_little_was_measured(points: list[Point], stored: Stored) -> None:
    run = load(stored(points))
    lists = {"curve", "points"}
    assert set(run.cases) == set(CaseRecord.__struct_fields__) - lists | {"family", "is_finished", "is_tried"}
    numbers = {*Measured.__struct_fields__, *(field.name for field in dataclasses.fields(Verdict))}
    numbers |= set(ObservedSolve.__struct_fields__)
    numbers -= {"observed", "verdict", "errors", "rounds", "hashes", "impulses", "component_residuals"}
    numbers -= {"first_seconds", "first_repeated_seconds", "copy_seconds", "copy_repeated_seconds"}
    spread = {f"{time}_{part}" for time in TIMES for part in ("min", "q1", "q3")}
    identity = {"problem", "family", "solver", "model"}
    assert set(run.points) == identity | (set(Point.__struct_fields__) - {"measured"}) | numbers | spread | {"notes"}
    assert len(run.points) == len(points)
    assert run.points["residual"].dtype == run.points["iterations"].dtype == np.float64


def test_frames_contain_the_stored_values(stored: Stored) -> None:
    run = load(stored([MEASURED, NOT_ATTEMPTED]))
    case, (measured, missing) = run.cases.iloc[0], run.points.to_dict("records")
    assert (case["outcome"], case["n_rows"], case["peak_memory_bytes"]) == ("measured", 3, 2**40)
    assert [measured[f"total_seconds{part}"] for part in ("_min", "_q1", "", "_q3")] == [5.0, 6.0, 7.0, 8.0]
    assert [measured[f"processor_seconds{part}"] for part in ("_min", "_q1", "", "_q3")] == [4.0, 5.0, 6.0, 7.0]
    assert (measured["iterations"], measured["complementarity"], measured["infeasible"]) == (7, 0.125, False)
    assert run.iterations["iteration"].tolist() == [1, 2]
    assert missing["outcome"] == Outcome.NOT_ATTEMPTED
    assert np.isnan([missing[name] for name in ("residual", "iterations", "total_seconds", "complementarity")]).all()


def test_nan_residual_becomes_infinite_and_other_nan_values_become_unknown(stored: Stored) -> None:
    run = load(stored([MEASURED]))
    point = run.points.iloc[0]
    assert point["residual"] == np.inf
    assert point["model_residual"] == 0.5
    assert run.iterations["residual"].tolist() == [np.inf, 0.25]
    assert np.isnan(point["velocity_error"])
    assert np.isnan(point["impulse_error"])


def judged(residual: float, local: float | None) -> Point:
    """A measured point with these residuals."""
    assert MEASURED.measured is not None
    verdict = {} if local is None else {"local_residual": local}
    return replace(MEASURED, measured=replace(MEASURED.measured, residual=residual, verdict=verdict))


def test_points_switch_between_judged_and_local_residuals_and_curves_do_not(stored: Stored) -> None:
    points = [judged(1e-3, 0.25), judged(np.inf, np.inf), NOT_ATTEMPTED]
    run = load(stored(points))
    local = run.judged_by("local")
    assert (run.residual, local.residual) == ("judged", "local")
    np.testing.assert_array_equal(local.points["residual"], [0.25, np.inf, np.nan])
    np.testing.assert_array_equal(local.points["local_residual"], run.points["local_residual"])
    assert local.iterations.equals(run.iterations)
    assert local.judged_by("judged").points["residual"].equals(run.points["residual"])
    assert run.judged_by("judged") is run


@pytest.mark.parametrize(
    ("residual", "words"), [("locl", "no residual 'locl'; did you mean 'local'"), ("local", "has no local residuals")]
)
def test_a_residual_that_a_run_does_not_have_is_refused(residual: str, words: str, stored: Stored) -> None:
    run = load(stored([judged(1e-3, None)]))
    with pytest.raises(BenchError, match=words):
        run.judged_by(residual)


def test_families_are_those_of_the_plan_and_of_the_names_in_older_runs(stored: Stored, record: RunRecord) -> None:
    folder = stored([MEASURED])
    assert load(folder).cases["family"].tolist() == load(folder).points["family"].tolist() == ["p"]
    named = replace(record, plan=replace(record.plan, families={"p": "mine"}))
    Store.open(folder).write_run(named)
    assert load(folder).cases["family"].tolist() == load(folder).points["family"].tolist() == ["mine"]


def test_a_case_that_was_stored_without_a_start_started_from_zero(case: CaseRecord) -> None:
    content = content_of(replace(case, start="0" * 16))
    del content["start"]
    assert record_of(content, CaseRecord).start == ""


def test_a_case_that_is_not_planned_is_named_and_left_out(stored: Stored, case: CaseRecord) -> None:
    folder = stored([])
    Store.open(folder).write_case(replace(case, problem="elsewhere", solver="S"))
    run = load(folder)
    assert run.cases["problem"].tolist() == ["p"]
    assert run.damaged == ["elsewhere--S.json contains a case that is not in the plan of the run; remove this file."]
