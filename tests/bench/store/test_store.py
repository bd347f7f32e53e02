"""Results survive damage to other files, and damage is detected."""

import json
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from proxbench.bench.errors import BenchError
from proxbench.bench.store.records import CaseRecord, RunRecord
from proxbench.bench.store.store import Store, plain_name
from proxbench.problems import ContactProblem, ProblemError, load


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.create(tmp_path / "run")


def only_case(store: Store) -> Path:
    (file,) = (store.folder / "cases").iterdir()
    return file


def test_a_case_is_read_back_and_infinity_becomes_null(store: Store, case: CaseRecord) -> None:
    store.write_case(case)
    cases, damaged = store.read_cases()
    assert damaged == []
    (again,) = cases
    assert again.curve.residual == [None]
    (point,), (written,) = again.points, case.points
    assert written.measured is not None
    nulls = {"residual": None, "verdict": {"infeasible": False, "velocity_error": None}}
    assert point.measured == replace(written.measured, **nulls)
    assert replace(again, curve=case.curve, points=case.points) == case


def test_case_names_cannot_escape_the_folder(store: Store, case: CaseRecord) -> None:
    store.write_case(case)
    assert only_case(store).parent == store.folder / "cases"


def test_similar_names_get_different_case_files(store: Store, case: CaseRecord) -> None:
    store.write_case(replace(case, solver="S(x=1)"))
    store.write_case(replace(case, solver="S[x=1]"))
    assert len(store.read_cases()[0]) == 2


@pytest.mark.parametrize("position", [0.1, 0.5, 0.9])
def test_truncation_and_every_flipped_bit_are_noticed(store: Store, case: CaseRecord, position: float) -> None:
    store.write_case(case)
    file = only_case(store)
    whole = file.read_bytes()
    at = int(position * len(whole))
    for damaged in (whole[:at], whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :]):
        file.write_bytes(damaged)
        cases, sentences = store.read_cases()
        assert cases == []
        assert len(sentences) == 1
        assert file.name in sentences[0]


def test_another_format_is_noticed(store: Store, case: CaseRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("proxbench.bench.store.conversion.FORMAT", 99)
    store.write_case(case)
    monkeypatch.undo()
    assert "format" in store.read_cases()[1][0]


def test_damaged_case_does_not_affect_the_others(store: Store, case: CaseRecord) -> None:
    store.write_case(case)
    only_case(store).write_text("{")
    store.write_case(replace(case, problem="other"))
    cases, damaged = store.read_cases()
    assert [one.problem for one in cases] == ["other"]
    assert len(damaged) == 1


def test_an_interrupted_write_leaves_the_old_file_and_no_stray_one(
    store: Store, case: CaseRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.write_case(case)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(BenchError, match="No space left"):
        store.write_case(replace(case, wall_seconds=2.5))
    assert store.read_cases()[0][0].wall_seconds == 1.5
    assert len(list((store.folder / "cases").iterdir())) == 1


def test_a_problem_is_read_back_by_its_digest_and_another_one_in_its_place_is_refused(
    store: Store, record: RunRecord
) -> None:
    mine, other = load("hard-groove"), load("hard-sticking-box")
    for problem in (mine, other):
        store.write_problem(problem)
    store.write_run(record)
    stored = Store.open(store.folder)
    again = stored.read_problem(mine.digest)
    assert (again.digest, again.name) == (mine.digest, mine.name)
    file = store.folder / "problems" / f"{mine.digest}.npz"
    file.write_bytes((store.folder / "problems" / f"{other.digest}.npz").read_bytes())
    with pytest.raises(BenchError, match="contains a problem with another digest"):
        stored.read_problem(mine.digest)
    file.unlink()
    with pytest.raises(ProblemError, match="there is no problem file"):
        stored.read_problem(mine.digest)


def test_store_can_be_read_and_restored_after_its_folder_is_deleted(store: Store, case: CaseRecord) -> None:
    problem = load("hard-groove")
    store.write_problem(problem)
    store.write_case(case)
    before = {file: file.read_bytes() for file in store.folder.rglob("*.*")}
    shutil.rmtree(store.folder)
    assert store.read_problem(problem.digest).digest == problem.digest
    store.restore()
    assert {file: file.read_bytes() for file in store.folder.rglob("*.*")} == before


def test_problems_of_equal_digest_are_stored_once(store: Store) -> None:
    problem = ContactProblem.from_delassus([[1.0]], [1.0], dim=1)
    for name in ("one", "two"):
        store.write_problem(problem.renamed(name))
    assert len(list((store.folder / "problems").iterdir())) == 1


def test_an_existing_run_is_not_overwritten(store: Store, record: RunRecord) -> None:
    store.write_run(record)
    with pytest.raises(BenchError, match="exists already"):
        Store.create(store.folder)


def test_a_folder_of_a_run_killed_before_its_start_is_reused(store: Store) -> None:
    (store.folder / ".run.json-x.part").write_text("{")
    with Store.create(store.folder).locked():
        assert [entry.name for entry in store.folder.iterdir()] == ["cases"]


def test_second_writer_is_refused(store: Store) -> None:
    with store.locked(), pytest.raises(BenchError, match="another process is writing"), store.locked():
        pass


@pytest.mark.parametrize("name", ["cases", "problems"])
def test_a_run_is_not_continued_through_a_link_out_of_it(store: Store, tmp_path: Path, name: str) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    place = store.folder / name
    if place.exists():
        place.rmdir()
    place.symlink_to(elsewhere)
    with pytest.raises(BenchError, match="is a symbolic link to"), store.locked():
        pass


def test_unwritable_folder_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BenchError, match="cannot write"):
        Store.create(tmp_path / "file" / "run")


def test_a_path_that_is_not_a_run_is_refused_with_what_was_found_there(
    tmp_path: Path, store: Store, record: RunRecord
) -> None:
    store.write_run(record)
    (tmp_path / "empty").mkdir()
    (tmp_path / "it.bundle").write_bytes(b"")
    for name, fault, remedy in (
        ("empty", "it has no run.json", "name the folder of a run"),
        ("nosuch", "it does not exist", "name the folder of a run"),
        ("it.bundle", "it is a bundle", "unpack it with: proxbench merge "),
        ("", "stored runs in it: 1", f"name one of them, such as {store.folder}"),
    ):
        with pytest.raises(BenchError, match=re.escape(f"is not a stored run ({fault}); {remedy}")):
            Store.open(tmp_path / name)


def test_files_are_plain_json(store: Store, case: CaseRecord) -> None:
    store.write_case(case)
    assert json.loads(only_case(store).read_text())["problem"] == "a/../b"


@given(first=st.text(max_size=90), second=st.text(max_size=90))
def test_file_names_of_cases_are_short_safe_and_unique(first: str, second: str) -> None:
    plain = plain_name(first)
    assert re.fullmatch(r"[A-Za-z0-9._-]{0,60}", plain)
    assert not plain.startswith(".")
    assert (plain == plain_name(second)) == (first == second)


def test_file_names_of_cases_agree_with_those_of_older_runs() -> None:
    """A name that is not plain ends with the first eight digits of its SHA-256, as sha256sum prints them."""
    assert plain_name("NSGS") == "NSGS"
    assert plain_name("a/../b") == "a_.._b-900ea8b7"
    assert plain_name(61 * "x") == 51 * "x" + "-c508e75f"
