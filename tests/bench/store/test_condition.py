"""A run that lacks cases, or whose machine was not steady, says so above its numbers."""

import dataclasses
import io
import math
from pathlib import Path

import pytest
from msgspec.structs import replace
from proxbench import bench
from proxbench.bench import Run, load
from proxbench.bench.report.charts.problems import problem_chart
from proxbench.bench.report.charts.summary import time_chart
from proxbench.bench.report.tables import print_tables, write_tables
from proxbench.bench.store.condition import drift, steadiness, warnings
from proxbench.bench.store.records import Session
from rich.console import Console

REFERENCE = Path(__file__).parents[3] / "results" / "reference"


@pytest.fixture
def stored(finished_run: Path) -> Run:
    return load(finished_run)


def timed(run: Run, *sessions: tuple[list[float], list[float]]) -> Run:
    made = [Session(started="", calibration_seconds=times, load=loads) for times, loads in sessions]
    return dataclasses.replace(run, info=replace(run.info, sessions=made))


def shown(run: Run, folder: Path) -> list[str]:
    """Return all reports of a run."""
    text = io.StringIO()
    print_tables(run, Console(file=text, width=300))
    pages = [file.read_text() for file in write_tables(run, folder) if file.suffix == ".md"]
    problem = run.cases["problem"].iloc[-1]
    charts = [" ".join(chart.title["subtitle"]) for chart in (problem_chart(run, problem), time_chart(run))]
    return [text.getvalue(), *pages, run._repr_html_(), *charts]


def test_drift_is_the_spread_over_all_sessions_and_does_not_depend_on_the_unit(stored: Run) -> None:
    for unit in (1.0, 1e-3):
        sessions = ([2.0 * unit, 3.0 * unit], [0.5]), ([6.0 * unit], [4.0])
        assert drift(timed(stored, *sessions).info) == pytest.approx(3.0)
    assert drift(timed(stored, ([2.0, 2.0], [0.0, 0.0])).info) == 1.0
    assert math.isnan(drift(timed(stored, ([2.0], [0.0])).info))
    assert steadiness(timed(stored, ([2.0, 2.0], [1.5, 1.5])).info).endswith("load 1.5")
    assert "load 0.5 to 4.0" in steadiness(timed(stored, ([2.0, 3.0], [0.5, 1.0]), ([6.0], [4.0])).info)


@pytest.mark.slow
@pytest.mark.parametrize(("slowest", "warned"), [(1.4, False), (1.6, True)])
def test_every_report_states_drift_and_load_and_warns_above_a_limit(
    stored: Run, slowest: float, warned: bool, tmp_path: Path
) -> None:
    run = timed(stored, ([1.0, slowest], [0.25, 7.5]))
    for page in shown(run, tmp_path):
        assert f"drift {slowest:.2f}" in page
        assert "load 0.2 to 7.5" in page
        assert ("UNSTEADY" in page) == warned


@pytest.mark.slow
def test_a_run_without_some_of_its_cases_says_so_first_in_every_report(stored: Run, tmp_path: Path) -> None:
    run = timed(dataclasses.replace(stored, cases=stored.cases.iloc[1:]), ([1.0, 1.0], [0.0, 0.0]))
    assert not run.is_finished
    pages = shown(run, tmp_path)
    for page in pages:
        assert "UNFINISHED: 14 of 15 cases" in page
    printed, html = pages[0], pages[-3]
    assert printed.startswith("UNFINISHED")
    assert f"proxbench run --resume {run.folder}" in printed
    assert f"proxbench.bench.resume(&#x27;{run.folder}&#x27;)" in html


def test_cases_that_are_begun_are_counted_beside_those_that_are_whole(stored: Run) -> None:
    failed = stored.cases["outcome"] != "measured"
    cases, whole = stored.cases.assign(is_finished=failed), failed.sum()
    (sentence,) = warnings(timed(dataclasses.replace(stored, cases=cases), ([1.0, 1.0], [0.0, 0.0])))
    assert sentence.startswith(f"UNFINISHED: {whole} of 15 cases are measured, {15 - whole} more in part; go on with: ")


@pytest.mark.slow
@pytest.mark.parametrize(("problems", "empty"), [(["hard-empty"], True), (["hard-empty", "hard-groove"], False)])
def test_a_run_without_a_contact_says_that_nothing_was_solved(problems: list[str], empty: bool, tmp_path: Path) -> None:
    made = timed(bench.run(problems, "SORprox", results=tmp_path, tolerances=1e-2), ([1.0, 1.0], [0.0, 0.0]))
    assert [sentence.partition(":")[0] for sentence in warnings(made)] == (["EMPTY"] if empty else [])


def test_a_finished_run_on_a_steady_machine_warns_of_nothing(stored: Run) -> None:
    assert warnings(timed(stored, ([1.0, 1.1], [0.0, 0.0]))) == []


def test_a_run_of_the_first_format_is_read_with_its_drift_and_load() -> None:
    run = load(Path(__file__).parent / "format-1")
    assert (len(run.cases), run.is_finished, run.damaged) == (14, False, [])
    (session,) = run.info.sessions
    assert len(session.calibration_seconds) == 9
    assert drift(run.info) == pytest.approx(0.005022923996875761 / 0.0030987579993961845)
    measured = run.points[run.points["residual"].notna()]
    assert measured["total_seconds_q3"].ge(measured["total_seconds"]).all()
