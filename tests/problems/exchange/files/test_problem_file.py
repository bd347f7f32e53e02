"""Problem files are read back as written, and damage is detected."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError, load, save_problem
from proxbench.problems.exchange.files.problem_file import problem_bytes, read_problem
from proxbench.problems.hard import HARD_CASES
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem


def changes(problem: ContactProblem, read: ContactProblem) -> list[str]:
    """Return the differences of two problems."""
    changed = [name for name in ("digest", "name") if getattr(read, name) != getattr(problem, name)]
    if dict(read.provenance) != dict(problem.provenance):
        changed.append("provenance")
    if read.answer is None or problem.answer is None:
        return [*changed, *(["answer"] if read.answer is not problem.answer else [])]
    for field in dataclasses.fields(problem.answer):
        known, again = getattr(problem.answer, field.name), getattr(read.answer, field.name)
        if not (np.array_equal(known, again) if known is not None else again is None):
            changed.append(field.name)
    return changed


@pytest.mark.slow
def test_every_number_survives_the_file(tmp_path: Path) -> None:
    changed = {}
    for name in (*HARD_CASES, "funnel-100", "woodpecker-beak-impact"):
        problem = load(name)
        save_problem(problem, tmp_path / f"{name}.npz")
        changed[name] = changes(problem, read_problem(tmp_path / f"{name}.npz"))
    assert {name: parts for name, parts in changed.items() if parts} == {}


def test_comparison_of_problems_detects_changed_or_missing_data() -> None:
    problem = load("hard-groove")
    assert problem.answer is not None
    assert changes(problem, problem.fresh()) == []
    assert changes(problem, load("hard-counterexample"))[:2] == ["digest", "name"]
    assert changes(problem, dataclasses.replace(problem, answer=None)) == ["answer"]
    other = dataclasses.replace(problem.answer, solvable=not problem.answer.solvable)
    assert changes(problem, dataclasses.replace(problem, answer=other)) == ["solvable"]


def test_the_free_motion_survives_the_file(tmp_path: Path) -> None:
    problem = load("funnel-100")
    save_problem(problem, tmp_path / "p.npz")
    read = read_problem(tmp_path / "p.npz")
    assert read.factors is not None
    assert problem.factors is not None
    assert np.array_equal(read.factors.free_motion, problem.factors.free_motion)  # type: ignore[arg-type]


@pytest.mark.parametrize("part", [0.2, 0.5, 0.98])
def test_truncation_is_noticed_in_one_sentence(part: float, tmp_path: Path) -> None:
    whole = problem_bytes(load("hard-groove"))
    (tmp_path / "p.npz").write_bytes(whole[: int(part * len(whole))])
    with pytest.raises(ProblemError, match=r"p.npz is damaged") as caught:
        read_problem(tmp_path / "p.npz")
    assert "\n" not in str(caught.value)


def test_a_file_with_other_numbers_than_its_digest_is_refused(tmp_path: Path) -> None:
    save_problem(load("hard-groove"), tmp_path / "p.npz")
    with np.load(tmp_path / "p.npz") as arrays:
        content = dict(arrays)
    np.savez(tmp_path / "p.npz", **{**content, "c": content["c"] * 2.0})
    with pytest.raises(ProblemError, match="does not match its digest"):
        read_problem(tmp_path / "p.npz")


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", about=np.array([{"format": 1}], dtype=object))
    with pytest.raises(ProblemError, match="damaged or not a problem file"):
        read_problem(tmp_path / "p.npz")


def test_missing_files_and_unwritable_folders_are_reported(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="there is no problem file"):
        read_problem(tmp_path / "none.npz")
    (tmp_path / "file").write_text("")
    with pytest.raises(ProblemError, match="cannot write"):
        save_problem(load("hard-groove"), tmp_path / "file" / "p.npz")


def test_a_saved_problem_is_loaded_by_its_path_as_text_or_path(tmp_path: Path) -> None:
    problem = load("hard-groove").renamed("mine")
    save_problem(problem, str(tmp_path / "new" / "p.npz"))
    for path in (tmp_path / "new" / "p.npz", str(tmp_path / "new" / "p.npz")):
        again = load(path)
        assert (again.name, again.digest) == (problem.name, problem.digest)


def test_a_file_name_that_load_would_not_recognise_is_refused_before_writing(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"name it mine\.npz"):
        save_problem(load("hard-groove"), tmp_path / "mine")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file_and_no_stray_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_problem(load("hard-groove"), tmp_path / "p.npz")
    before = (tmp_path / "p.npz").read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(ProblemError, match="No space left"):
        save_problem(ContactProblem.from_delassus(np.eye(1), (1.0,), dim=1), tmp_path / "p.npz")
    assert (tmp_path / "p.npz").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def linked(rolling_rows: int = 2) -> ContactProblem:
    return random_linked_problem(LinkedFamily(3, 3, rolling_rows=rolling_rows), 0)


def with_format(path: Path, number: int) -> Path:
    """Return the file with another format number."""
    with np.load(path) as arrays:
        content = dict(arrays)
    about = json.loads(content["about"].tobytes().decode()) | {"format": number}
    np.savez(path, **{**content, "about": np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)})
    return path


@pytest.mark.parametrize("rolling_rows", [0, 1, 2, 3])
def test_joints_and_rolling_friction_survive_the_file(rolling_rows: int, tmp_path: Path) -> None:
    problem = linked(rolling_rows)
    save_problem(problem, tmp_path / "p.npz")
    read = read_problem(tmp_path / "p.npz")
    assert read.digest == problem.digest
    assert read.laws.kind.tolist() == problem.laws.kind.tolist()
    assert np.array_equal(read.answer.witness, problem.answer.witness)  # type: ignore[union-attr, arg-type]


@pytest.mark.parametrize(("problem", "number"), [(load("hard-groove"), 1), (linked(0), 2), (linked(), 2)])
def test_contacts_alone_keep_the_format_that_older_versions_read(
    problem: ContactProblem, number: int, tmp_path: Path
) -> None:
    save_problem(problem, tmp_path / "p.npz")
    with np.load(tmp_path / "p.npz") as arrays:
        assert json.loads(arrays["about"].tobytes().decode())["format"] == number


def test_invalid_number_is_reported_with_its_file_and_index(tmp_path: Path) -> None:
    save_problem(load("funnel-30"), tmp_path / "p.npz")
    with np.load(tmp_path / "p.npz") as content:
        arrays = dict(content)
    arrays["friction_coefficient"] = -arrays["friction_coefficient"]
    np.savez(tmp_path / "p.npz", **arrays)
    with pytest.raises(ProblemError, match=r"p\.npz: laws\.friction_coefficient\[1\] = -0\.3 must be"):
        read_problem(tmp_path / "p.npz")


def test_a_newer_format_is_refused_in_one_sentence(tmp_path: Path) -> None:
    save_problem(load("hard-groove"), tmp_path / "p.npz")
    with pytest.raises(ProblemError, match="has format 4, but this version reads formats up to 3"):
        read_problem(with_format(tmp_path / "p.npz", 4))
