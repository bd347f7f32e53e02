"""What tables count and average: times above the limit count as the limit, and wrong claims do not count."""

from dataclasses import replace as changed
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import replace
from proxbench.bench import load
from proxbench.bench.report.accuracy import (
    families,
    mean_time,
    problems_table,
    ratios_table,
    starts_table,
    summary_table,
)
from proxbench.bench.report.cells import (
    duration,
    shown_families,
    shown_points,
    shown_results,
    shown_starts,
    shown_summary,
)
from proxbench.bench.report.tables import print_tables, results_table, write_tables
from proxbench.bench.store.frames import RunFrames
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.bench.store.records import CaseRecord, Point
from rich.console import Console
from simulated_runs import solved_point, store_run
from stored_cases import case_record, measured_in, timed_round

LIMITS = Limits(solve_seconds=1.0)


def test_times_beyond_the_limit_and_missing_ones_count_as_the_limit() -> None:
    at_limit = mean_time(np.array([0.1, 1.0]), 1.0)
    for seconds in (50.0, 1.0 + 1e-9, np.nan):
        assert mean_time(np.array([0.1, seconds]), 1.0) == at_limit
    assert 0.1 < mean_time(np.array([0.1, 0.9]), 1.0) < at_limit < 1.0
    assert np.isnan(mean_time(np.zeros(0), 1.0))
    assert mean_time(np.full(3, 0.25), 1.0) == pytest.approx(0.25)


def wrong(residual: float) -> Point:
    measured = measured_in([timed_round(0, 1e-3)], residual=residual, model_residual=residual)
    return Point(tolerance=1e-2, outcome=Outcome.WRONG, status="solved", reason="", measured=measured)


def case(solver: str, *points: Point, problem: str = "p", outcome: Outcome = Outcome.MEASURED) -> CaseRecord:
    return case_record(problem=problem, solver=solver, points=list(points), outcome=outcome, digest="0" * 64)


def test_the_best_residual_of_a_problem_excludes_wrong_claims(tmp_path: Path) -> None:
    cases = [case("Honest", solved_point(1e-2, [timed_round(0, 0.5)])), case("Liar", wrong(1e-9)), case("Idle")]
    (row,) = problems_table(load(store_run(tmp_path / "run", cases, limits=LIMITS))).to_dict("records")
    assert (row["best"], row["residual"]) == ("Honest", 5e-3)
    assert (row["solvers"], row["solved_1e-02"], row["fastest_1e-02"]) == (2, 1, "Honest")
    assert row["time_1e-02"] == pytest.approx(0.5)


def test_times_are_compared_between_equal_numbers_of_threads(tmp_path: Path) -> None:
    seconds = {"A": (0.2, 1), "B": (0.4, 1), "C": (0.1, 2), "D": (0.3, 2)}
    cases = [
        replace(case(name, solved_point(1e-2, [timed_round(turn, time) for turn in range(5)])), threads=threads)
        for name, (time, threads) in seconds.items()
    ]
    frames = load(store_run(tmp_path / "run", cases, limits=LIMITS))
    ratios = ratios_table(frames).set_index("solver")["ratio"]
    assert ratios.to_dict() == pytest.approx({"A": 1.0, "B": 2.0, "C": 1.0, "D": 3.0})
    (row,) = problems_table(frames).to_dict("records")
    assert (row["solved_1e-02"], row["fastest_1e-02"]) == (4, "A")
    console = Console(file=StringIO(), width=200)
    print_tables(frames, console)
    assert "threads" in console.file.getvalue()  # type: ignore[attr-defined]


def test_a_solver_that_uses_fewer_threads_than_it_declares_is_compared_by_those_that_it_uses(tmp_path: Path) -> None:
    """D uses both threads on the problem q; its time on p is therefore not compared with those of one thread.

    B does not support q, where its number is unknown.
    """
    used = {("A", "p"): (1, 0), ("B", "p"): (2, 1), ("C", "p"): (2, 2), ("D", "p"): (2, 1), ("D", "q"): (2, 2)}
    cases = [
        replace(case(solver, *timed_points(time), problem=problem), threads=declared, threads_used=number)
        for ((solver, problem), (declared, number)), time in zip(used.items(), (0.2, 0.1, 0.4, 0.8, 0.8), strict=True)
    ]
    cases.append(replace(case("B", problem="q", outcome=Outcome.UNSUPPORTED), threads=2))
    frames = load(store_run(tmp_path / "run", cases, limits=LIMITS))
    ratios = ratios_table(frames).set_index(["problem", "solver"])["ratio"]
    assert ratios["p"].to_dict() == pytest.approx({"A": 2.0, "B": 1.0, "C": 1.0, "D": 2.0})
    shown = shown_results(results_table(frames), {})
    assert shown[shown["problem"] == "p"]["threads"].tolist() == ["1", "1 of 2", "2", "1 of 2"]


def timed_points(time: float) -> list[Point]:
    return [solved_point(1e-2, [timed_round(turn, time) for turn in range(5)])]


def test_summary_counts_claims_and_answers_and_charges_failures_the_time_limit(tmp_path: Path) -> None:
    cases = [
        case("A", solved_point(1e-2, [timed_round(0, 0.1)])),
        case("B", wrong(0.5)),
        case("A", solved_point(1e-2, [timed_round(0, 0.3)]), problem="q"),
        case("B", solved_point(1e-2, [timed_round(0, 0.2)]), problem="q"),
        case("A", solved_point(1e-2, [timed_round(0, 0.1)]), problem="r"),
        case("B", problem="r", outcome=Outcome.UNSUPPORTED),
    ]
    frames = load(store_run(tmp_path / "run", cases, limits=LIMITS))
    found = summary_table(frames).set_index("solver")
    assert list(found["problems"]) == [3, 2]
    assert list(found["common"]) == [2, 2]
    assert list(found["success_1e-02"]) == [1.0, 1.0]
    assert list(found["correct_1e-02"]) == [1.0, 0.5]
    assert list(found["wrong"]) == [0, 1]
    means = [mean_time(np.array(times), 1.0) for times in ([0.1, 0.3], [np.nan, 0.2])]
    assert list(found["mean_time_1e-02"]) == pytest.approx(means)
    own = [mean_time(np.array(times), 1.0) for times in ([0.1, 0.3, 0.1], [np.nan, 0.2])]
    assert list(found["own_mean_time_1e-02"]) == pytest.approx(own)
    assert families(frames) == []


def test_excluded_times_take_part_in_no_mean(tmp_path: Path) -> None:
    excluded = timed_round(0, 0.1, excluded="preempted")
    cases = [
        case("A", solved_point(1e-2, [timed_round(0, 0.1)])),
        case("B", solved_point(1e-2, [excluded])),
        case("A", solved_point(1e-2, [timed_round(0, 0.3)]), problem="q"),
        case("B", solved_point(1e-2, [timed_round(0, 0.2)]), problem="q"),
    ]
    cases = [replace(one, digest=str(number)) for number, one in zip((0, 0, 1, 1), cases, strict=True)]
    found = summary_table(load(store_run(tmp_path / "run", cases, limits=LIMITS))).set_index("solver")
    assert list(found["mean_time_1e-02"]) == pytest.approx([0.3, 0.2])
    assert list(found["own_mean_time_1e-02"]) == pytest.approx([mean_time(np.array([0.1, 0.3]), 1.0), 0.2])


def test_files_mark_excluded_times(tmp_path: Path) -> None:
    """A spreadsheet shows only the columns of the CSV file."""
    excluded, counted = timed_round(0, 0.1, excluded="preempted"), timed_round(0, 0.2)
    points = solved_point(1e-4, [excluded]), solved_point(1e-8, [counted])
    frames = load(store_run(tmp_path / "run", [case("A", *points), case("B", points[1])], limits=LIMITS))
    write_tables(frames, tmp_path)
    table = pd.read_csv(tmp_path / "results.csv", keep_default_na=False).set_index("solver")
    assert table.loc["B", "excluded"] == ""
    assert table.loc["A", "excluded"].split() == [tag for tag in ("1e-02", "1e-04") if f"time_to_{tag}" in table]
    assert "100 ms*" in (tmp_path / "results.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("excluded", "mark"), [("preempted", "*"), ("", "")])
def test_points_of_a_study_mark_excluded_times(excluded: str, mark: str, tmp_path: Path) -> None:
    point = solved_point(1e-2, [timed_round(0, 0.1, excluded=excluded)])
    frames = load(store_run(tmp_path / "run", [case("A", point)], limits=LIMITS))
    points = frames.points.assign(
        quantity="error", error=0.0, low=0.0, high=0.0, failed_members=0.0, unsolved_steps=0.0
    )
    assert shown_points(points)["wall"].tolist() == [f"100 ms{mark}"]


def test_points_of_a_study_without_any_time_have_dashes(tmp_path: Path) -> None:
    frames = load(store_run(tmp_path / "run", [case("A", solved_point(1e-2, [timed_round(0, 0.1)]))], limits=LIMITS))
    numbers = dict.fromkeys(("error", "low", "high", "failed_members", "unsolved_steps"), np.nan)
    times = dict.fromkeys(("total_seconds", "processor_seconds"), np.nan)
    points = frames.points.assign(quantity="error", is_excluded=None, **numbers, **times)
    shown = shown_points(points)
    assert (shown["wall"].tolist(), shown["CPU"].tolist()) == (["–"], ["–"])


def test_means_name_the_number_of_their_problems_where_times_are_excluded(tmp_path: Path) -> None:
    cases = [
        case(solver, solved_point(1e-2, [timed_round(0, 0.1)]), problem=problem) for problem in "pqr" for solver in "AB"
    ]
    frames = load(store_run(tmp_path / "run", cases, limits=LIMITS))
    is_excluded = (frames.points["solver"] == "B") & (frames.points["problem"] != "r")
    found = summary_table(changed(frames, points=frames.points.assign(is_excluded=is_excluded))).set_index("solver")
    assert list(found["common"]) == [3, 3]
    assert list(found["mean_problems_1e-02"]) == [1, 1]
    assert list(found["own_problems_1e-02"]) == [3, 1]
    (column,) = (name for name in shown_summary(found.reset_index()) if name.startswith("mean"))
    assert list(shown_summary(found.reset_index())[column]) == [f"{duration(0.1)} (1)"] * 2
    of_family = shown_families(["A", "B"], found.reset_index().assign(family="sticking"), ["1e-02"])
    assert list(of_family["sticking"]) == [f"3/3 {duration(0.1)} (1)"] * 2


def test_the_legend_explains_the_dash_of_a_mean_only_if_excluded_times_leave_no_problem(tmp_path: Path) -> None:
    cases = [case(solver, solved_point(1e-2, [timed_round(0, 0.1)]), problem=name) for name in "pq" for solver in "AB"]
    frames = load(store_run(tmp_path / "run", cases, limits=LIMITS))
    for is_excluded in (False, True):
        console = Console(file=StringIO(), width=120)
        print_tables(changed(frames, points=frames.points.assign(is_excluded=is_excluded)), console)
        _, _, summary = console.file.getvalue().partition("all 2 problems")  # type: ignore[attr-defined]
        assert ("–: over none." in summary) is is_excluded
        (row,) = (line.split() for line in summary.splitlines() if line.startswith("A "))
        assert ("–" in row) is is_excluded


def test_notes_of_solved_cases_are_printed_below_their_table(tmp_path: Path) -> None:
    cases = [case("A", solved_point(1e-2, [timed_round(0, 0.1)])), case("B", solved_point(1e-2, [timed_round(0, 0.1)]))]
    frames = load(store_run(tmp_path / "run", cases, limits=LIMITS))
    notes = np.where(frames.points["solver"] == "B", "the local residual is 5e+03 times the judged one", "")
    console = Console(file=StringIO(), width=120)
    print_tables(changed(frames, points=frames.points.assign(notes=notes)), console)
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert [line.strip() for line in lines if "local residual" in line] == [
        "B: at 1e-02: the local residual is 5e+03 times the judged one"
    ]


def test_the_table_of_starts_compares_the_problems_solved_both_ways(tmp_path: Path) -> None:
    def both(problem: str, cold: float, warm: float) -> list[CaseRecord]:
        points = [solved_point(1e-2, [timed_round(0, seconds)]) for seconds in (cold, warm)]
        return [case(name, point, problem=problem) for name, point in zip(("S", "Warm(S)"), points, strict=True)]

    cases = [*both("p", 0.4, 0.1), *both("q", 0.1, 0.2), case("S", wrong(0.5), problem="r")]
    cases += [case("Warm(S)", solved_point(1e-2, [timed_round(0, 0.1)]), problem="r")]
    cases += [case("S", solved_point(1e-2, [timed_round(0, 0.1)]), problem="first")]
    cases += [case("Warm(S)", problem="first", outcome=Outcome.UNSUPPORTED)]
    rows = starts_table(load(store_run(tmp_path / "run", cases, limits=LIMITS))).set_index("family")
    solved = rows["cold_solved"].sum(), rows["warm_solved"].sum()
    assert (rows["problems"].sum(), *solved, rows["timed"].sum()) == (3, 2, 3, 2)
    assert list(rows.loc[["p", "q"], "gain"]) == pytest.approx([4.0, 0.5])
    assert list(rows.loc[["p", "q"], "slower"]) == [0, 1]
    assert np.isnan(rows.loc["r", "gain"])


def test_rows_of_starts_with_similar_tolerances_differ(tmp_path: Path) -> None:
    points = [solved_point(tolerance, [timed_round(0, 0.1)]) for tolerance in (1.4e-4, 1.2e-4)]
    cases = [case(name, *points) for name in ("S", "Warm(S)")]
    table = starts_table(load(store_run(tmp_path / "run", cases, limits=LIMITS)))
    assert shown_starts(table)["to"].tolist() == ["1.4e-04", "1.2e-04"]


def test_a_run_without_warm_solvers_has_no_table_of_starts(finished: RunFrames) -> None:
    assert starts_table(finished).empty
