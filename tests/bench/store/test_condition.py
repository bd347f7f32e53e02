"""A run that lacks cases, or whose machine was not steady, reports this above its numbers."""

import dataclasses
import io
import math
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace
from proxbench import bench
from proxbench.bench import Run, load
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.machine import SETTINGS, this_machine
from proxbench.bench.report.charts.problems import problem_chart
from proxbench.bench.report.charts.summary import time_chart
from proxbench.bench.report.tables import print_tables, write_tables
from proxbench.bench.store.condition import drift, software_differences, steadiness, unfinished, warnings
from proxbench.bench.store.conversion import checksum
from proxbench.bench.store.records import Session
from rich.console import Console
from simulated_runs import simulated_cases, store_run

REFERENCE = Path(__file__).parents[3] / "results" / "reference.bundle"


@pytest.fixture
def stored(finished_run: Path) -> Run:
    return load(finished_run)


def timed(run: Run, probes: tuple[float, float] = (1.0, 1.0), busy: float = 0.0, excluded: str = "") -> Run:
    """Return the run with rounds whose probes took one of two times, while ``busy`` cores were busy."""
    at = (run.rounds.index % 2).map(lambda odd: probes[odd])
    rounds = run.rounds.assign(probe_seconds=at, excluded=excluded)
    points = run.points.assign(is_excluded=bool(excluded))
    session = Session(started="", core=1, busy_cores=[busy, busy], machine=run.info.machine)
    return dataclasses.replace(run, rounds=rounds, points=points, info=replace(run.info, sessions=[session]))


def shown(run: Run, folder: Path) -> list[str]:
    """Return all reports of a run: printed tables, Markdown files, a notebook cell, and the notes of two charts."""
    text = io.StringIO()
    print_tables(run, Console(file=text, width=300))
    pages = [file.read_text() for file in write_tables(run, folder) if file.suffix == ".md"]
    problem = run.cases["problem"].iloc[-1]
    charts = [" ".join(chart.title["subtitle"]) for chart in (problem_chart(run, problem), time_chart(run))]
    return [text.getvalue(), *pages, run._repr_html_(), *charts]


def test_drift_is_the_spread_of_the_probes_and_does_not_depend_on_the_unit(stored: Run) -> None:
    for unit in (1.0, 1e-3):
        assert drift(timed(stored, (2.0 * unit, 3.0 * unit))) == pytest.approx(1.5)
    assert math.isnan(drift(dataclasses.replace(stored, rounds=stored.rounds.iloc[:0])))
    assert "probes differ by a factor of 1.50; other programs used 0.4 cores" in steadiness(
        timed(stored, (2.0, 3.0), 0.4)
    )


def test_settings_that_change_times_are_stored_and_named(stored: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in SETTINGS:
        monkeypatch.delenv(name, raising=False)
    usual = this_machine()
    monkeypatch.setenv("PYTHONTRACEMALLOC", "10")
    tracing = this_machine()
    assert software_differences(usual, tracing) == ["PYTHONTRACEMALLOC none, now 10"]
    session = Session(started="", machine=tracing)
    run = dataclasses.replace(stored, info=replace(stored.info, machine=usual, sessions=[session]))
    assert any(sentence.startswith("SETTINGS: measured with PYTHONTRACEMALLOC=10, ") for sentence in warnings(run))
    quiet = dataclasses.replace(run, info=replace(run.info, sessions=[replace(session, machine=usual)]))
    assert not any(sentence.startswith("SETTINGS") for sentence in warnings(quiet))


def test_a_package_that_one_machine_lacks_differs_and_one_that_both_lack_does_not() -> None:
    machine = this_machine()
    with_peer, unknown = (replace(machine, versions=machine.versions | {"pin": one}) for one in ("4.1.0", ""))
    without = replace(machine, versions={name: one for name, one in machine.versions.items() if name != "pin"})
    assert software_differences(without, with_peer) == ["pin none, now 4.1.0"]
    assert software_differences(without, unknown) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("probes", "busy", "excluded", "keyword", "sentence"),
    [
        pytest.param((1.0, 1.4), 0.1, "", "", "", marks=pytest.mark.weekly),
        ((1.0, 1.6), 0.1, "", "UNSTEADY", "he speed of the core changed by a factor of 1.60"),
        pytest.param(
            (1.0, 1.0), 1.0, "", "BUSY", "ther programs kept 1.0 of the other cores busy", marks=pytest.mark.weekly
        ),
        ((1.0, 1.0), 0.0, "preempted", "EXCLUDED", "were measured while other programs used the core or its speed"),
    ],
)
def test_every_report_states_how_steady_the_machine_was_and_warns_above_a_limit(
    stored: Run,
    probes: tuple[float, float],
    busy: float,
    excluded: str,
    keyword: str,
    sentence: str,
    tmp_path: Path,
) -> None:
    pages = shown(timed(stored, probes, busy, excluded), tmp_path)
    for page in pages:
        # probes of excluded rounds do not count
        assert (f"probes differ by a factor of {probes[1]:.2f}" in page) == (not excluded)
        assert f"other programs used {busy:.1f} cores" in page
        assert sentence in page
    keywords = ("UNSTEADY", "BUSY", "EXCLUDED")
    for page in pages[:-2]:
        assert [word for word in keywords if f"{word}: " in page] == [keyword] * bool(keyword)
    for chart in pages[-2:]:
        assert not any(word in chart for word in (*keywords, "in the cells"))


@pytest.mark.slow
def test_a_run_without_some_of_its_cases_says_so_first_in_every_report(stored: Run, tmp_path: Path) -> None:
    run = timed(dataclasses.replace(stored, cases=stored.cases.iloc[1:]))
    assert not run.is_finished
    pages = shown(run, tmp_path)
    assert all("UNFINISHED: 14 of 15 cases are measured" in page for page in pages[:-2])
    assert all("14 of 15 cases are measured" in chart and "UNFINISHED" not in chart for chart in pages[-2:])
    printed, html = pages[0], pages[-3]
    assert printed.startswith("UNFINISHED")
    assert f"proxbench run --resume {run.folder}" in printed
    assert f"proxbench run --resume {run.folder}" in html


def test_partly_measured_cases_are_counted_separately(stored: Run) -> None:
    failed = stored.cases["outcome"] != "measured"
    cases, whole = stored.cases.assign(is_finished=failed), failed.sum()
    (sentence,) = warnings(timed(dataclasses.replace(stored, cases=cases)))
    assert sentence.startswith(
        f"UNFINISHED: {whole} of 15 cases are measured, {15 - whole} more in part; resume with: "
    )


@pytest.mark.parametrize(("left", "n_named"), [(13, 3), (12, 3), (0, 0)])
def test_warning_lists_at_most_three_missing_cases(left: int, n_named: int, tmp_path: Path) -> None:
    run = load(store_run(tmp_path / "run", simulated_cases(0, solvers=("A", "B"))))
    (sentence,) = unfinished(dataclasses.replace(run, cases=run.cases.iloc[:left]))
    assert sentence.startswith(f"UNFINISHED: {left} of 16 cases are measured")
    missing = [f"{case.solver} on {case.problem}" for case in run.cases.iloc[left:].itertuples()]
    assert [name for name in missing if name in sentence] == missing[:n_named]
    assert (" and 1 more" in sentence) is (left == 12)


@pytest.mark.slow
@pytest.mark.parametrize(("problems", "empty"), [(["hard-empty"], True), (["hard-empty", "hard-groove"], False)])
def test_a_run_without_a_contact_says_that_nothing_was_solved(problems: list[str], empty: bool, tmp_path: Path) -> None:
    made = timed(bench.run(problems, "SORprox", results=tmp_path, tolerances=1e-2))
    assert [sentence.partition(":")[0] for sentence in warnings(made)] == (["EMPTY"] if empty else [])


def test_finished_run_on_a_steady_machine_has_no_warnings(stored: Run) -> None:
    assert warnings(timed(stored, (1.0, 1.1))) == []


@pytest.mark.parametrize("version", [1, 2, 4, "3", None])
def test_a_run_of_another_format_is_refused_in_one_sentence(version: object, tmp_path: Path) -> None:
    body = {"format": version, "run_id": "old"}
    (tmp_path / "run.json").write_bytes(msgspec.json.encode({**body, "checksum": checksum(body)}))
    with pytest.raises(BenchError, match=rf"run.json has format {version!r}, and this version reads format 3"):
        load(tmp_path)
