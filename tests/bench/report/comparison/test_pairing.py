"""Only comparable parts of two runs are compared, omitted parts are named, and invalid runs are refused."""

from pathlib import Path

import msgspec
import pytest
from proxbench.bench import compare, load
from proxbench.bench.errors import BenchError
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import CaseRecord, Session
from simulated_runs import MACHINE, simulated_cases, store_run
from stored_cases import case_record


@pytest.fixture
def before(tmp_path: Path) -> Path:
    return store_run(tmp_path / "before", simulated_cases(0))


@pytest.mark.slow
def test_times_of_another_machine_are_not_compared_but_what_is_solved_is(tmp_path: Path, before: Path) -> None:
    slower = [case for case in simulated_cases(1, {"A": 9.0}) if case.solver != "B"]
    crashed = {"outcome": Outcome.CRASHED, "points": []}
    worse = [msgspec.structs.replace(case, **(crashed if case.solver == "C" else {})) for case in slower]
    found = compare(before, store_run(tmp_path / "after", worse, msgspec.structs.replace(MACHINE, processor="Q")))
    assert found.incomparable_reason == "the machines differ: processor P, now Q"
    assert found.points.empty
    assert not found.slower()
    assert set(found.changed("unsolved")["solver"]) == {"C"}
    assert any(note.startswith("solvers only in ") and note.endswith("before: B") for note in found.notes)
    assert found.failures(["time>10%", "solved<"])[0].startswith("time>10% cannot be decided: the machines differ")


@pytest.mark.slow
def test_problems_of_other_numbers_are_left_out_and_named(tmp_path: Path, before: Path) -> None:
    cases = simulated_cases(1, {"A on p-2": 9.0})
    changed = [msgspec.structs.replace(case, digest="1" * 64) if case.problem == "p-2" else case for case in cases]
    found = compare(before, store_run(tmp_path / "after", changed))
    assert "p-2" not in set(found.cases["problem"])
    assert "omitted because the numbers of these problems differ: p-2" in found.notes
    assert not found.slower()


def test_cases_of_other_numbers_of_threads_are_left_out_and_named_but_not_those_that_fail(tmp_path: Path) -> None:
    """The number of threads of a case without a timed solve is unknown."""
    cases = [
        msgspec.structs.replace(case, threads=2, threads_used=1) for case in simulated_cases(0, solvers=("A", "B"))
    ]
    crashed = {"outcome": Outcome.CRASHED, "points": [], "threads_used": 0}
    changes = {("A", "p-1"): {"threads_used": 2}, ("B", "p-1"): crashed}
    changed = [msgspec.structs.replace(case, **changes.get((case.solver, case.problem), {})) for case in cases]
    found = compare(*(store_run(tmp_path / name, each) for name, each in (("before", cases), ("after", changed))))
    assert "omitted because the numbers of threads that these solvers use differ: A" in found.notes
    kept = set(zip(found.cases["solver"], found.cases["problem"], strict=True))
    assert ("A", "p-1") not in kept
    assert {("A", "p-2"), ("B", "p-2")} <= kept
    assert set(found.changed("unsolved")["solver"]) == {"B"}


def test_warm_cases_of_other_starts_are_left_out_and_named(tmp_path: Path) -> None:
    runs = []
    for name, start in (("before", "0" * 16), ("after", "1" * 16)):
        cases = simulated_cases(0, solvers=("A", "Warm(A)"))
        started = [msgspec.structs.replace(case, start="0" * 16) if "W" in case.solver else case for case in cases]
        changed = [
            msgspec.structs.replace(case, start=start) if case.start and case.problem == "p-2" else case
            for case in started
        ]
        runs.append(store_run(tmp_path / name, changed))
    found = compare(*runs)
    assert "omitted because the starts of warm solvers differ on these problems: p-2" in found.notes
    assert set(found.cases["solver"][found.cases["problem"] == "p-2"]) == {"A"}
    assert set(found.cases["solver"][found.cases["problem"] == "p-1"]) == {"A", "Warm(A)"}
    assert not any("omitted" in note for note in compare(runs[0], runs[0]).notes)


@pytest.mark.slow
def test_different_library_versions_are_noted_and_do_not_prevent_the_comparison(tmp_path: Path, before: Path) -> None:
    machine = msgspec.structs.replace(MACHINE, versions={"numpy": "3"})
    found = compare(before, store_run(tmp_path / "after", simulated_cases(1), machine))
    assert "not the same: numpy 2, now 3" in found.notes
    assert not found.incomparable_reason


def with_rounds(folder: Path, **changes: object) -> Path:
    """Store the run with changed fields of its rounds."""
    cases = msgspec.to_builtins(simulated_cases(1))
    for point in (point for case in cases for point in case["points"]):
        point["measured"]["rounds"] = [{**one, **changes} for one in point["measured"]["rounds"]]
    return store_run(folder, msgspec.convert(cases, list[CaseRecord]))


@pytest.mark.weekly
def test_under_load_there_is_no_verdict(tmp_path: Path, before: Path) -> None:
    """Only one of the runs had the machine to itself, so neither can be called slower."""
    session = Session(started="2026-01-01", core=1, busy_cores=[1.0, 1.0], machine=MACHINE)
    busy = store_run(tmp_path / "busy", simulated_cases(1, dict.fromkeys("ABCD", 2.4)), sessions=[session])
    found = {
        "other programs used 1.0 cores while": busy,
        "other programs used the core in 100 % of the rounds of": with_rounds(tmp_path / "hog", excluded="preempted"),
        "took 1.30 times as long on the core while": with_rounds(tmp_path / "slow", probe_seconds=1.3e-4),
    }
    for sentence, after in found.items():
        there, back = compare(before, after), compare(after, before)
        assert sentence in there.incomparable_reason
        for comparison in (there, back):
            assert sentence.split()[0] in comparison.incomparable_reason
            assert comparison.verdict.startswith("cannot tell which solvers are slower or faster: ")
            assert not comparison.slower()
            assert comparison.failures("time>10%")
    assert not compare(before, with_rounds(tmp_path / "same", probe_seconds=1.04e-4)).incomparable_reason


def test_runs_without_anything_in_common_are_refused(tmp_path: Path, before: Path) -> None:
    others = store_run(tmp_path / "others", simulated_cases(0, solvers=("Z",)))
    with pytest.raises(BenchError, match="have no case"):
        compare(before, others)
    plan = msgspec.structs.replace(load(others).info.plan, tolerances=[1e-3], solvers=["A"])
    coarse = [msgspec.structs.replace(case, points=[]) for case in simulated_cases(0, solvers=("A",))]
    with pytest.raises(BenchError, match="have no tolerance"):
        compare(before, store_run(tmp_path / "coarse", coarse, plan=plan))


@pytest.mark.slow
def test_runs_of_another_judge_empty_runs_and_missing_folders_are_refused(tmp_path: Path, before: Path) -> None:
    refused = {
        "judged by version .* of the judge": store_run(tmp_path / "judge", simulated_cases(0), judge=7),
        "has no measured case": store_run(tmp_path / "empty", []),
        "is not a stored run": tmp_path / "nothing",
    }
    for sentence, after in refused.items():
        with pytest.raises(BenchError, match=sentence):
            compare(before, after)


def test_runs_without_any_reached_accuracy_can_be_compared(tmp_path: Path) -> None:
    runs = [store_run(tmp_path / name, [case_record()]) for name in ("before", "after")]
    found = compare(*runs)
    assert found.points.empty
    assert found.verdict == "times are undecided, no accuracy is reached by both runs; both runs solve the same points"


def test_load_is_no_obstacle_where_a_run_has_no_rounds_to_compare(tmp_path: Path) -> None:
    busy = Session(started="2026-01-01", core=1, busy_cores=[3.0, 3.0], machine=MACHINE)
    runs = [store_run(tmp_path / name, [case_record()], sessions=[busy]) for name in ("before", "after")]
    assert compare(*runs).incomparable_reason == ""
