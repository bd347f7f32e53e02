"""A bundle is a complete and consistent run without links and executable code."""

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace
from proxbench.bench import Run, bundle, merge, rejudge
from proxbench.bench.errors import BenchError
from proxbench.bench.store.bundles.bundle import Bundle, read_bundle, write_bundle
from proxbench.bench.store.records import CaseRecord, RunRecord
from proxbench.bench.store.store import Store
from proxbench.problems import ContactProblem, load

Change = Callable[[Bundle], Bundle]


def with_cases(change: Callable[[CaseRecord], CaseRecord]) -> Change:
    return lambda packed: dataclasses.replace(packed, cases=[change(case) for case in packed.cases])


def with_run(**changes: Any) -> Change:
    return lambda packed: dataclasses.replace(packed, run=replace(packed.run, **changes))


def with_plan(**changes: Any) -> Change:
    return lambda packed: with_run(plan=replace(packed.run.plan, **changes))(packed)


def without_impulses(case: CaseRecord) -> CaseRecord:
    points = [
        point if point.measured is None else replace(point, measured=replace(point.measured, impulses=[]))
        for point in case.points
    ]
    return replace(case, points=points)


def test_a_bundle_holds_the_run_as_it_is_stored(made: Run, honest: Bundle) -> None:
    store = Store.open(made.folder)
    assert honest.run == store.read_run()
    assert {(case.problem, case.solver): case for case in honest.cases} == {
        (case.problem, case.solver): case for case in store.read_cases()[0]
    }
    assert {name: problem.digest for name, problem in honest.carried.items()} == made.info.carried
    for name in made.info.plan.problems:
        assert honest.problem(name).digest == made.problem(name).digest


def test_bundles_of_equal_runs_are_identical_and_replaced_only_with_force(
    made: Run, file: Path, tmp_path: Path
) -> None:
    moved = shutil.copytree(made.folder, tmp_path / "elsewhere")
    again = bundle(moved, tmp_path / "again.bundle")
    assert again.read_bytes() == file.read_bytes()
    with pytest.raises(BenchError, match="exists already"):
        bundle(moved, again)
    assert bundle(moved, again, force=True) == again


def test_a_bundle_gets_the_name_of_its_run(made: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert bundle(made) == Path("it.bundle")
    assert [path.name for path in tmp_path.iterdir()] == ["it.bundle"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (with_run(judge=1), "was judged by version 1 of the judge"),
        (with_run(sessions=[]), "refers to a session that its run lacks"),
        (with_plan(tolerances=[1e-3]), "differs from its plan in its tolerances"),
        (with_plan(solvers=["NSGS"]), "is not in its plan"),
        (with_cases(without_impulses), "has no impulses"),
        (lambda packed: dataclasses.replace(packed, cases=[]), "has no measured case"),
        (lambda packed: dataclasses.replace(packed, cases=[*packed.cases, packed.cases[0]]), "occurs twice"),
        (with_run(carried={}), "its problems differ from its list of problems"),
        (with_run(carried={"sliding pair": "0" * 64}), "its problems differ from its list of problems"),
    ],
)
def test_a_bundle_with_inconsistent_parts_is_refused(
    change: Change, reason: str, honest: Bundle, tmp_path: Path
) -> None:
    write_bundle(change(honest), tmp_path / "odd.bundle")
    with pytest.raises(BenchError, match=reason):
        read_bundle(tmp_path / "odd.bundle")


def harder() -> ContactProblem:
    return ContactProblem.from_delassus(np.eye(6), (-1.0, 0.7, 0.1, -2.0, 0.3, -0.2), 0.1, name="sliding pair")


def test_impulses_that_solve_another_problem_do_not_agree(honest: Bundle, tmp_path: Path) -> None:
    """The attacker replaces the problem, its digest in run and cases, and computes all checksums anew."""
    digest = harder().digest
    cases = [replace(case, digest=digest) if case.problem == "sliding pair" else case for case in honest.cases]
    run = replace(honest.run, carried={"sliding pair": digest})
    forged = dataclasses.replace(honest, cases=cases, run=run, carried={"sliding pair": harder()})
    write_bundle(forged, tmp_path / "odd.bundle")
    found = rejudge(tmp_path / "odd.bundle").disagreements
    assert len(found) == 4
    assert all(" on sliding pair: " in sentence for sentence in found)


def test_a_problem_that_differs_from_the_library_problem_of_its_name_is_reported(
    honest: Bundle, tmp_path: Path
) -> None:
    easy = harder().renamed("funnel-30")
    run = replace(honest.run, carried={**honest.run.carried, "funnel-30": easy.digest})
    forged = dataclasses.replace(honest, run=run, carried={**honest.carried, "funnel-30": easy})
    write_bundle(forged, tmp_path / "odd.bundle")
    found = rejudge(tmp_path / "odd.bundle").disagreements
    assert len(found) == 4
    assert all("differs from that of this package" in sentence for sentence in found)


@pytest.mark.parametrize("name", ["../../etc/passwd.npz", "/etc/passwd", "nowhere.hdf5", "funnel-10000"])
def test_a_problem_of_unknown_name_is_not_looked_up_in_files(
    name: str, honest: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("proxbench.bench.store.bundles.bundle.load", None)
    with pytest.raises(BenchError, match=r"is neither in .* nor in this package"):
        honest.problem(name)


def test_the_library_takes_precedence_over_a_bundled_problem_of_the_same_name(honest: Bundle) -> None:
    held = load("funnel-30")
    both = dataclasses.replace(honest, carried={"funnel-30": held.renamed("funnel-30", answer="easy")})
    assert "answer" not in both.problem("funnel-30").provenance


def test_a_damaged_or_empty_run_is_not_bundled(made: Run, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(made.folder, tmp_path / "it"))
    cases = sorted((folder / "cases").iterdir())
    cases[0].write_text(cases[0].read_text().replace("1", "2", 1))
    with pytest.raises(BenchError, match=r"cannot be packed: .* is damaged"):
        bundle(folder, tmp_path / "out.bundle")
    for case in cases:
        case.unlink()
    with pytest.raises(BenchError, match="has no measured case"):
        bundle(folder, tmp_path / "out.bundle")
    with pytest.raises(BenchError, match="is not a stored run"):
        bundle(tmp_path, tmp_path / "out.bundle")
    assert [path.name for path in tmp_path.iterdir()] == ["it"]


@pytest.mark.slow
def test_reading_and_judging_a_bundle_runs_no_plugin_that_it_names(honest: Bundle, tmp_path: Path) -> None:
    trap, sprung = tmp_path / "trap.py", tmp_path / "sprung"
    trap.write_text(f"open({str(sprung)!r}, 'w')\nSOLVERS = []\n")
    use = {"kind": "solver", "name": "NSGS", "source": "", "file": str(trap), "sha256": "0"}
    run = msgspec.to_builtins(honest.run)
    forged = msgspec.convert({**run, "plugins": [use]}, RunRecord)
    write_bundle(dataclasses.replace(honest, run=forged), tmp_path / "odd.bundle")
    assert rejudge(tmp_path / "odd.bundle").disagreements == []
    merge(tmp_path / "odd.bundle", results=tmp_path, run_id="merged")
    assert not sprung.exists()
    assert (tmp_path / "merged" / "run.json").is_file()
